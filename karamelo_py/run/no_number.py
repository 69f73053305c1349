"""Which fix has a formula that gives no number, where a run has broken off."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import POINT_SEEDS, Expression
from karamelo_py.script.values import Values


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
    for fix in hub.fixes.values():
        over = simulation.step > 0 and fix.id in simulation.begun
        if over or not fix.hooks():
            continue
        for formula in _formulas(tuple(vars(fix).values())):
            if not formula.is_constant and _readable(formula, hub.values):
                x, x0 = np.empty((1, 0)), None
                if formula.names.intersection(POINT_SEEDS):
                    x, x0 = _places(hub, simulation, fix.group)
                found = formula.evaluate_points(hub.values, x, x0)
                bad = np.flatnonzero(~np.isfinite(found))
                if len(bad):
                    first = bad[0]
                    return Culprit(fix, formula, found[first], x[first] if x.shape[1] else None)
    return None


def _formulas(value: Any) -> Iterator[Expression]:
    """The formulas among the attributes of a fix, and in tuples and lists of these."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from _formulas(one)


def _readable(formula: Expression, values: Values) -> bool:
    """Whether all that a formula reads, beside positions, is there and is a number."""
    read = formula.names.difference(POINT_SEEDS)
    return all(name in values and np.isfinite(values.get(name)) for name in read)


def _places(hub: Hub, simulation: Simulation, group: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where a fix evaluates its formulas, (n, d), and where that was before the first step."""
    if isinstance(group, NodeGroup):
        x = np.concatenate([lattice.positions() for lattice in hub.lattices])
        acted_on = np.zeros(len(x), np.bool_)
        acted_on[slice(None) if group.all else group.nodes] = True
        x = x[acted_on & (hub.fields.node("mass") > 0)]
        return x, x
    ids = np.flatnonzero(simulation.present) if group is None else simulation.members(group)
    x = simulation.x[ids]
    there = np.isfinite(x).all(axis=1)
    return x[there], simulation.x0[ids][there]
