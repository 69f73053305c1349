"""Failures of a run: message, likely cause and fix."""

import numpy as np

from karamelo_py.advice import energy
from karamelo_py.advice.step_size import own_step_instead, step_by_script
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.clock import NOT_SOLVED
from karamelo_py.kernels.step import ABOVE_LIMIT, GAINED, HEATED, SHRUNK
from karamelo_py.language.rules import code_of
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.basis import carried, extent
from karamelo_py.points.laws import by_rates, can, deformation
from karamelo_py.run.listening import Trouble, when, where
from karamelo_py.run.no_number import no_number
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import moved
from karamelo_py.scene.solid import named, solid_with

DOUBTED_UNITS = ("units-of-velocities", "units-of-material")  # warnings about units
ABSURD = 10.0  # path in one step, in cells, above which a smaller step would not help
LOOSE = 1.5  # largest point spacing of an unstrained solid, in cells
LEFT = 0.02  # tolerated stress across a thin body / largest stress
APART = "no other point of this solid within a cell"


def trouble(hub: Hub, simulation: Simulation, status: int, smaller: str = "") -> Trouble:
    """Explain a failed step; `smaller` is the time step to suggest."""
    if status == ABOVE_LIMIT:
        return _above_limit(hub, simulation)
    smaller, too_large = _smaller_step(hub, simulation, smaller), simulation.steps.too_large
    if status in (GAINED, HEATED):
        result = (_gained if status == GAINED else _heated)(hub, simulation)
        result = result._replace(fix=smaller) if too_large else result
    elif status == SHRUNK:
        result = _shrunk(hub, simulation)
    elif simulation.control.motion[0].wrong == NOT_SOLVED:
        message = f"the pressures of the pore water do not converge ({when(simulation, 1)})"
        cause = (
            "walls that enclose incompressible water, or cells whose stiffnesses differ too much"
        )
        fix = f"a K of water such as 2.2e9 Pa, a drain with fix pore_pressure, or {smaller}"
        return Trouble(message, fix, "no-pressure", cause)
    elif simulation.failure:
        message = f"{simulation.failure} ({when(simulation, 1)})"
        fix = "smaller load steps; above the limit load there is no equilibrium"
        return Trouble(message, fix, "no-equilibrium")
    else:
        result = _wrong_point(hub, simulation, smaller)
        seen = f" after a spurious energy gain ({when(simulation, 1)})"
        if result.mark is None and simulation.energy_watch.has_grown():
            cause, fix = energy.cause_of_gain(hub, simulation)
            fix = smaller if too_large else fix
            result = result._replace(message=result.message + seen, fix=fix, cause=cause)
        else:
            result = result._replace(message=f"{result.message} ({when(simulation, 1)})")
    above = hub.update.above_waves
    if above and not result.cause and result.code in ("inside-out", "step-collapsed"):
        cause = "at the start, points move {:.3g} times as fast as the waves of their material"
        units = "check the units of modulus, density and velocity"
        cause = (cause + " (c = {:.3g})").format(*above)
        return result._replace(cause=cause, fix=f"{units}; {result.fix}")
    if result.mark is None and not result.cause and (too_large or simulation.steps.above_limit()):
        return result._replace(cause=_above_limit_as_cause(hub, simulation))
    return result


def _above_limit_as_cause(hub: Hub, simulation: Simulation) -> str:
    update = hub.update
    if step_by_script(update.fixed_dt, update.dt_factor) in update.warned_of:
        return "time step above the stability limit (see the warning)"
    here = "" if simulation.steps.too_large else f" {simulation.steps.limit:.4g}"
    return f"time step {simulation.dt:.4g} above the stability limit{here}"


def _above_limit(hub: Hub, simulation: Simulation) -> Trouble:
    speed, fastest = simulation.points.largest(_speeds)
    message = (
        f"time step {simulation.dt:g} is above the stability limit, which has fallen to "
        f"{simulation.steps.limit:.4g}: {named(hub, fastest)} moves at {speed:.4g} "
        f"({when(simulation)})"
    )
    fix, mark = own_step_instead(simulation), hub.update.dt_mark
    return Trouble(message, fix, "step-above-limit", mark=mark)


def _speeds(points: PointTable) -> np.ndarray:
    return np.abs(points.velocity).max(axis=1, initial=0.0)


