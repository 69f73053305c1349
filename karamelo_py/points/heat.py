"""Heat at one point."""

from math import sqrt

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def face(kin, volume, x):
    """Area that a point of this volume shows to what is around it: the side of a cube.

    Per length across the plane, per radian where axisymmetric.
    """


@face.on(Line)
def _face_line(kin, volume, x):
    return 1


@face.on(PlaneStrain)
def _face_plane_strain(kin, volume, x):
    return sqrt(volume)


@face.on(Axisymmetric)
def _face_axisymmetric(kin, volume, x):
    # r times the side of the square volume / r
    return sqrt(volume * x[0])


@face.on(Space)
def _face_space(kin, volume, x):
    return power(volume, 2 / 3)
