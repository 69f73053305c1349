"""NaN and infinite values of a run, and the formula of a fix that gives them."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from karamelo_py.output.node_columns import places_of
from karamelo_py.run.backend import Backend
from karamelo_py.run.listening import Trouble, where
from karamelo_py.scene.group import NodeGroup
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import POINT_SEEDS, Expression


def _first_bad(simulation: Any) -> tuple | None:
    """Return ((fix, formula, point or node), value, position) of the first bad value here."""
    hub, values = simulation.hub, simulation.hub.values
    for which, fix in enumerate(hub.fixes.values()):
        over = simulation.step > 0 and fix in simulation.begun
        if over or not fix.hooks():
            continue
        for k, formula in enumerate(fix.all_formulas):
            # What reads a NaN shows the damage, and not where it comes from.
            read = formula.names.difference(POINT_SEEDS)
            readable = all(n in values and np.isfinite(values.get(n)) for n in read)
            if formula.is_constant or not readable:
                continue
            bad = []
            for numbers, x, x0 in _places(simulation, fix.group, formula):
                given = formula.evaluate_points(values, x, x0)
                rows = np.flatnonzero(~np.isfinite(given))
                if len(rows):
                    p = rows[np.argmin(numbers[rows])]
                    key = which, k, int(numbers[p])
                    bad.append((key, float(given[p]), x[p] if x.size else None))
            if bad:
                return min(bad, key=lambda one: one[0])
    return None


def _places(simulation: Any, group: Any, formula: Expression) -> Iterator[tuple]:
    """Yield numbers, positions (n, d) and initial ones at which a fix evaluates a formula."""
    if not formula.names.intersection(POINT_SEEDS):
        yield np.zeros(1, np.int64), np.empty((1, 0)), None
    elif isinstance(group, NodeGroup):
        nodes = simulation.nodes.with_mass()
        nodes = nodes if group.all else np.intersect1d(nodes, group.nodes, assume_unique=True)
        x = places_of(simulation.hub, nodes)
        yield nodes, x, x
    else:
        for some in simulation.points.some(group):
            there = np.isfinite(some.position).all(axis=1)
            yield some.numbers[there], some.position[there], some.reference_position[there]


def no_number(simulation: Backend, message: str, hint: str) -> Trouble:
    """Make the trouble for a NaN, naming the first fix whose formula is not finite."""
    hub = simulation.hub
    found = [one for one in simulation.points.seen(_first_bad) if one is not None]
    if not found:
        return Trouble(message, hint, "not-a-number")
    (which, k, _), value, x = min(found, key=lambda one: one[0])
    fix = list(hub.fixes.values())[which]
    formula = fix.all_formulas[k]
    what = "NaN" if np.isnan(value) else f"{value:g}"
    at = "" if x is None else f" at {where(x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {fix.id} gets {what}{at} from {formula.text}",
        "a formula that is a number at all times and places of the run, such as by max(a, b) or "
        "if(condition, a, b)",
        "not-a-number",
        place=fix.place,
    )


def refuse_endless_speeds(simulation: Backend) -> None:
    """Refuse velocities that are not finite, naming the formula."""
    if not np.isfinite(simulation.fastest()):
        what = f"points have a velocity that is not a number at time {simulation.time:.6g}"
        hint = "look for a formula that gives NaN or infinity, such as a division by zero"
        found = no_number(simulation, what, hint)
        raise ScriptError(found.message, place=found.place, hint=found.fix, code=found.code)
