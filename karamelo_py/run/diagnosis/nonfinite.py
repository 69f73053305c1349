"""The fix with a formula that gives no number, where a run has broken off."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Place
from karamelo_py.script.expressions import POINT_SEEDS, Expression
from karamelo_py.script.values import Values


class Trouble(NamedTuple):
    """Trouble of a run, what can be done, and the line of the script at fault, if known."""

    message: str
    hint: str
    place: Place | None = None


class Culprit(NamedTuple):
    """A fix, its formula, and what that gives where; `x` is None where it is the same anywhere."""

    fix: Any
    formula: Expression
    value: float
    x: np.ndarray | None


def culprit(hub: Hub, simulation: Simulation) -> Culprit | None:
    """The first fix with a formula that makes NaN or infinity of the present numbers.

    A formula that reads what is NaN already shows the damage, and not where it comes from.
    """
    found = [one for one in simulation.seen(_first_bad) if one is not None]
    if not found:
        return None
    (which, k, _), value, x = min(found, key=lambda one: one[0])
    fix = list(hub.fixes.values())[which]
    return Culprit(fix, list(_formulas(tuple(vars(fix).values())))[k], value, x)


def _first_bad(simulation: Simulation) -> tuple | None:
    """The same by numbers, as far as places at hand tell: (fix, formula, place), value, place."""
    hub = simulation.hub
    for which, fix in enumerate(hub.fixes.values()):
        over = simulation.step > 0 and fix.id in simulation.begun
        if over or not fix.hooks():
            continue
        for k, formula in enumerate(_formulas(tuple(vars(fix).values()))):
            if formula.is_constant or not _readable(formula, hub.values):
                continue
            bad = []
            for numbers, x, x0 in _places(simulation, fix.group, formula):
                values = formula.evaluate_points(hub.values, x, x0)
                rows = np.flatnonzero(~np.isfinite(values))
                if len(rows):
                    p = rows[np.argmin(numbers[rows])]
                    key = which, k, int(numbers[p])
                    bad.append((key, float(values[p]), x[p] if x.size else None))
            if bad:
                return min(bad, key=lambda one: one[0])
    return None


def _formulas(value: Any) -> Iterator[Expression]:
    """The formulas among the attributes of a fix, and in tuples and lists of these."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from _formulas(one)


def _readable(formula: Expression, values: Values) -> bool:
    """Tell whether all that a formula reads, beside positions, is there and is a number."""
    read = formula.names.difference(POINT_SEEDS)
    return all(name in values and np.isfinite(values.get(name)) for name in read)


def _places(simulation: Simulation, group: Any, formula: Expression) -> Iterator[tuple]:
    """Numbers of places at hand at which a fix evaluates a formula; now (n, d), and at first."""
    if not formula.names.intersection(POINT_SEEDS):
        yield np.zeros(1, np.int64), np.empty((1, 0)), None
    elif isinstance(group, NodeGroup):
        nodes = simulation.nodes_with_mass()
        nodes = nodes if group.all else np.intersect1d(nodes, group.nodes, assume_unique=True)
        x = simulation.places_of(nodes)
        yield nodes, x, x
    else:
        for some in simulation.some(group):
            there = np.isfinite(some.position).all(axis=1)
            yield some.ids[there], some.position[there], some.reference_position[there]


def no_number(hub: Hub, simulation: Simulation, message: str, hint: str) -> Trouble:
    """The trouble with what is NaN, and the formula that it comes from, where that is found."""
    found = culprit(hub, simulation)
    if found is None:
        return Trouble(message, hint)
    what = "NaN" if np.isnan(found.value) else f"{found.value:g}"
    where = "" if found.x is None else f" at {place_words(found.x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {found.fix.id} gets {what}{where} from {found.formula.text}",
        "a formula that is a number at all times and places of the run, such as by max(a, b) or "
        "if(condition, a, b)",
        found.fix.place,
    )


def place_words(x: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"
