"""Troubles of a run: found and explained, with the formula that gives no number."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.step import ABOVE_LIMIT, GAINED, HEATED, SHRUNK
from karamelo_py.output.node_columns import places_of
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.basis import carried, extent
from karamelo_py.points.laws import by_rates
from karamelo_py.run.diagnosis import energy
from karamelo_py.run.timestep import own_step_instead, step_by_script
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import named, solid_with
from karamelo_py.script.errors import Place, ScriptError
from karamelo_py.script.expressions import POINT_SEEDS, Expression

DOUBTED_UNITS = "units of "  # begins the names of warnings that doubt them
ABSURD = 10.0  # cells in one step: no smaller one mends that
LOOSE = 1.5  # cells: points of an unstrained solid are at most one apart
APART = "no other point of it within a cell"


class Trouble(NamedTuple):
    """Trouble of a run, what can be done, and the line of the script at fault, if known.

    Its `code` is the kind for programs; `cause` is what is known to lead to it.
    """

    message: str
    hint: str
    place: Place | None = None
    code: str = ""
    cause: str = ""


def trouble(hub: Hub, simulation: Any, status: int) -> Trouble:
    """Find what went wrong in a step, and what can be done."""
    if status == ABOVE_LIMIT:
        return Trouble(*_above_limit(hub, simulation), hub.update.dt_place, "step-above-limit")
    if status == SHRUNK:
        return Trouble(*_shrunk(hub, simulation), code="step-collapsed")
    too_large = not simulation.control.clock[0].watch_limit and not simulation.implicit
    if status in (GAINED, HEATED):
        found = (_gained if status == GAINED else _heated)(hub, simulation)
        return found._replace(hint=_smaller_step(hub, simulation)) if too_large else found
    if simulation.implicit and simulation.load_steps.failure:
        message = simulation.load_steps.failure
        hint = "smaller load steps; beyond the load that a body bears there is no equilibrium"
        when = f"step {simulation.step + 1}, time {simulation.time:.6g}"
        return Trouble(f"{when}: {message}", hint, code="no-equilibrium")
    found = _wrong_point(hub, simulation)
    found = found._replace(
        message=f"step {simulation.step + 1}, time {simulation.time:.6g}: {found.message}"
    )
    if found.place is None and energy.has_grown(simulation):
        cause, cure = energy.cause_of_gain(hub, simulation)
        message = f"{found.message}, after energy had come from nowhere. "
        return found._replace(
            message=f"{message}Known to do that here: {cause}",
            hint=_smaller_step(hub, simulation) if too_large else cure,
            cause=cause,
        )
    return found


def _when(simulation: Any) -> str:
    return f"step {simulation.step}, time {simulation.time:.6g}"


def _above_limit(hub: Hub, simulation: Any) -> tuple[str, str]:
    speed, fastest = simulation.points.largest(_speeds)
    message = (
        f"{_when(simulation)}: the step {simulation.dt:g} is above the stable limit, which has "
        f"fallen to {simulation.limit:.4g} ({named(hub, fastest)} moves at {speed:.4g})"
    )
    return message, own_step_instead(hub)


def _speeds(points: PointTable) -> np.ndarray:
    return np.abs(points.velocity).max(axis=1, initial=0.0)


def _gained(hub: Hub, simulation: Any) -> Trouble:
    clock, when = simulation.control.clock[0], _when(simulation)
    if not np.isfinite(clock.balance):
        _, first = simulation.points.largest(
            lambda points: 1.0 * ~np.isfinite(points.particle("ienergy"))
        )
        message = f"{when}: energy is no number any more; "
        message += f"the first point whose state is none is {named(hub, first)}"
        hint = "look at the parameters of its material, and at what acts on it from Python"
        return Trouble(message, hint, code="not-a-number")
    given = abs(clock.first_balance) + clock.supplied
    cause, cure = energy.cause_of_gain(hub, simulation)
    times = (clock.balance - clock.first_balance) / given if given > 0 else np.inf
    message = (
        f"{when}: {times:.3g} times the energy that there was at the start and that loads have "
        "brought has come from nowhere (kinetic + stored + dissipated - work). Known to do that "
        f"here: {cause}"
    )
    return Trouble(message, cure, code="energy-gain", cause=cause)


def _heated(hub: Hub, simulation: Any) -> Trouble:
    clock = simulation.control.clock[0]
    share = clock.last_dt / clock.heat_limit
    message = f"{_when(simulation)}: "
    if share > 1:
        message += f"the step is {share:.3g} times the stable one of conduction, and "
    message += (
        f"temperatures have come to be between {clock.T_low:.6g} and {clock.T_high:.6g}, where "
        f"initial state, fixes and sources allow {clock.coldest:.6g} to "
        f"{clock.hottest + clock.own_heat:.6g}"
    )
    hint = own_step_instead(hub) if share > 1 else _smaller_step(hub, simulation)
    return Trouble(message, hint, code="temperature")


def _shrunk(hub: Hub, simulation: Any) -> tuple[str, str]:
    (speed, fastest), (volume, widest) = map(simulation.points.largest, (_speeds, energy.swelling))
    message = (
        f"{_when(simulation)}: the stable step has fallen to {simulation.limit:.3g}, less than a "
        f"millionth of the first ({named(hub, fastest)} moves at {speed:.3g}, {named(hub, widest)} "
        f"has {volume:.3g} times its volume)"
    )
    smaller = _smaller_step(hub, simulation)
    return message, f"something went wrong before: look at the dumps; {smaller}"


def _first_wrong(simulation: Any) -> tuple | None:
    """Find the first point that went wrong: number, positions before and after, velocity, grid."""
    wrong = []
    for block in simulation.setup.blocks:
        tiling = block.tiling
        # The last sweep has found one a tile at most.
        at = tiling.report[: max(int(tiling.count[0]), 1), 2]
        wrong += [(int(block.points.id[p]), block.points, p) for p in (at[at > 0] - 1).astype(int)]
    if not wrong:
        return None
    number, points, p = min(wrong, key=lambda item: item[0])
    old, new = (points.x[k][:, p].astype(float) for k in (simulation.now, 1 - simulation.now))
    return number, old, new, points.v[:, p], int(points.grid[p])


def _wrong_point(hub: Hub, simulation: Any) -> Trouble:
    """Find what is wrong with the first point that went wrong, and what can be done."""
    wrong = [one for one in simulation.points.seen(_first_wrong) if one is not None]
    if not wrong and hub.update.thermal:
        hint = (
            "look at the fixes that act on heat: a formula that gives NaN, or heat without bounds"
        )
        return no_number(hub, simulation, "the temperature of a point is not a number", hint)
    if not wrong:
        return Trouble("a point went wrong", "use a smaller step", code="point")
    number, old, place, v, grid = min(wrong, key=lambda one: one[0])
    d, h, name = hub.domain.dimension, hub.lattices[grid].h, named(hub, number)
    old, new = old[:d], place[:d]
    smaller = _smaller_step(hub, simulation)
    if not np.isfinite(old).all():
        hint = f"look for a formula that gives NaN; {smaller}"
        return no_number(hub, simulation, f"{name} has no position (NaN)", hint)
    if not np.isfinite(new).all() or not np.isfinite(v).all():
        what = f"{name} at {_place(old)} gets a velocity that is not a number"
        hint = f"look for a formula that gives NaN, such as a division by zero; else {smaller}"
        return no_number(hub, simulation, what, hint)
    lo, hi = hub.domain.lo[:d], hub.domain.hi[:d]
    move = float(np.abs(new - old).max()) / h
    unstable = f"the run is unstable: {smaller}"
    if move > ABSURD:
        unstable = f"look at loads, stresses and velocities, and at their units; else {smaller}"
    if hub.update.method.frame.moves and ((new < lo).any() or (new > hi).any()):
        if move > ABSURD:
            what = (
                f"{name} at {_place(old)} moves by {move:.3g} cells in one step, out of the domain"
            )
            return Trouble(what, unstable, code="point-lost")
        side = next(k for k in range(d) if new[k] < lo[k] or new[k] > hi[k])
        if simulation.above_limit():
            what = f"{name} at {_place(old)} is thrown out of the domain"
            return Trouble(what, smaller, code="point-lost")
        loose = _loose(simulation, number, old, LOOSE * h)
        why = f", come loose from its solid ({APART}: numerical fracture)," if loose else ""
        keep = f"; against fracture, {energy.WHOLE}" if loose else ""
        return Trouble(
            f"{name}{why} leaves the domain at {_place(new)} (through {'xyz'[side]} = "
            f"{lo[side] if new[side] < lo[side] else hi[side]:g})",
            "make the domain larger, hold the point back with fix velocity_nodes at the wall, let "
            f"it go with boundary(delete), or, if it should not have got there, {smaller}{keep}",
            code="left-domain",
            cause="a point has come loose from its solid (numerical fracture)" if loose else "",
        )
    if move > 1:
        what = f"{name} at {_place(old)} moves by {move:.3g} cells in one step"
        return Trouble(what, unstable, code="moves-too-far")
    if any(simulation.points.seen(_is_tangled, place, grid)):
        tangled, plain = type(hub.update.method.basis).__name__, "R4" if d == 2 else "R8"
        instead = f", {plain} in the place of {tangled}" if tangled in ("Q4", "H8") else ""
        return Trouble(
            f"the domain of {name} at {_place(old)} is tangled: one of its corners folds over",
            f"finer points, so that the corners of a domain move more alike{instead}, or method "
            f"tlcpdi, whose domains keep their shape; or {smaller}",
            code="tangled",
        )
    law = solid_with(hub, number).material.law
    other = ", or a law that resists the compression (neo-hookean)" if by_rates(law) else ""
    return Trouble(
        f"{name} at {_place(old)} is turned inside out (det F <= 0)",
        f"{smaller}, or a finer grid{other}",
        code="inside-out",
    )


def _loose(simulation: Any, number: int, x: np.ndarray, reach: float) -> bool:
    """Tell whether a point has a solid of others, none of which is near."""
    solid = solid_with(simulation.hub, number)

    def others(simulation: Any) -> tuple[int, int]:
        found, near = 0, 0
        for some in simulation.points.some(None):
            own = (some.solid == solid.index) & (some.numbers != number)
            apart = np.abs(some.position[own] - x).max(axis=1, initial=0.0)
            found, near = found + len(apart), near + int(np.sum(~(apart > reach)))
        return found, near

    found, near = np.sum(simulation.points.seen(others), axis=0)
    return found > 0 and near == 0


def _is_tangled(simulation: Any, place: np.ndarray, grid: int) -> bool:
    """Tell whether the domain of a point, whose corners move, is folded over."""
    s = simulation.setup
    if not s.frame.moves or carried(s.basis, s.kin) == 0:
        return False
    return not np.isfinite(extent(s.basis, s.kin, record(s.grids, grid), tuple(place.tolist())))


def _step_was_told(hub: Hub) -> bool:
    update = hub.update
    return step_by_script(update.fixed_dt, update.dt_factor) in update.warned_of


def _smaller_step(hub: Hub, simulation: Any) -> str:
    """Say how to take a smaller step, and that the present one is too large where it is.

    Where units are doubted they come first: what follows from them no step mends.
    """
    if doubted := [name for name in hub.update.warned_of if name.startswith(DOUBTED_UNITS)]:
        return f"look at the {doubted[0]}, as the warning says"
    if simulation.implicit:
        inertia = simulation.hub.update.scheme.traits.inertia
        return "use a smaller step (set_dt)" if inertia else "use more load steps, smaller ones"
    if not simulation.control.clock[0].watch_limit:
        return "the step is too large" + ", as the warning says" * _step_was_told(hub)
    if simulation.above_limit():
        if _step_was_told(hub):
            return f"the step is too large, as the warning says; {own_step_instead(hub)}"
        return (
            f"the step {simulation.dt:.4g} is above the stable limit {simulation.limit:.4g}: "
            "set_dt to less, or leave set_dt and dt_factor out"
        )
    fixed = hub.update.fixed_dt is not None
    return "use a smaller step (set_dt)" if fixed else "use a smaller dt_factor"


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
    """Tell the trouble with what is NaN, and the first fix whose formula gives NaN or infinity."""
    found = [one for one in simulation.points.seen(_first_bad) if one is not None]
    if not found:
        return Trouble(message, hint, code="not-a-number")
    (which, k, _), value, x = min(found, key=lambda one: one[0])
    fix = list(hub.fixes.values())[which]
    formula = list(formulas_of(tuple(vars(fix).values())))[k]
    what = "NaN" if np.isnan(value) else f"{value:g}"
    where = "" if x is None else f" at {_place(x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {fix.id} gets {what}{where} from {formula.text}",
        "a formula that is a number at all times and places of the run, such as by max(a, b) or "
        "if(condition, a, b)",
        fix.place,
        "not-a-number",
    )


def refuse_endless_speeds(hub: Hub, simulation: Any) -> None:
    """Refuse velocities of points that are no numbers, with the formula that they come from."""
    if not np.isfinite(simulation.fastest()):
        what = f"points have a velocity that is not a number at time {simulation.time:.6g}"
        hint = "look for a formula that gives NaN or infinity, such as a division by zero"
        found = no_number(hub, simulation, what, hint)
        raise ScriptError(found.message, place=found.place, hint=found.hint, code=found.code)


def _place(x: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"
