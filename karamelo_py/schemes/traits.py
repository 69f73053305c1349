"""Traits of a scheme."""

from collections.abc import Callable
from typing import Any, NamedTuple

from karamelo_py.language.rules import Restrictions

DEFAULT_SHARE = 0.9  # fraction of the stable step

IMPLICIT = Restrictions(
    "implicit", "an explicit scheme, scheme(musl)",
    only={"transfer": ("FLIP", "PIC")},  # points move by increments
    without=("single", "ranks", "gpu"), but={"reflect": "fix velocity_nodes"},
)  # fmt: skip


class SchemeTraits(NamedTuple):
    """Traits of a scheme; a plug-in sets those that differ from the defaults."""

    # Newton's method solves each step
    implicit: bool = False
    restrictions: Restrictions | None = None
    inertia: bool = True
    # stable step in h/c with two points per cell and direction, and with one
    courant: tuple[float, float] = (1.0, 1.0)
    # Fractions of the stable step that conserve a drifting body's energy with (2, 1) points per
    # cell: smooth gradients, gradient jumps, nodes within cells. None: drift adds no energy.
    keeping: tuple[tuple[float, float], ...] | None = None
    # fraction of a step's strain before the forces
    strained_before: float = 0.0
    # maps the moved points' velocity to the nodes again
    maps_velocity_again: bool = False
    # scheme for steps in which fixes move deformable points; None: this one
    leading: Any = None
    # drifting bodies gain no energy
    bears_drift: bool = False
    # damps vibrations, with two points per cell and direction
    damps: bool = False
    # names the parameters that damp vibrations
    damping: Callable[[Any], str] = lambda scheme: ""
