"""Formulas per direction, and coefficients of friction, for fixes."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.expressions import FIRST

AXES = "xyz"
USUAL_FRICTION = 2.0  # rubber on dry concrete has 1, clean metals that weld 1.5


def per_direction(hub: Hub, name: str, formulas: Sequence, *, all_given: bool = False) -> tuple:
    """Require one formula (or NULL, unless `all_given`) per direction of the domain.

    Further components may be NULL or zero, as in published inputs.
    """
    d = require_domain(hub).dimension
    wanted = ", ".join(name + axis for axis in AXES[:d])
    if len(formulas) < d:
        raise ScriptError(
            f"{plural(len(formulas), 'component')} in {plural(d, 'dimension')}",
            expected=wanted + " (NULL leaves a component alone)" * (not all_given),
            code="arguments",
        )
    if len(formulas) > 3:
        message = f"{len(formulas)} components, and space has 3 directions"
        raise ScriptError(message, argument=3 - len(formulas), expected=wanted)
    for extra in formulas[d:]:
        if extra is not None and not (extra.is_constant and extra.constant == 0):
            raise ScriptError(
                f"more components than the {plural(d, 'dimension')} of the domain",
                expected=f"{wanted} (a further one may only be NULL or 0)",
                hint=f"the last direction here is {AXES[d - 1]}"
                + ": gravity is a component of it" * (name == "b"),
            )
    if all(formula is None for formula in formulas[:d]):
        hub.warn("all components are NULL: it leaves everything alone")
    return tuple(formulas[:d])


def vector(formulas: Sequence, hub: Hub, x: np.ndarray, first: Callable) -> np.ndarray:
    """Evaluate a formula per direction, (n, d), 0 if missing; `first()` gives reference
    positions."""
    asked = any(formula is not None and formula.names & FIRST for formula in formulas)
    x0 = first() if asked else x
    values = np.zeros(x.shape)
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
