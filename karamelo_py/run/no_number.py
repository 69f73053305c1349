"""Numbers of a run that are NaN or infinite, and the formula of a fix that they come from."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from karamelo_py.output.node_columns import places_of
from karamelo_py.run.listening import Trouble, where
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import POINT_SEEDS, Expression


def _first_bad(simulation: Any) -> tuple | None:
    """Find the first such fix by numbers, at hand: (fix, formula, place), value, position."""
    hub, values = simulation.hub, simulation.hub.values
    for which, fix in enumerate(hub.fixes.values()):
        over = simulation.step > 0 and fix in simulation.begun
        if over or not fix.hooks():
            continue
        for k, formula in enumerate(formulas_of(tuple(vars(fix).values()))):
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


def formulas_of(value: Any) -> Iterator[Expression]:
    """List the formulas among the attributes of a fix, and in tuples and lists of these."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from formulas_of(one)


def _places(simulation: Any, group: Any, formula: Expression) -> Iterator[tuple]:
    """List places at hand at which a fix evaluates a formula: numbers; now (n, d), and at first."""
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


def no_number(hub: Hub, simulation: Any, message: str, hint: str) -> Trouble:
    """Make the trouble for what is NaN, and the first fix whose formula gives NaN or infinity."""
    found = [one for one in simulation.points.seen(_first_bad) if one is not None]
    if not found:
        return Trouble(message, hint, "not-a-number")
    (which, k, _), value, x = min(found, key=lambda one: one[0])
    fix = list(hub.fixes.values())[which]
    formula = list(formulas_of(tuple(vars(fix).values())))[k]
    what = "NaN" if np.isnan(value) else f"{value:g}"
    at = "" if x is None else f" at {where(x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {fix.id} gets {what}{at} from {formula.text}",
        "a formula that is a number at all times and places of the run, such as by max(a, b) or "
        "if(condition, a, b)",
        "not-a-number",
        place=fix.place,
    )


def refuse_endless_speeds(hub: Hub, simulation: Any) -> None:
    """Refuse velocities of points that are no numbers, with the formula that they come from."""
    if not np.isfinite(simulation.fastest()):
        what = f"points have a velocity that is not a number at time {simulation.time:.6g}"
        hint = "look for a formula that gives NaN or infinity, such as a division by zero"
        found = no_number(hub, simulation, what, hint)
        raise ScriptError(found.message, place=found.place, hint=found.fix, code=found.code)
