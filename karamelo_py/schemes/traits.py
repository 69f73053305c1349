"""Traits of a scheme: all that the rest of the program reads from it."""

from collections.abc import Callable
from typing import Any, NamedTuple

USUAL = 0.9  # of the stable step, which the program takes where nothing asks for less


class SchemeTraits(NamedTuple):
    """Traits of a scheme; a plug-in gives those that differ from these defaults."""

    # Steps are equilibria or balances that Newton's method finds, with or without inertia.
    implicit: bool = False
    inertia: bool = True
    # Stable step in h/c with two points per cell and direction, and with one.
    courant: tuple[float, float] = (1.0, 1.0)
    # Fractions of the stable step with which a drifting body conserves its energy, with 2 and 1
    # points per cell: smooth gradients, gradients that jump, nodes within the cells. None: a drift
    # feeds nothing.
    keeping: tuple[tuple[float, float], ...] | None = None
    # Fraction of a step's strain that comes before the forces.
    strained_before: float = 0.0
    # The velocity of the moved points is mapped to the nodes once more.
    maps_velocity_again: bool = False
    # Bodies that drift through the grid gain no energy.
    bears_drift: bool = False
    # Vibrations are damped, with two points per cell and direction.
    damps: bool = False
    # What damps vibrations through the parameters of the scheme; empty if nothing does.
    damping: Callable[[Any], str] = lambda scheme: ""