def _gained(hub: Hub, simulation: Simulation) -> Trouble:
    watch = simulation.control.energy[0]
    if not np.isfinite(watch.balance):
        _, first = simulation.points.largest(
            lambda points: 1.0 * ~np.isfinite(points.particle("ienergy"))
        )
        message = (
            f"energy is not a number; the first point with a state that is not a number is "
            f"{named(hub, first)} ({when(simulation)})"
        )
        fix = "check the parameters of its material, and fixes in Python that act on it"
        if can(solid_with(hub, first).material.whole, deformation):
            fix += "; gent has no energy beyond I1*J^(-2/3) - 3 = Jm"
        return Trouble(message, fix, "not-a-number")
    supplied = abs(watch.first_balance) + watch.supplied
    cause, fix = energy.cause_of_gain(hub, simulation)
    gain = watch.balance - watch.first_balance
    much = f"{gain / supplied:.3g} x" if supplied > 0 else f"{gain:.3g} more than"
    message = (
        f"energy balance: {much} the initial energy and applied work has appeared "
        f"({when(simulation)})"
    )
    return Trouble(message, fix, "energy-gain", cause)


def _heated(hub: Hub, simulation: Simulation) -> Trouble:
    step, heat = simulation.control.step[0], simulation.control.heat[0]
    fraction = step.last_dt / heat.heat_limit
    message = (
        f"temperatures are between {heat.T_low:.6g} and {heat.T_high:.6g}; initial state, fixes "
        f"and sources allow {heat.coldest:.6g} to {heat.hottest + heat.own_heat:.6g} "
        f"({when(simulation)})"
    )
    if fraction > 1:
        cause = f"time step is {fraction:.3g} x the stability limit of conduction"
        return Trouble(message, own_step_instead(simulation), "temperature", cause)
    return Trouble(message, _smaller_step(hub, simulation), "temperature")


def _shrunk(hub: Hub, simulation: Simulation) -> Trouble:
    (speed, fastest), (volume, widest) = map(simulation.points.largest, (_speeds, energy.swelling))
    message = (
        f"the stability limit of the time step has fallen to {simulation.steps.limit:.3g}, less "
        f"than a millionth of the first: {named(hub, fastest)} moves at {speed:.3g}, "
        f"{named(hub, widest)} has {volume:.3g} x its initial volume ({when(simulation)})"
    )
    fix = f"look for the first error in earlier dumps; {_smaller_step(hub, simulation)}"
    return Trouble(message, fix, "step-collapsed")


def _first_wrong(simulation: Simulation) -> tuple | None:
    wrong = []
    for block in simulation.setup.blocks:
        tiling = block.tiling
        # The last sweep over points reports at most one point per tile.
        at = tiling.report[: max(int(tiling.count[0]), 1), 2]
        wrong += [(int(block.points.id[p]), block.points, p) for p in (at[at > 0] - 1).astype(int)]
    if not wrong:
        return None
    number, points, p = min(wrong, key=lambda item: item[0])
    old, new = (points.x[k][:, p].astype(float) for k in (simulation.now, 1 - simulation.now))
    return number, old, new, points.v[:, p], int(points.grid[p])


def _wrong_point(hub: Hub, simulation: Simulation, smaller: str) -> Trouble:
    wrong = [one for one in simulation.points.seen(_first_wrong) if one is not None]
    if not wrong and hub.update.thermal:
        hint = "check fixes that act on heat: a formula that gives NaN, or unbounded heat"
        return no_number(simulation, "the temperature of a point is not a number", hint)
    if not wrong:
        return Trouble("a point failed", "a smaller time step", "point")
    number, old, position, v, grid = min(wrong, key=lambda one: one[0])
    d, h, name = hub.domain.dimension, hub.lattices[grid].h, named(hub, number)
    old, new = old[:d], position[:d]
    if not np.isfinite(old).all():
        hint = f"look for a formula that gives NaN; else {smaller}"
        return no_number(simulation, f"{name} has no position (NaN)", hint)
    if not np.isfinite(new).all() or not np.isfinite(v).all():
        seen = f"{name} at {where(old)} gets a velocity that is not a number"
        hint = f"look for a formula that gives NaN, such as a division by zero; else {smaller}"
        return no_number(simulation, seen, hint)
    lo, hi = hub.domain.lo[:d], hub.domain.hi[:d]
    move = float(np.abs(new - old).max()) / h
    unstable = smaller
    if move > ABSURD:
        unstable = f"check loads, stresses and velocities, and their units; else {smaller}"
    if hub.update.method.frame.moves and ((new < lo).any() or (new > hi).any()):
        if move > ABSURD:
            seen = (
                f"{name} at {where(old)} moves by {move:.3g} cells in one step, out of the domain"
            )
            return Trouble(seen, unstable, "point-lost")
        side = next(k for k in range(d) if new[k] < lo[k] or new[k] > hi[k])
        if simulation.steps.above_limit():
            seen = f"{name} at {where(old)} is thrown out of the domain"
            return Trouble(seen, smaller, "point-lost")
        if body := moved(hub).get(solid_with(hub, number)):
            seen = f"the rigid body '{body.moves.id}' leaves the domain at {where(new)}"
            hint = "a larger domain, or a region that stops it, with fix contact/bodies"
            return Trouble(f"{seen} (point {number})", hint, "body-left")
        loose = _loose(simulation, number, old, LOOSE * h)
        keep = f"; against fracture, {energy.WHOLE}" if loose else ""
        for fix in hub.fixes.values():
            keep += f"; if it went through fix '{fix.id}', a wall of two cells" * fix.presses
        return Trouble(
            f"{name} leaves the domain at {where(new)} (through {'xyz'[side]} = "
            f"{lo[side] if new[side] < lo[side] else hi[side]:g})",
            "a larger domain, fix velocity_nodes at the wall, or boundary(delete); if the point "
            f"should not be there, {smaller}{keep}",
            "left-domain",
            f"point separated from its solid: numerical fracture ({APART})" if loose else "",
        )
    if move > 1:
        seen = f"{name} at {where(old)} moves by {move:.3g} cells in one step"
        return Trouble(seen, unstable, "moves-too-far")
    if any(simulation.points.seen(_is_tangled, position, grid)):
        tangled, plain = type(hub.update.method.basis).__name__, "R4" if d == 2 else "R8"
        instead = f", {plain} instead of {tangled}" if tangled in ("Q4", "H8") else ""
        return Trouble(
            f"the domain of {name} at {where(old)} is tangled: one of its corners folds over",
            f"more points per cell{instead}, method tlcpdi, or {smaller}",
            "tangled",
        )
    law = solid_with(hub, number).material.whole
    other = ", or a law that resists the compression (neo-hookean)" if by_rates(law) else ""
    return Trouble(
        f"{name} at {where(old)} is turned inside out (det F <= 0)",
        f"{smaller}, or a finer grid{other}",
        "inside-out",
    )


