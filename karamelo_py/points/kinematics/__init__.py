"""Kinematics: which components of vectors and tensors exist, and the algebra on them.

Every tensor of a point is a flat tuple with the components that its kinematics has:

================  ==============  =============================  =================================
tag               vector          velocity gradient, F           symmetric tensor (stress, strain)
================  ==============  =============================  =================================
``Line``          x               xx                             xx yy zz
``PlaneStrain``   x y             xx xy yx yy                    xx yy zz xy
``Axisymmetric``  r z             rr rz zr zz tt                 rr zz tt rz
``Space``         x y z           xx xy xz yx yy yz zx zy zz     xx yy zz xy xz yz
================  ==============  =============================  =================================

The gradient of a basis function has the components of a vector, and a third, N/r, at an
axisymmetric point. The tags are empty NamedTuples: Numba compiles a kernel for each of them,
without branches.
"""

from karamelo_py.points.kinematics.deformation import (
    deform,
    determinant,
    identity,
    increment_of,
    inverse,
    left_cauchy_green,
    multiply,
    right_cauchy_green,
    stretch,
    volume_ratio,
    zero_tensor,
)
from karamelo_py.points.kinematics.principal import from_principal, principal
from karamelo_py.points.kinematics.symmetric import (
    add_pressure,
    after_symmetric,
    contract,
    deviator,
    largest_row_sum,
    leading_symmetric,
    nominal,
    spin,
    stretching_mean,
    symmetric_part,
    trace,
    von_mises,
    zero_symmetric,
)
from karamelo_py.points.kinematics.tags import (
    KINEMATICS,
    Axisymmetric,
    Line,
    PlaneStrain,
    Space,
    dimension,
    free_from,
    planar,
)
from karamelo_py.points.kinematics.vectors import (
    add_outer,
    add_symmetric_dot,
    add_tensor_dot,
    columns,
    diagonal,
    from_columns,
    largest_component,
    symmetric_columns,
    tensor_dot,
    vector_at,
)
