"""Troubles of a run: found, explained, and the last good state written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import growth
from karamelo_py.kernels.step import ABOVE_LIMIT, DONE, GAINED, HEATED, SHRUNK, STOPPED
from karamelo_py.kernels.watch import GROWTH, LOOK, unit_of
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.basis import carried, extent
from karamelo_py.run.advice.known_failures import step_was_told
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.run.checkpoint.parts import OUTPUTS, PartStates, RollbackPoint
from karamelo_py.run.diagnosis import energy
from karamelo_py.run.diagnosis.nonfinite import Trouble, no_number, place_words
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.timestep import own_step_instead
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import named, solid_with
from karamelo_py.script.errors import Place, ScriptError

LAST_GOOD = "last_good.*.h5"
GOES_ON = (
    "karamelo-py SCRIPT -restart {} goes on from there, with a smaller step (set_dt, dt_factor): "
    "as it is, it would end here again"
)
FAR = 100  # steps, more of which are not taken once more for the last rows of log and dumps
LOOSE = 1.5  # cells: points of an unstrained solid are at most one apart
APART = "no other point of it within a cell"


class Stopped(ScriptError):
    """A run has ended at a fault; all processes know, and its last good state is written."""


class OthersWait(Exception):
    """This process cannot write a file, and others go on to give it what belongs there."""


class StepTooLarge(NamedTuple):
    """A step above the stable limit of the start of a run: nothing behind that is a good state."""

    smaller: str  # what to write instead, by that limit
    at_hand: bool  # whether the last good state is that of the start


def trouble(hub: Hub, simulation: Simulation, status: int) -> Trouble:
    """Find what went wrong in a step, and what can be done."""
    if status == ABOVE_LIMIT:
        return Trouble(*_above_limit(hub, simulation), hub.update.dt_place)
    if status == SHRUNK:
        return Trouble(*_shrunk(hub, simulation))
    too_large = not simulation.control.clock[0].watch_limit
    if status in (GAINED, HEATED):
        message, hint = (_gained if status == GAINED else _heated)(hub, simulation)
        return Trouble(message, _smaller_step(hub, simulation) if too_large else hint)
    message, hint, place = Trouble(*_wrong_point(hub, simulation))
    message = f"step {simulation.step + 1}, time {simulation.time:.6g}: {message}"
    if place is None and energy.has_grown(simulation):
        cause, cure = energy.cause_of_gain(hub, simulation)
        message += f", after energy had come from nowhere. Known to do that here: {cause}"
        hint = _smaller_step(hub, simulation) if too_large else cure
    return Trouble(message, hint, place)


def stop(
    hub: Hub,
    simulation: Simulation,
    status: int,
    good: RollbackPoint,
    start: StepTooLarge | None,
    place: Place | None,
) -> NoReturn:
    """Return to the last good state, write it, and raise what the user should know.

    Where energy has grown before, that is the last state in which it had not; log and dumps end
    with the last state that has no trouble of its own. Where the step was too large from the
    `start` on it is the state of the start.
    """
    message, hint, at_fault = trouble(hub, simulation, status)
    kind = ScriptError
    with suppress(OthersWait):
        if start is None:
            hint += _keep_good(hub, simulation, status, good)
        else:
            hint += _keep_start(hub, simulation, status, good, start)
        kind = Stopped
    error = kind(message, place=at_fault or place, hint=hint)
    error.complete = at_fault is not None
    raise error


def _keep_start(
    hub: Hub, simulation: Simulation, status: int, good: RollbackPoint, start: StepTooLarge
) -> str:
    """Write the state that the run began with, end the outputs, and say how to begin anew."""
    step, path = simulation.step, None
    simulation.restore(good.arrays)
    if start.at_hand:
        with good.remembered():
            path = _write_last_good(hub)
    back = step - simulation.step - (status in (GAINED, HEATED))
    if back <= FAR:
        if back > 0:
            simulation.advance(back)
        _end_outputs(hub)
    words = f". Begin anew with {start.smaller}"
    if path is None:
        return words
    name = os.path.relpath(path)
    return (
        f"{words}. The state before the first step of this run is in {name}; karamelo-py SCRIPT "
        f"-restart {name} goes on from there, with such a step"
    )


def _keep_good(hub: Hub, simulation: Simulation, status: int, good: RollbackPoint) -> str:
    """Return to the last good state, write it, end the outputs, and say how to go on from it."""
    step, present = simulation.step, PartStates.of(hub, OUTPUTS)
    grown = not energy.grown_little(simulation)
    if grown:
        _return_before_growth(simulation, good, step)
    else:
        good.return_to(simulation)
        if status not in (GAINED, HEATED, STOPPED):
            # What nodes have depends on how many steps ran at once: here always on as many.
            good.again(simulation.advance, step)
    path = _write_last_good(hub) if grown else None
    if status not in (GAINED, HEATED) and step > simulation.step:
        before = simulation.energy()
        good.again(simulation.advance, step)
        if path is None and energy.growth_since(simulation, before) > growth.WITHIN:
            # The watch looks at means of a hundred steps, and has not seen it yet.
            grown = True
            _return_before_growth(simulation, good, step)
            path = _write_last_good(hub)
            good.again(simulation.advance, step)
    path = path or _write_last_good(hub)
    if simulation.step < step:
        present.give(hub)  # their files stay as they are, with later rows
    _end_outputs(hub)
    if path is None:
        return ""
    name = os.path.relpath(path)
    which = "The state from before energy grew" if grown else "The last good state"
    return f". {which} is in {name}; {GOES_ON.format(name)}"


def _return_before_growth(simulation: Simulation, good: RollbackPoint, end: int) -> None:
    """Return to the last state before step `end` whose energy has not grown since the good one.

    These steps are taken once more, from one look at the energy to the next.
    """
    good.return_to(simulation)
    clock = simulation.control.clock[0]
    before = float(clock.balance)
    while clock.watch_energy and simulation.step + LOOK < end:
        look = simulation.step + LOOK - (simulation.step - 1) % LOOK
        healthy = good.again(simulation.advance, look) == DONE
        if not (healthy and energy.grown_little(simulation)):
            break
        if clock.balance - before < GROWTH * unit_of(clock):
            good.move(simulation)
    good.return_to(simulation)


def only_leave(hub: Hub, simulation: Simulation, snapshot: dict) -> bool:
    """Tell whether a step went wrong since points leave the domain, at no more energy.

    No smaller step keeps these. Where nobody watches energy, who knows.
    """
    moves = hub.update.method.frame.moves
    if not (moves and len(simulation.leaving()) and energy.grown_little(simulation)):
        return False
    step = simulation.step
    simulation.restore(snapshot)
    before, steps = simulation.energy(), step - simulation.step
    if steps:
        simulation.advance(steps)
    kept = energy.growth_since(simulation, before) <= growth.WITHIN
    healthy = kept and not simulation.above_limit()
    simulation.advance(1)  # which goes wrong again, for others to look at
    return healthy


def _above_limit(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    limit = simulation.limit
    message = (
        f"step {simulation.step}, time {simulation.time:.6g}: the step {simulation.dt:g} is above "
        f"the stable limit, which has fallen to {limit:.4g}"
    )
    speed, fastest = simulation.largest(_speeds)
    message += f" ({named(hub, fastest)} moves at {speed:.4g})"
    return message, own_step_instead(hub)


def _speeds(points: PointTable) -> np.ndarray:
    return np.abs(points.velocity).max(axis=1, initial=0.0)


def _no_number(points: PointTable) -> np.ndarray:
    return 1.0 * ~np.isfinite(points.particle("ienergy"))


def _gained(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    clock = simulation.control.clock[0]
    if not np.isfinite(clock.balance):
        _, first = simulation.largest(_no_number)
        message = (
            f"step {simulation.step}, time {simulation.time:.6g}: energy is no number any more; "
            f"the first point whose state is none is {named(hub, first)}"
        )
        return message, "look at the parameters of its material, and at what acts on it from Python"
    given = abs(clock.first_balance) + clock.supplied
    cause, cure = energy.cause_of_gain(hub, simulation)
    times = (clock.balance - clock.first_balance) / given if given > 0 else np.inf
    message = (
        f"step {simulation.step}, time {simulation.time:.6g}: {times:.3g} times the energy that "
        "there was at the start and that loads have brought has come from nowhere "
        f"(kinetic + stored + dissipated - work). Known to do that here: {cause}"
    )
    return message, cure


def _heated(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    clock = simulation.control.clock[0]
    share = clock.last_dt / clock.heat_limit
    message = f"step {simulation.step}, time {simulation.time:.6g}: "
    if share > 1:
        message += f"the step is {share:.3g} times the stable one of conduction, and "
    message += (
        f"temperatures have come to be between {clock.T_low:.6g} and {clock.T_high:.6g}, where "
        f"initial state, fixes and sources allow {clock.coldest:.6g} to "
        f"{clock.hottest + clock.own_heat:.6g}"
    )
    return message, own_step_instead(hub) if share > 1 else _smaller_step(hub, simulation)


def _shrunk(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    (speed, fastest), (volume, widest) = map(simulation.largest, (_speeds, energy.swelling))
    message = (
        f"step {simulation.step}, time {simulation.time:.6g}: the stable step has fallen to "
        f"{simulation.limit:.3g}, less than a millionth of the first "
        f"({named(hub, fastest)} moves at {speed:.3g}, "
        f"{named(hub, widest)} has {volume:.3g} times its volume)"
    )
    smaller = _smaller_step(hub, simulation)
    return message, f"something went wrong before: look at the dumps; {smaller}"


class Wrong(NamedTuple):
    """A point that went wrong in a step."""

    number: int
    old: np.ndarray  # its position before the step and after it, with corners that it carries
    new: np.ndarray
    v: np.ndarray
    grid: int


def _first_wrong(simulation: Simulation) -> Wrong | None:
    """The first of the points at hand that went wrong."""
    wrong = [(int(block.points.id[p]), block.points, p) for block, p in simulation.wrong_points()]
    if not wrong:
        return None
    number, points, p = min(wrong, key=lambda item: item[0])
    old, new = (points.x[k][:, p].astype(float) for k in (simulation.now, 1 - simulation.now))
    return Wrong(number, old, new, points.v[:, p], int(points.grid[p]))


def _wrong_point(hub: Hub, simulation: Simulation) -> tuple:
    """Find what is wrong with the first point that went wrong, and what can be done."""
    wrong = [one for one in simulation.seen(_first_wrong) if one is not None]
    if not wrong and hub.update.thermal:
        return no_number(
            hub,
            simulation,
            "the temperature of a point is not a number",
            "look at the fixes that act on heat: a formula that gives NaN, or heat without bounds",
        )
    if not wrong:
        return "a point went wrong", "use a smaller step"
    number, old, place, v, grid = min(wrong, key=lambda one: one.number)
    d, h, name = hub.domain.dimension, hub.lattices[grid].h, named(hub, number)
    old, new = old[:d], place[:d]
    smaller = _smaller_step(hub, simulation)
    if not np.isfinite(old).all():
        return no_number(
            hub,
            simulation,
            f"{name} has no position (NaN)",
            f"look for a formula that gives NaN; {smaller}",
        )
    if not np.isfinite(new).all() or not np.isfinite(v).all():
        return no_number(
            hub,
            simulation,
            f"{name} at {place_words(old)} gets a velocity that is not a number",
            f"look for a formula that gives NaN, such as a division by zero; else {smaller}",
        )
    lo, hi = hub.domain.lo[:d], hub.domain.hi[:d]
    if hub.update.method.frame.moves and ((new < lo).any() or (new > hi).any()):
        side = next(k for k in range(d) if new[k] < lo[k] or new[k] > hi[k])
        if simulation.above_limit():
            return f"{name} at {place_words(old)} is thrown out of the domain", smaller
        loose = _loose(simulation, number, old, LOOSE * h)
        why = f", come loose from its solid ({APART}: numerical fracture)," if loose else ""
        keep = f"; against fracture, {energy.WHOLE}" if loose else ""
        return (
            f"{name}{why} leaves the domain at {place_words(new)} (through {'xyz'[side]} = "
            f"{lo[side] if new[side] < lo[side] else hi[side]:g})",
            "make the domain larger, hold the point back with fix velocity_nodes at the wall, let "
            f"it go with boundary(delete), or, if it should not have got there, {smaller}{keep}",
        )
    move = float(np.abs(new - old).max()) / h
    if move > 1:
        return (
            f"{name} at {place_words(old)} moves by {move:.3g} cells in one step",
            f"the run is unstable: {smaller}",
        )
    if any(simulation.seen(_is_tangled, place, grid)):
        tangled, plain = type(hub.update.method.basis).__name__, "R4" if d == 2 else "R8"
        instead = f", {plain} in the place of {tangled}" if tangled in ("Q4", "H8") else ""
        return (
            f"the domain of {name} at {place_words(old)} is tangled: one of its corners folds over",
            f"finer points, so that the corners of a domain move more alike{instead}, or method "
            f"tlcpdi, whose domains keep their shape; or {smaller}",
        )
    return (
        f"{name} at {place_words(old)} is turned inside out (det F <= 0)",
        f"{smaller}, or a finer grid, or a law that resists the compression (neo-hookean)",
    )


def _loose(simulation: Simulation, number: int, x: np.ndarray, reach: float) -> bool:
    """Tell whether a point has a solid of others, none of which is near."""
    others, near = np.sum(simulation.seen(_others, number, x, reach), axis=0)
    return others > 0 and near == 0


def _others(simulation: Simulation, number: int, x: np.ndarray, reach: float) -> tuple[int, int]:
    """Count the other points of the solid of a point, at hand and near it."""
    solid, others, near = solid_with(simulation.hub, number), 0, 0
    for some in simulation.some(None):
        own = (some.solid == solid.index) & (some.ids != number)
        apart = np.abs(some.position[own] - x).max(axis=1, initial=0.0)
        others, near = others + len(apart), near + int(np.sum(~(apart > reach)))
    return others, near


def _is_tangled(simulation: Simulation, place: np.ndarray, grid: int) -> bool:
    """Tell whether the domain of a point, whose corners move, is folded over."""
    s = simulation.setup
    if not s.frame.moves or carried(s.basis, s.kin) == 0:
        return False
    return not np.isfinite(extent(s.basis, s.kin, record(s.grids, grid), tuple(place.tolist())))


def _smaller_step(hub: Hub, simulation: Simulation) -> str:
    """Say how to take a smaller step, and that the present one is too large where it is.

    One that was so from the start on has ruined the state, and its limit with it.
    """
    if not simulation.control.clock[0].watch_limit:
        return "the step is too large" + ", as the warning says" * step_was_told(hub)
    if simulation.above_limit():
        if step_was_told(hub):
            return f"the step is too large, as the warning says; {own_step_instead(hub)}"
        return (
            f"the step {simulation.dt:.4g} is above the stable limit {simulation.limit:.4g}: "
            "set_dt to less, or leave set_dt and dt_factor out"
        )
    fixed = hub.update.fixed_dt is not None
    return "use a smaller step (set_dt)" if fixed else "use a smaller dt_factor"


def _write_last_good(hub: Hub) -> Path | None:
    """Write the present state to a file to go on from; a file of somebody else is left alone."""
    written: list[Path] = []
    path = restart_file.path_of(hub, Path(LAST_GOOD))
    may_be = hub.settings.comm.bcast(not path.exists() or restart_file.is_restart(path))
    if hub.output.takes_part and may_be:
        with _as_warnings(hub):
            written.append(restart_file.write(hub, Path(LAST_GOOD), within=True))
            # The files of restart(...) would hold the same once more.
            for item in hub.output.last:
                item.last_step = hub.update.step
    return written[0] if written else None


def _end_outputs(hub: Hub) -> None:
    with _as_warnings(hub):
        hub.output.write(last=True)


@contextmanager
def _as_warnings(hub: Hub) -> Iterator[None]:
    """Warn of what prevents writing: another error is on its way."""
    try:
        yield
    except ScriptError as error:
        hub.warn(error.message, hint=error.hint, place=error.place)
        if hub.settings.comm.size > 1:
            hub.settings.comm.failed_within = True
            raise OthersWait from None