def _loose(simulation: Simulation, number: int, x: np.ndarray, reach: float) -> bool:
    solid = solid_with(simulation.hub, number)

    def others(simulation: Simulation) -> tuple[int, int]:
        count, near = 0, 0
        for table in simulation.points.some(None):
            other = (table.solid == solid.index) & (table.numbers != number)
            distances = np.abs(table.position[other] - x).max(axis=1, initial=0.0)
            count, near = count + len(distances), near + int(np.sum(~(distances > reach)))
        return count, near

    count, near = np.sum(simulation.points.seen(others), axis=0)
    return count > 0 and near == 0


def _is_tangled(simulation: Simulation, x: np.ndarray, grid: int) -> bool:
    s = simulation.setup
    if not s.frame.moves or carried(s.basis, s.kin) == 0:
        return False
    return not np.isfinite(extent(s.basis, s.kin, record(s.grids, grid), tuple(x.tolist())))


def _smaller_step(hub: Hub, simulation: Simulation, instead: str = "") -> str:
    if doubted := [name for name in hub.update.warned_of if code_of(name) in DOUBTED_UNITS]:
        units = f"check the {doubted[0]} (see the warning)"
        return f"{units}, then {instead}" if instead else units
    if instead:
        return instead
    if simulation.implicit:
        inertia = simulation.hub.update.scheme.traits.inertia
        return "a smaller time step (set_dt)" if inertia else "more and smaller load steps"
    if simulation.steps.above_limit():
        return own_step_instead(simulation)
    fixed = hub.update.fixed_dt is not None
    return "a smaller time step (set_dt)" if fixed else "a smaller dt_factor"


def warn_of_stress_left(hub: Hub, simulation: Simulation) -> None:
    """Warn once of a stress across a thin body that is not small, with its law, step and state."""
    left = hub.fields.particle("stress_left")
    if left.max(initial=0) <= LEFT or not hub.update.first_time("stress across"):
        return
    p = int(np.argmax(left))
    solid = solid_with(hub, p)
    plate = hub.domain.dimension == 2
    command, across = ("plane_stress", "plate") if plate else ("uniaxial_stress", "bar")
    names = [name for name in ("thickness", "damage", "ep") if name in hub.fields.particle_names()]
    state = ", ".join(f"{name} {hub.fields.particle(name)[p]:.3g}" for name in names)
    hub.warn(
        f"{command}: the stress across the {across} is not 0: up to {when(simulation)} it was "
        f"{left[p]:.1%} of the largest stress at a point of solid '{solid.id}' "
        f"(material {solid.material.id}; {state})",
        cause="the law breaks or softens faster than the iterations of a step can follow; the next "
        "steps remove this stress",
        hint="dt_factor(0.5) or smaller load steps; the column stress_left shows these points",
    )
