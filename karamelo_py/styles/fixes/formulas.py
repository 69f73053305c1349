"""Formulas per direction, and coefficients of friction."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import FIRST

AXES = "xyz"
USUAL_FRICTION = 2.0  # 1 for rubber on dry concrete, 1.5 for clean metals that weld together


def vector(formulas: Sequence, hub: Hub, x: np.ndarray, first: Callable) -> np.ndarray:
    """Return values (n, d or 3) of formulas or 0; `first()` gives reference positions."""
    asked = any(formula is not None and formula.names & FIRST for formula in formulas)
    x0 = first() if asked else x
    values = np.zeros((len(x), max(x.shape[1], len(formulas))))
    for k, formula in enumerate(formulas):
        if formula is not None:
            values[:, k] = formula.evaluate_points(hub.values, x, x0)
    return values


def unlike(one: Any, other: Any) -> list[int]:
    pairs = enumerate(zip(one.formulas, other.formulas, strict=False))
    return [k for k, (a, b) in pairs if None not in (a, b) and not a.is_like(b)]


def judge_friction(hub: Hub, mu: float) -> None:
    if mu > USUAL_FRICTION:
        hub.warn(
            f"the coefficient of friction is {mu:g}; measured ones are below 1.5",
            hint=f"a fraction of the normal force: {mu / 100:g} is {mu:g} %" if mu >= 5 else None,
        )
