"""The tags of kinematics, and what they say of themselves."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function


class Line(NamedTuple):
    """One dimension: uniaxial strain, the limit that plane strain and space have too."""

    word = "1D"
    dimension = 1
    tensor_size = 1
    symmetric_names = ("11", "22", "33")


class PlaneStrain(NamedTuple):
    """Two dimensions, unit thickness, no strain out of the plane."""

    word = "plane-strain"
    dimension = 2
    tensor_size = 4
    symmetric_names = ("11", "22", "33", "12")


class Axisymmetric(NamedTuple):
    """Two dimensions, x the radius and y the axis: a body of revolution without torsion.

    The gradient of a basis function N at such a point has three components,
    (dN/dr, dN/dz, N/r): the last makes the strain and the force around the axis.
    """

    word = "axisymmetric"
    dimension = 2
    tensor_size = 5
    symmetric_names = ("11", "22", "33", "12")


class Space(NamedTuple):
    """Three dimensions."""

    word = "3D"
    dimension = 3
    tensor_size = 9
    symmetric_names = ("11", "22", "33", "12", "13", "23")


KINEMATICS = {1: Line, 2: PlaneStrain, 3: Space}


@point_function()
def dimension(kin):
    """Number of components of a vector, a constant at compile time."""


@dimension.on(Line)
def _(kin):
    return 1


@dimension.on(PlaneStrain)
@dimension.on(Axisymmetric)
def _(kin):
    return 2


@dimension.on(Space)
def _(kin):
    return 3


@point_function()
def planar(kin):
    """The tag whose tensors are plain d x d matrices of the same vectors.

    Moments of velocity have no part around the axis: those of axisymmetric points are plane.
    """


@planar.on(Line)
def _(kin):
    return Line()


@planar.on(PlaneStrain)
@planar.on(Axisymmetric)
def _(kin):
    return PlaneStrain()


@planar.on(Space)
def _(kin):
    return Space()
