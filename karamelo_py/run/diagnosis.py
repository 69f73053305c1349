"""What went wrong in a run: found, explained, and the last good state written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from math import nan
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Block
from karamelo_py.kernels.step import ABOVE_LIMIT, DONE, GAINED, HEATED, SHRUNK, STOPPED
from karamelo_py.kernels.watch import GROWTH, LOOK, sum_energies, unit_of
from karamelo_py.points.basis import carried, extent
from karamelo_py.run import restart
from karamelo_py.run.no_number import culprit
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.stable import own_step_instead
from karamelo_py.run.tiles import in_tiles
from karamelo_py.run.watch import IN_ALL, WHOLE, cause_of_gain, grown_little, has_grown
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Place, ScriptError

LAST_GOOD = "last_good.*.h5"
LOOSE = 1.5  # cells: points of an unstrained solid are at most one apart
APART = "no other point of it within a cell"


class Trouble(NamedTuple):
    """What went wrong, what can be done, and the line of the script at fault where one is known."""

    message: str
    hint: str
    place: Place | None = None


def trouble(hub: Hub, simulation: Simulation, status: int) -> Trouble:
    """What went wrong in a step, and what can be done."""
    if status == ABOVE_LIMIT:
        return Trouble(*_above_limit(hub, simulation), hub.update.dt_place)
    if status == SHRUNK:
        return Trouble(*_shrunk(hub, simulation))
    if status == GAINED:
        return Trouble(*_gained(hub, simulation))
    if status == HEATED:
        return Trouble(*_heated(hub, simulation))
    message, hint, place = Trouble(*_wrong_point(hub, simulation))
    message = f"step {simulation.step + 1}, time {simulation.time:.6g}: {message}"
    if place is None and has_grown(simulation):
        cause, cure = cause_of_gain(hub, simulation)
        message += f", after energy had come from nowhere. Known to do that here: {cause}"
        hint = cure
    return Trouble(message, hint, place)


def stop(
    hub: Hub, simulation: Simulation, status: int, snapshot: dict, place: Place | None
) -> NoReturn:
    """Return to the last good state, write it, and raise what the user should know.

    Where energy has grown before, that is the last state in which it had not; log and dumps end
    with the last state that has no trouble of its own.
    """
    step = simulation.step
    message, hint, at_fault = trouble(hub, simulation, status)
    grown = not grown_little(simulation)
    if grown:
        _go_back(simulation, snapshot, step)
    elif status in (HEATED, STOPPED):
        simulation.restore(snapshot)
    path = _write_last_good(hub) if grown else None
    if status not in (GAINED, HEATED) and step > simulation.step:
        before = _energy(simulation)
        kept = simulation.step
        simulation.advance(step - kept)
        if path is None and _energy(simulation) - before > IN_ALL * max(
            abs(before), float(simulation.control.clock[0].energy_floor)
        ):
            # The watch looks at means of a hundred steps, and has not seen it yet.
            grown = True
            _go_back(simulation, snapshot, step)
            path = _write_last_good(hub)
            simulation.advance(step - simulation.step)
    path = path or _write_last_good(hub)
    _end_outputs(hub)
    if path is not None:
        name = os.path.relpath(path)
        which = "The state from before energy grew" if grown else "The last good state"
        hint += f". {which} is in {name}; karamelo-py SCRIPT -restart {name} goes on"
    error = ScriptError(message, place=at_fault or place, hint=hint)
    error.complete = at_fault is not None
    raise error


def _go_back(simulation: Simulation, snapshot: dict, end: int) -> None:
    """Return to the last state before step `end` whose energy has not grown since the `snapshot`.

    These steps are taken once more, from one look at the energy to the next.
    """
    simulation.restore(snapshot)
    clock = simulation.control.clock[0]
    before = float(clock.balance)
    while clock.watch_energy and simulation.step + LOOK < end:
        healthy = simulation.advance(LOOK - (simulation.step - 1) % LOOK) == DONE
        if not (healthy and grown_little(simulation)):
            break
        if clock.balance - before < GROWTH * unit_of(clock):
            snapshot = simulation.snapshot(snapshot)
    simulation.restore(snapshot)


def only_leave(hub: Hub, simulation: Simulation, snapshot: dict) -> bool:
    """Whether a step went wrong because points leave the domain, with no more energy than before.

    No smaller step keeps these. Where nobody watches energy, who knows.
    """
    moves = hub.update.method.frame.moves
    if not (moves and len(simulation.leaving()) and grown_little(simulation)):
        return False
    step = simulation.step
    simulation.restore(snapshot)
    before, steps = _energy(simulation), step - simulation.step
    if steps:
        simulation.advance(steps)
    gain = _energy(simulation) - before
    floor = float(simulation.control.clock[0].energy_floor)
    healthy = gain <= IN_ALL * max(abs(before), floor) and not simulation.above_limit()
    simulation.advance(1)  # which goes wrong again, for others to look at
    return healthy


def _energy(simulation: Simulation) -> float:
    """Kinetic, stored and dissipated energy less the work; NaN where nobody watches it."""
    s = simulation.setup
    clock = s.control.clock
    covered = all(in_tiles(block.tiling) == block.points.mass.size for block in s.blocks)
    if not (clock[0].watch_energy and covered):
        return nan
    present = clock.copy()
    sum_energies(s, simulation.mode)
    energy = float(clock[0].kinetic + clock[0].stored - clock[0].work)
    clock[:] = present
    return energy


def _above_limit(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    limit = simulation.limit
    message = (
        f"step {simulation.step}, time {simulation.time:.6g}: the step {simulation.dt:g} is above "
        f"the stable limit, which has fallen to {limit:.4g}"
    )
    speeds = np.abs(simulation.v).max(axis=1)
    fastest = int(np.argmax(speeds))
    message += f" ({_named(hub, simulation, fastest)} moves at {speeds[fastest]:.4g})"
    return message, own_step_instead(hub)


def _gained(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    clock = simulation.control.clock[0]
    given = abs(clock.first_balance) + clock.supplied
    cause, cure = cause_of_gain(hub, simulation)
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
    here = np.flatnonzero(simulation.present)
    speeds = np.abs(simulation.v[here]).max(axis=1)
    volumes = hub.fields.particle("volume") / hub.fields.reference_volume[here]
    fastest, widest = int(np.argmax(speeds)), int(np.argmax(volumes))
    message = (
        f"step {simulation.step}, time {simulation.time:.6g}: the stable step has fallen to "
        f"{simulation.limit:.3g}, less than a millionth of the first "
        f"({_named(hub, simulation, here[fastest])} moves at {speeds[fastest]:.3g}, "
        f"{_named(hub, simulation, here[widest])} has {volumes[widest]:.3g} times its volume)"
    )
    smaller = _smaller_step(hub, simulation)
    return message, f"something went wrong before: look at the dumps; {smaller}"


def _no_number(hub: Hub, simulation: Simulation, message: str, hint: str) -> Trouble:
    """The trouble with what is NaN, and the formula that it comes from, where that is found."""
    found = culprit(hub, simulation)
    if found is None:
        return Trouble(message, hint)
    what = "NaN" if np.isnan(found.value) else f"{found.value:g}"
    where = "" if found.x is None else f" at {_place(found.x[: hub.domain.dimension])}"
    return Trouble(
        f"{message}: fix {found.fix.id} gets {what}{where} from {found.formula.text}",
        "a formula that is a number at all times and places of the run, such as by max(a, b) or "
        "if(condition, a, b)",
        found.fix.place,
    )


def _wrong_point(hub: Hub, simulation: Simulation) -> tuple:
    """What is wrong with the first point that went wrong, and what can be done."""
    wrong = [(int(block.points.id[p]), block, p) for block, p in simulation.wrong_points()]
    if not wrong and hub.update.thermal:
        return _no_number(
            hub,
            simulation,
            "the temperature of a point is not a number",
            "look at the fixes that act on heat: a formula that gives NaN, or heat without bounds",
        )
    if not wrong:
        return "a point went wrong", "use a smaller step"
    number, block, p = min(wrong, key=lambda item: item[0])
    now = simulation.now
    d = hub.domain.dimension
    old, new = (block.points.x[k][:d, p].astype(float) for k in (now, 1 - now))
    name = _named(hub, simulation, number)
    smaller = _smaller_step(hub, simulation)
    if not np.isfinite(old).all():
        return _no_number(
            hub,
            simulation,
            f"{name} has no position (NaN)",
            f"look for a formula that gives NaN; {smaller}",
        )
    if not np.isfinite(new).all() or not np.isfinite(block.points.v[:, p]).all():
        return _no_number(
            hub,
            simulation,
            f"{name} at {_place(old)} gets a velocity that is not a number",
            f"look for a formula that gives NaN, such as a division by zero; else {smaller}",
        )
    lo, hi = hub.domain.lo[:d], hub.domain.hi[:d]
    if hub.update.method.frame.moves and ((new < lo).any() or (new > hi).any()):
        side = next(k for k in range(d) if new[k] < lo[k] or new[k] > hi[k])
        if simulation.above_limit():
            return f"{name} at {_place(old)} is thrown out of the domain", smaller
        loose = _loose(hub, simulation, block, p)
        why = f", come loose from its solid ({APART}: numerical fracture)," if loose else ""
        keep = f"; against fracture, {WHOLE}" if loose else ""
        return (
            f"{name}{why} leaves the domain at {_place(new)} (through {'xyz'[side]} = "
            f"{lo[side] if new[side] < lo[side] else hi[side]:g})",
            "make the domain larger, hold the point back with fix velocity_nodes at the wall, let "
            f"it go with boundary(delete), or, if it should not have got there, {smaller}{keep}",
        )
    move = float(np.abs(new - old).max()) / hub.lattices[block.points.grid[p]].h
    if move > 1:
        return (
            f"{name} at {_place(old)} moves by {move:.3g} cells in one step",
            f"the run is unstable: {smaller}",
        )
    tangled = _tangled(simulation, block, p)
    if tangled is not None:
        plain = "R4" if d == 2 else "R8"
        instead = f", {plain} in the place of {tangled}" if tangled in ("Q4", "H8") else ""
        return (
            f"the domain of {name} at {_place(old)} is tangled: one of its corners folds over",
            f"finer points, so that the corners of a domain move more alike{instead}, or method "
            f"tlcpdi, whose domains keep their shape; or {smaller}",
        )
    return (
        f"{name} at {_place(old)} is turned inside out (det F <= 0)",
        f"{smaller}, or a finer grid, or a law that resists the compression (neo-hookean)",
    )


def _loose(hub: Hub, simulation: Simulation, block: Block, p: int) -> bool:
    """Whether a point has a solid of others, none of which is within a cell."""
    number, now = int(block.points.id[p]), simulation.now
    d, h = hub.domain.dimension, hub.lattices[block.points.grid[p]].h
    others = simulation.present & (simulation.solid_of == simulation.solid_of[number])
    others[number] = False
    apart = np.abs(simulation.x[others][:, :d] - block.points.x[now][:d, p].astype(float))
    return len(apart) > 0 and bool(np.all(apart.max(axis=1) > LOOSE * h))


def _tangled(simulation: Simulation, block: Block, p: int) -> str | None:
    """The name of the basis where the domain of a point, whose corners move, is folded over."""
    s = simulation.setup
    if not s.frame.moves or carried(s.basis, s.kin) == 0:
        return None
    grid = record(s.grids, int(block.points.grid[p]))
    place = tuple(float(a) for a in block.points.x[1 - simulation.now][:, p])
    return None if np.isfinite(extent(s.basis, s.kin, grid, place)) else type(s.basis).__name__


def _smaller_step(hub: Hub, simulation: Simulation) -> str:
    """How to take a smaller step, and whether the present one is too large for sure."""
    if simulation.above_limit():
        return (
            f"the step {simulation.dt:.4g} is above the stable limit {simulation.limit:.4g}: "
            "set_dt to less, or leave set_dt and dt_factor out"
        )
    fixed = hub.update.fixed_dt is not None
    return "use a smaller step (set_dt)" if fixed else "use a smaller dt_factor"


def _named(hub: Hub, simulation: Simulation, number: int) -> str:
    solid = list(hub.solids.values())[int(simulation.solid_of[number])]
    return f"point {number + 1} of solid '{solid.id}'"


def _place(x: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"


def _write_last_good(hub: Hub) -> Path | None:
    """Write the present state to a file to go on from; a file of somebody else is left alone."""
    written: list[Path] = []
    path = restart.path_of(hub, Path(LAST_GOOD))
    if hub.output.writes and (not path.exists() or restart.is_restart(path)):
        with _told(hub):
            written.append(restart.write(hub, Path(LAST_GOOD), within=True))
            # The files of restart(...) would hold the same once more.
            for item in hub.output.last:
                item.last_step = hub.update.step
    return written[0] if written else None


def _end_outputs(hub: Hub) -> None:
    with _told(hub):
        hub.output.write(last=True)


@contextmanager
def _told(hub: Hub) -> Iterator[None]:
    """What prevents writing is told as a warning: another error is on its way."""
    try:
        yield
    except ScriptError as error:
        hub.warn(error.message, hint=error.hint, place=error.place)
