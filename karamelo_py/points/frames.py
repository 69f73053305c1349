"""Frames: whether weights and gradients belong to the present or to the reference configuration.

``Updated`` takes gradients in space, and forces from the Kirchhoff stress; ``Total`` takes them
with respect to reference positions, and forces from the first Piola-Kirchhoff stress, for which it
needs the deformation gradient F of the points.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler.fields import Field, tensor
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import I, inv, unit
from karamelo_py.points.laws import deformation


class Updated(NamedTuple):
    """Weights follow the present positions (updated Lagrangian)."""

    moves = True


class DeformationGradient(Field):
    """F, of laws whose state does not hold it."""

    shape = tensor

    @staticmethod
    def start(kin: Any) -> tuple[float, ...]:
        """The unit tensor."""
        return tuple(map(float, unit(kin)))

    @staticmethod
    def needed(law: NamedTuple) -> bool:
        """Check that a law has no F of its own."""
        return not deformation.defined(type(law))


class Total(NamedTuple):
    """Weights belong to the reference positions and never change (total Lagrangian)."""

    moves = False
    point_fields = (DeformationGradient,)


def spatial_increment(frame, kin, dl, f):
    """dt grad v from `dl`, dt times the gradient of velocity in the frame, and F before it."""
    # F + dt Fdot = (I + dt Fdot F^-1) F exactly
    return dl if frame.moves else dl @ inv(f)


def of_places_before(frame, kin, dl):
    """`dl` of the places before a motion, from that of the places after it."""
    # grad v there is grad v here (I - dl)^-1, so that F grows by (I - dl)^-1 exactly. As a product
    # it keeps its digits where dl is small. Gradients of the total frame belong to the reference.
    return dl @ inv(I - dl) if frame.moves else dl


def strained(frame, kin, f, dl):
    """F where the frame needs it, after what `spatial_increment` takes from F before it."""
    return f if frame.moves else f + dl


def force_stress(frame, kin, tau, f):
    """The stress that makes nodal forces, per reference volume."""
    return tau if frame.moves else tau.nominal(f)


def pulled_back(frame, kin, g, f):
    """The direction of a flux down the gradient `g`, pulled back to the frame.

    Per deformed volume: in space that is g, and C^-1 g with respect to reference positions, which
    C^-1 = F^-1 F^-T takes to space and back.
    """
    return g if frame.moves else inv(f.planar()).left_cauchy_green().dot(g)


def scaled_increment(frame, kin, dl, f, ratio):
    """`dl` changed such that the volume after it is `ratio` times what it would be."""
    # (I + dl) s - I in space, (F + dl) s - F with respect to the reference
    s = power(ratio, 1 / len(dl.axes))
    return s * dl + (s - 1) * (I if frame.moves else f)


def inverse_stretch_squared(frame, kin, f, like):
    """(h / size of a deformed cell)^2, one over the least stretch squared: it shortens the step."""
    # The largest eigenvalue of F^-1 F^-T.
    return 1 if frame.moves else inv(f).left_cauchy_green().largest_row_sum()
