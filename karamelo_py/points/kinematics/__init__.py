"""Kinematics: which components of vectors and tensors exist, and the algebra on them.

================  ==============  =============================  =================================
tag               vector          velocity gradient, F           symmetric tensor (stress, strain)
================  ==============  =============================  =================================
``Line``          x               xx                             xx yy zz
``PlaneStrain``   x y             xx xy yx yy                    xx yy zz xy
``Axisymmetric``  r z             rr rz zr zz tt                 rr zz tt rz
``Space``         x y z           xx xy xz yx yy yz zx zy zz     xx yy zz xy xz yz
================  ==============  =============================  =================================

The gradient of a basis function has the components of a vector, and a third, N/r, at an
axisymmetric point. The tags are empty NamedTuples: kernels are made for each of them, without
branches.
"""

from karamelo_py.points.kinematics.principal import from_principal, principal
from karamelo_py.points.kinematics.tags import (
    KINEMATICS,
    TAGS,
    Axisymmetric,
    Line,
    PlaneStrain,
    Space,
    dimension,
    free_from,
    planar,
)
from karamelo_py.points.kinematics.tensors import (
    I,
    Isotropic,
    SymmetricTensor,
    Tensor,
    Vector,
    det,
    dev,
    from_columns,
    gradient,
    inner,
    inv,
    nothing,
    outer,
    sym,
    symmetric_tensor,
    tensor,
    tr,
    unit,
    vector,
    von_mises,
    zero,
    zero_vector,
)
