"""Frames: whether weights and gradients belong to the present or to the reference configuration.

``Updated`` takes gradients in space, and forces from the Kirchhoff stress; ``Total`` takes them
with respect to reference positions, and forces from the first Piola-Kirchhoff stress, for which it
needs the deformation gradient F of the points.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function
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


@point_function(otherwise=True)
def follows(frame):
    """Check that weights follow the points; constant at compile time."""
    return True


@follows.on(Total)
def _follows_total(frame):
    return False


@point_function(otherwise=True)
def spatial_increment(frame, kin, dl, f):
    """dt grad v from `dl`, dt times the gradient of velocity in the frame, and F before it."""
    return dl


@spatial_increment.on(Total)
def _spatial_increment_total(frame, kin, dl, f):
    # F + dt Fdot = (I + dt Fdot F^-1) F exactly
    return dl @ inv(f)


@point_function(otherwise=True)
def of_places_before(frame, kin, dl):
    """`dl` of the places before a motion, from that of the places after it."""
    # grad v there is grad v here (I - dl)^-1, so that F grows by (I - dl)^-1 exactly. As a product
    # it keeps its digits where dl is small.
    return dl @ inv(I - dl)


@of_places_before.on(Total)
def _of_places_before_total(frame, kin, dl):
    return dl  # gradients belong to the reference


@point_function(otherwise=True)
def strained(frame, kin, f, dl):
    """F where the frame needs it, after what `spatial_increment` takes from F before it."""
    return f


@strained.on(Total)
def _strained_total(frame, kin, f, dl):
    return f + dl


@point_function(otherwise=True)
def force_stress(frame, kin, tau, f):
    """The stress that makes nodal forces, per reference volume."""
    return tau


@force_stress.on(Total)
def _force_stress_total(frame, kin, tau, f):
    return tau.nominal(f)


@point_function(otherwise=True)
def pulled_back(frame, kin, g, f):
    """The direction of a flux down the gradient `g`, pulled back to the frame.

    Per deformed volume: in space that is g, and C^-1 g with respect to reference positions, which
    C^-1 = F^-1 F^-T takes to space and back.
    """
    return g


@pulled_back.on(Total)
def _pulled_back_total(frame, kin, g, f):
    inside = inv(f.planar()).left_cauchy_green()
    return inside.dot(g)


@point_function(otherwise=True)
def scaled_increment(frame, kin, dl, f, ratio):
    """`dl` changed such that the volume after it is `ratio` times what it would be."""
    # (I + dl) s - I
    s = power(ratio, 1 / len(dl.axes))
    return s * dl + (s - 1) * I


@scaled_increment.on(Total)
def _scaled_increment_total(frame, kin, dl, f, ratio):
    # (F + dl) s - F
    s = power(ratio, 1 / len(dl.axes))
    return s * dl + (s - 1) * f


@point_function(otherwise=True)
def inverse_stretch_squared(frame, kin, f, like):
    """(h / size of a deformed cell)^2, one over the least stretch squared: it shortens the step."""
    return 1


@inverse_stretch_squared.on(Total)
def _inverse_stretch_squared_total(frame, kin, f, like):
    # 1 / (smallest stretch)^2 is the largest eigenvalue of F^-1 F^-T.
    return inv(f).left_cauchy_green().largest_row_sum()
