"""Frames: present (``Updated``) or reference positions (``Total``).

``Updated`` uses spatial gradients and the Kirchhoff stress; ``Total`` uses reference gradients, the
first Piola-Kirchhoff stress and the deformation gradient F.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler.fields import Field, tensor
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import I, inv, unit
from karamelo_py.points.laws import answered, deformation


class Updated(NamedTuple):
    moves = True


class DeformationGradient(Field):
    shape = tensor

    @staticmethod
    def start(kin: Any) -> tuple[float, ...]:
        return tuple(map(float, unit(kin)))

    @staticmethod
    def needed(law: NamedTuple) -> bool:
        return not answered(law, deformation)


class Total(NamedTuple):
    moves = False
    point_fields = (DeformationGradient,)


def spatial_increment(frame, kin, dl, f):
    """Convert `dl` of a frame to the spatial increment dt grad v; `f` is F before the step."""
    # F + dt Fdot = (I + dt Fdot F^-1) F, exactly
    return dl if frame.moves else dl @ inv(f)


def of_places_before(frame, kin, dl):
    """Convert `dl`, computed with the gradient after a move, to positions before the move."""
    # The gradient at old positions is dl (I - dl)^-1; F is then multiplied by (I - dl)^-1.
    return dl @ inv(I - dl) if frame.moves else dl


def strained(frame, kin, f, dl):
    return f if frame.moves else f + dl


def force_stress(frame, kin, tau, f):
    return tau if frame.moves else tau.nominal(f)


def pulled_back(frame, kin, g, f):
    """Pull the gradient g back to the flux direction C^-1 g = F^-1 F^-T g."""
    return g if frame.moves else inv(f.planar()).left_cauchy_green().dot(g)


def scaled_increment(frame, kin, dl, f, ratio):
    # updated frame: (I + dl) s - I; total frame: (F + dl) s - F
    s = power(ratio, 1 / len(dl.axes))
    return s * dl + (s - 1) * (I if frame.moves else f)


def inverse_stretch_squared(frame, kin, f, template):
    """Return an upper bound of (h / size of a deformed cell)^2."""
    return 1 if frame.moves else inv(f).left_cauchy_green().largest_row_sum()
