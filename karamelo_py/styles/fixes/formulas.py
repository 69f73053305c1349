"""Base of fixes that act by a formula for each component."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.expressions import FIRST

AXES = "xyz"


def per_direction(hub: Hub, name: str, formulas: tuple) -> tuple:
    """Check that there is one formula (or NULL) for each direction of the domain.

    Further components are allowed when they are NULL or zero, as published inputs write them.
    """
    d = require_domain(hub).dimension
    wanted = ", ".join(name + axis for axis in AXES[:d])
    if len(formulas) < d:
        raise ScriptError(
            f"{plural(len(formulas), 'component')} in {plural(d, 'dimension')}",
            expected=f"{wanted} (NULL leaves a component alone)",
        )
    if len(formulas) > 3:
        raise ScriptError(
            f"{len(formulas)} components, and space has 3 directions", expected=wanted
        )
    for extra in formulas[d:]:
        if extra is not None and not (extra.is_constant and extra.constant == 0):
            raise ScriptError(
                f"more components than the {plural(d, 'dimension')} of the domain",
                expected=f"{wanted} (a further one may only be NULL or 0)",
                hint=f"the last direction here is {AXES[d - 1]}: gravity is a component of it",
            )
    if all(formula is None for formula in formulas[:d]):
        hub.warn("all components are NULL: it leaves everything alone")
    return formulas[:d]


def evaluated(formula: Any, hub: Hub, x: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """Values (n,) of a formula at the positions `x` and reference positions `x0`, (n, d) each."""
    return formula.evaluate_points(hub.values, x, x0)


def vector(formulas: Sequence, hub: Hub, x: np.ndarray, first: Callable) -> np.ndarray:
    """Values (n, d) of a formula for each direction, 0 where there is none.

    `first()` gives the reference positions, where a formula asks for these.
    """
    asked = any(formula is not None and formula.names & FIRST for formula in formulas)
    x0 = first() if asked else x
    found = np.zeros(x.shape)
    for k, formula in enumerate(formulas):
        if formula is not None:
            found[:, k] = evaluated(formula, hub, x, x0)
    return found


def gradient(
    formula: Any, hub: Hub, x: np.ndarray, x0: np.ndarray, moves: bool, step: float
) -> np.ndarray:
    """Derivatives (n, d) of a formula by x (`moves`) or x0, by central differences over `step`.

    Where a point is still at its reference position, x and x0 are the same coordinate.
    """
    out = np.zeros_like(x, float)
    if formula.is_constant:
        return out
    # Positions in single precision are rounded.
    unmoved = (np.abs(x - x0) <= 0.01 * step).all(axis=1)
    for k in range(x.shape[1]):
        shift = np.zeros_like(out)
        shift[:, k] = step
        here = shift if moves else shift * unmoved[:, None]
        there = shift * unmoved[:, None] if moves else shift
        ahead = evaluated(formula, hub, x + here, x0 + there)
        behind = evaluated(formula, hub, x - here, x0 - there)
        out[:, k] = (ahead - behind) / (2 * step)
    return out
