"""NaN and infinite values of a run, and their source."""

from collections.abc import Iterator

import numpy as np

from karamelo_py.output.node_columns import places_of
from karamelo_py.run.listening import Trouble, where
from karamelo_py.run.state import SceneState
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import POINT_SEEDS, Expression


def _first_bad(simulation: SceneState) -> tuple | None:
    """Return the first NaN or infinite value of this process, or None.

    The result is ((fix, formula, point or node), value, position).
    """
    hub, values = simulation.hub, simulation.hub.values
    for which, fix in enumerate(hub.fixes.values()):
        over = simulation.step > 0 and fix in simulation.begun
        if over or not fix.hooks():
            continue
        for k, formula in enumerate(fix.all_formulas):
            names = formula.names.difference(POINT_SEEDS)
            readable = all(n in values and np.isfinite(values.get(n)) for n in names)
            if formula.is_constant or not readable:
                continue
            bad = []
            for numbers, x, x0 in _places(simulation, fix.group, formula):
                values_at = formula.evaluate_points(values, x, x0)
                rows = np.flatnonzero(~np.isfinite(values_at))
                if len(rows):
                    p = rows[np.argmin(numbers[rows])]
                    key = which, k, int(numbers[p])
                    bad.append((key, float(values_at[p]), x[p] if x.size else None))
            if bad:
                return min(bad, key=lambda one: one[0])
    return None


def _places(
    simulation: SceneState, group: ParticleGroup | NodeGroup, formula: Expression
) -> Iterator[tuple]:
    if not formula.names.intersection(POINT_SEEDS):
        yield np.zeros(1, np.int64), np.empty((1, 0)), None
    elif isinstance(group, NodeGroup):
        nodes = simulation.nodes.with_mass()
        nodes = nodes if group.all else np.intersect1d(nodes, group.nodes, assume_unique=True)
        x = places_of(simulation.hub, nodes)
        yield nodes, x, x
    else:
        for some in simulation.points.some(group):
            finite = np.isfinite(some.position).all(axis=1)
            yield some.numbers[finite], some.position[finite], some.reference_position[finite]


def no_number(simulation: SceneState, message: str, hint: str) -> Trouble:
    hub = simulation.hub
    candidates = [one for one in simulation.points.seen(_first_bad) if one is not None]
    for fix in hub.fixes.values() if not candidates else ():
        if wrong := fix.undefined():
            message = f"{message}: fix {fix.id}: {wrong[0]}"
            return Trouble(message, f"{wrong[1]} at all times", "not-a-number", mark=fix.mark)
    if not candidates:
        return Trouble(message, hint, "not-a-number")
    (which, k, _), value, x = min(candidates, key=lambda one: one[0])
    fix = list(hub.fixes.values())[which]
    formula = fix.all_formulas[k]
    value_text = "NaN" if np.isnan(value) else f"{value:g}"
    at = "" if x is None else f" at {where(x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {fix.id} gets {value_text}{at} from {formula.text}",
        "a formula that is a number everywhere in the run, such as with max(a, b) or "
        "if(condition, a, b)",
        "not-a-number",
        mark=fix.mark,
    )


def endless_speed(simulation: SceneState) -> ScriptError:
    message = f"points have a velocity that is not a number at time {simulation.time:.6g}"
    hint = "look for a formula that returns NaN or infinity, such as a division by zero"
    trouble = no_number(simulation, message, hint)
    return ScriptError(trouble.message, mark=trouble.mark, hint=trouble.fix, code=trouble.code)
