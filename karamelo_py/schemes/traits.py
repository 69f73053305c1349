"""Traits of a scheme."""

from collections.abc import Callable
from typing import Any, NamedTuple

from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.language.rules import Restrictions

DEFAULT_FRACTION = 0.9  # fraction of the stable step

IMPLICIT = Restrictions(
    "implicit", "an explicit scheme, scheme(musl)",
    only={"transfer": ("FLIP", "PIC")},  # positions are changed by increments
    without=("single", "ranks", "gpu"), but={"reflect": "fix velocity_nodes"},
)  # fmt: skip


class SchemeTraits(NamedTuple):
    """Traits of a scheme. A plug-in sets the traits that differ from the defaults."""

    # whether each step is solved by Newton's method
    implicit: bool = False
    restrictions: Restrictions | None = None
    inertia: bool = True
    # stable step in h/c with two points per cell and direction, and with one
    courant: tuple[float, float] = (1.0, 1.0)
    # `courant` in scenes with a solid without pore water, or whose water is softer than its soil
    courant_of_dry: tuple[float, float] | None = None
    # Fractions of the stable step up to which a drifting body gains no energy, for 2 and 1 points
    # per cell, by basis: smooth gradients, gradient jumps, nodes within cells. None: any step.
    conserving: tuple[tuple[float, float], ...] | None = None
    # fraction of the strain increment that precedes the forces
    strained_before: float = 0.0
    # whether velocities are mapped to the nodes again after the points have moved
    maps_velocity_again: bool = False
    # scheme for steps in which fixes prescribe velocities of deformable points; None: the scheme
    # itself
    leading: Any = None
    # whether a drifting body never gains energy
    allows_drift: bool = False
    # whether vibrations are damped with two points per cell and direction
    damps: bool = False
    # whether the pore pressure at the end of a step is solved for
    solves_pressure: bool = False
    # class that sums energy lost in the transfer (`kernels.equations.transfer_loss`), None: unknown
    loss: type[TransferLoss] | None = None
    # returns the parameters of the scheme that damp vibrations, as text
    damping: Callable[[Any], str] = lambda scheme: ""
