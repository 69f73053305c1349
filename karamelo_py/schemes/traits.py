"""Traits of a scheme: all that the rest of the program reads from it."""

from collections.abc import Callable
from typing import Any, NamedTuple

DEFAULT_SHARE = 0.9  # default fraction of the stable step


class SchemeTraits(NamedTuple):
    """Traits of a scheme; a plug-in gives those that differ from these defaults."""

    # Steps are equilibria or balances found by Newton's method, with or without inertia.
    implicit: bool = False
    inertia: bool = True
    # Stable step in h/c with two points per cell and direction, and with one.
    courant: tuple[float, float] = (1.0, 1.0)
    # Fractions of the stable step that conserve a drifting body's energy, with 2 and 1 points per
    # cell: smooth gradients, gradient jumps, nodes within cells. None: drift adds no energy.
    keeping: tuple[tuple[float, float], ...] | None = None
    # Fraction of a step's strain that precedes the forces.
    strained_before: float = 0.0
    # The velocity of the moved points is mapped to the nodes again.
    maps_velocity_again: bool = False
    # The scheme of steps in which fixes lead points of deformable bodies; None: this one.
    leading: Any = None
    # Drifting bodies gain no energy.
    bears_drift: bool = False
    # Vibrations are damped, with two points per cell and direction.
    damps: bool = False
    # Names the parameters that damp vibrations; empty if none.
    damping: Callable[[Any], str] = lambda scheme: ""
