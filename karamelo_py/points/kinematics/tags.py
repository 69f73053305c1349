"""The tags of kinematics, and the tables of the components that tensors have there."""

from typing import NamedTuple

from karamelo_py.compiler.compile import shared


class Line(NamedTuple):
    """One dimension: uniaxial strain, the limit that plane strain and space have too."""

    word = "1D"
    dimension = 1
    tensor_size = 1
    tensor_names = ("11",)
    symmetric_names = ("11", "22", "33")


class PlaneStrain(NamedTuple):
    """Two dimensions, unit thickness, no strain out of the plane."""

    word = "plane-strain"
    dimension = 2
    tensor_size = 4
    tensor_names = ("11", "12", "21", "22")
    symmetric_names = ("11", "22", "33", "12")


class Axisymmetric(NamedTuple):
    """Two dimensions, x the radius and y the axis: a body of revolution without torsion.

    The gradient of a basis function N at such a point has three components,
    (dN/dr, dN/dz, N/r): the last makes the strain and the force around the axis.
    """

    word = "axisymmetric"
    dimension = 2
    tensor_size = 5
    tensor_names = ("11", "12", "21", "22", "33")
    symmetric_names = ("11", "22", "33", "12")


class Space(NamedTuple):
    """Three dimensions."""

    word = "3D"
    dimension = 3
    tensor_size = 9
    tensor_names = ("11", "12", "13", "21", "22", "23", "31", "32", "33")
    symmetric_names = ("11", "22", "33", "12", "13", "23")


TAGS = (Line, PlaneStrain, Axisymmetric, Space)
KINEMATICS = {1: Line, 2: PlaneStrain, 3: Space}


@shared
def dimension(kin):
    """Number of components of a vector, a constant at compile time."""
    return kin.dimension


@shared
def free_from(kin):
    """First direction in which a body may move as a whole: no radius is one, a constant."""
    return 1 if isinstance(kin, Axisymmetric) else 0


@shared
def planar(kin):
    """The tag whose tensors are plain d x d matrices of the same vectors.

    Moments of velocity have no part around the axis: those of axisymmetric points are plane.
    """
    return PlaneStrain() if isinstance(kin, Axisymmetric) else kin
