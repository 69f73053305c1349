"""Axisymmetric bodies that twist: a velocity around the axis, and its shears.

Axes 1, 2, 3 are along the radius, along the axis, and around it. These axes rotate around the axis
of symmetry with each point, so that rigid rotation causes no strain. Tensors have the components of
3D in another order. In velocity gradient and F, components 13 and 23 are 0; with angular velocity w
and rotation phi, 31 and 32 are r dw/dr and r dw/dz in the gradient, r dphi/dR and r dphi/dZ in F.
"""

from karamelo_py.compiler import algebra, real
from karamelo_py.points.kinematics import (
    Axisymmetric,
    Space,
    SymmetricTensor,
    Tensor,
    outer,
    set_rows,
    tensor_class,
)


class Twisted(Axisymmetric):
    """A body of revolution with torsion."""

    __slots__ = ()
    word = "axisymmetric with twist"
    tensor_size = 9
    tensor_names = ("11", "12", "21", "22", "33", "31", "32", "13", "23")
    symmetric_names = ("11", "22", "33", "12", "13", "23")


@algebra
class TwistedStress(SymmetricTensor):
    __slots__ = ()

    def nominal(self, F):
        """Return P = s F^-T, except for component 33, s_33 / F_33, which acts on the radius.

        A radial displacement also changes 31 and 32 of F, in proportion to r.
        """
        made = SymmetricTensor.nominal(self, F)
        hoop = self[2] / F[4]
        return made._make([*made[:4], hoop, *made[5:]])


Twisted.Unknown = Space.Vector  # displacement and rotation
Twisted.Tensor = tensor_class(Tensor, Twisted, Twisted.tensor_names)
Twisted.Symmetric = tensor_class(TwistedStress, Twisted, Twisted.symmetric_names)
Twisted.Tensor.symmetric = Twisted.Symmetric
for _one in (Twisted.Tensor, Twisted.Symmetric):
    set_rows(_one, Axisymmetric.Tensor)
    _one.vector = Twisted.Vector
    _one.kin = Space()


def twisted(in_plane, around):
    zero = real(0, around[0])
    return Twisted.Tensor._make((*in_plane, *around, zero, zero))


def gradient_around(v, omega, slopes):
    """Return the gradient of a node's weight times its velocity, with dw/dr and dw/dz in 31, 32."""
    return twisted(outer(v, slopes), (omega * slopes[0], omega * slopes[1]))


def times_radius(gradient, r, F):
    """Make an increment from a sum of `gradient_around`; F is () in the updated frame.

    With the radius r at the end of the step, F is a function of the positions.
    """
    around = tuple([r * slope for slope in gradient[5:7]])
    if len(F):
        growth = gradient[4] / F[4]
        around = tuple([a + growth * f for a, f in zip(around, F[5:7], strict=True)])
    return twisted(gradient[:5], around)
