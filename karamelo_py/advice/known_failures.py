"""Combinations that are known to fail, with reason and fix.

These rules (`karamelo_py.language.rules`) concern several parts. Each rule is reported once.
"""

from collections.abc import Iterable, Iterator
from math import fsum, inf, isfinite
from typing import NamedTuple

import numpy as np

from karamelo_py.advice import step_size
from karamelo_py.advice.basics import is_zero
from karamelo_py.advice.facts import SceneFacts
from karamelo_py.kernels.hooks import HEAT_STAGES, CompiledHook
from karamelo_py.kernels.watch import BORNE
from karamelo_py.language.rules import Advice
from karamelo_py.output.node_columns import places_of
from karamelo_py.output.point_table import COMPONENTS, PointTable
from karamelo_py.output.units import DENSITY, STRESS, VELOCITY, Units
from karamelo_py.points.laws import can, constrained_velocity, law_kind, law_traits, specific_volume
from karamelo_py.run import stable_step
from karamelo_py.run.no_number import endless_speed
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.group import NOTHING_THERE, NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.script.expressions import POINT_SEEDS
from karamelo_py.script.terms import evaluated

PEEK = 100  # steps; a shorter run is only an inspection of a scene
ENDLESS = 1e8
MIXED = 300  # step / stable step above which wrong units are likelier
DENSITIES = 10.0, 1e5  # kg/m^3, from foams to above osmium; gases are not checked
CRUSHED = 1.0  # strain under the weight (stresses in kPa are a factor of 1000)
IMPOSSIBLE = 30.0  # speed / wave speed (mm/s instead of m/s is a factor of 1000)
SWAPPED = (1e4, 1e2, 3e4), (1e-2, 1e-11, 3e-8)  # density; moduli, in m, kg, s and mm, t, s
SPEEDS = 1.0, 5e4  # wave speeds in m/s, from jelly to above diamond
REST = "a scene at rest"
UNITS = (
    "m, kg, s: gravity 9.81, water's density 1000, steel's modulus 2e11; mm, t, s: 9810, 1e-9, 2e5"
)


def warn_about_rest(hub: Hub, simulation: Simulation, duration: float) -> None:
    if hub.domain.across is not None or duration < PEEK * simulation.dt:
        return
    if _rests(hub, simulation) and hub.update.first_time(REST):
        hub.warn(
            "nothing moves in this run: all velocities, stresses and loads are zero",
            hint="fix(ID, initial_velocity_particles, ...), fix(ID, body_force, ...) or another "
            "load, before it",
            code="nothing-moves",
        )


def _rests(hub: Hub, simulation: Simulation) -> bool:
    """Return True if nothing can move; plug-ins count as motion."""
    laws = [solid.material.law for solid in hub.solids.values()]
    update = hub.update
    parts = [type(p) for p in (update.method, update.method.basis, update.transfer, update.scheme)]
    parts += [kind for law in laws for kind in law_kind(law)]
    built_in = all(kind.__module__.startswith("karamelo_py.") for kind in parts)
    if not all(_is_zero(fix) for fix in hub.fixes.values()):
        return False
    if not built_in or update.thermal or any(can(law, constrained_velocity) for law in laws):
        return False

    columns = ("vtheta", *["s" + c for c in COMPONENTS])

    def largest(points: PointTable) -> np.ndarray:
        return np.max([np.abs(points.particle(name)) for name in columns], axis=0)

    return simulation.fastest() == 0 and simulation.points.largest(largest)[0] == 0


def _is_zero(fix: Fix) -> bool:
    holds_at_zero = fix.formulas and all(map(is_zero, fix.formulas))
    return not (fix.for_method or (fix.hooks() and not holds_at_zero))


def warn_about_weightless_water(hub: Hub, simulation: Simulation) -> None:
    """Warn once of pore water without any load that could make it flow."""
    wet = [solid.material for solid in hub.solids.values() if solid.material.fluid]
    still = all(map(_is_water_at_rest, hub.fixes.values())) and simulation.fastest() == 0
    if wet and still and hub.update.first_time(REST):
        marks = [fix.mark for fix in hub.fixes.values() if fix.water_only and not _is_zero(fix)]
        g = ", ".join([*["0"] * (hub.domain.dimension - 1), "-9.81"])
        hub.warn(
            f"the water in the pores of '{wet[0].id}' has no weight, and nothing loads the ground",
            mark=[*marks, wet[0].mark][0],
            hint=f"fix(weight, body_force, all, {g}), which acts on soil and water, or a load",
            code="weightless-water",
        )


def _is_water_at_rest(fix: Fix) -> bool:
    if fix.water_only:
        return all(is_zero(f) or not f.names.isdisjoint(POINT_SEEDS) for f in fix.formulas)
    return _is_zero(fix)


def warn_about_length(hub: Hub, simulation: Simulation, end_time: float) -> None:
    span = end_time - simulation.time
    dt = simulation.steps.later_dt
    if not (isfinite(span) and span > ENDLESS * dt > 0):
        return
    about = f"about {span / dt:.2g} steps of {dt:.3g} from here to time"
    why, hint = mixed_units(hub, simulation), UNITS
    if hub.update.fixed_dt is not None:
        why, hint = "", "a larger step with set_dt, or an earlier end"
    elif simulation.ruling_limit == "conduction":
        why = (
            f"conduction through cells of {hub.domain.h:g} needs such steps. The units of "
            "conductivities, heat capacities, lengths and times may be mixed"
        )
        hint = "an earlier end, or larger cells; in m, kg, s, K copper has kappa = 401, cp = 385"
    hub.warn(f"{about} {end_time:.6g}" + (f": {why}" if why else ""), hint=hint, code="many-steps")


def mixed_units(hub: Hub, simulation: Simulation) -> str:
    speed = stable_step.fastest_wave(simulation)
    return (
        f"waves move at {speed:.3g} through cells of {hub.domain.h:g}. The units of densities, "
        "moduli, lengths and times may be mixed"
    )


class Step(NamedTuple):
    """The step of run number `run`, and quantities on which its limit depends.

    `span` is the length of the run in time and in steps.
    """

    run: int
    mark: Mark | None
    fixed_dt: float | None
    dt_factor: float | None
    halves: bool
    scene: tuple
    span: tuple[float, float] = (inf, inf)


def step_of(hub: Hub, halves: bool, span: tuple[float, float] = (inf, inf)) -> Step:
    update = hub.update
    method, scheme, transfer = update.method, update.scheme, update.transfer
    scene = (
        *((solid.id, solid.material, solid.h, solid.count) for solid in hub.solids.values()),
        *(hub.domain.h, method, update.thermal),
        *(type(scheme), scheme, type(transfer), transfer),
    )
    return Step(hub.begun, update.dt_mark, update.fixed_dt, update.dt_factor, halves, scene, span)


def later_steps(hub: Hub) -> list[Step]:
    return [step for step in hub.later if step.run > hub.begun]


def warn_about_steps(
    hub: Hub, simulation: Simulation, halves: bool, *, again: bool = False
) -> None:
    """Warn of a step above the limit, in this run or a later one; once, unless `again`."""
    present, limit = step_of(hub, halves), simulation.steps.limit_moving
    of_heat = float(simulation.control.heat[0].heat_limit)
    stable = step_size.stable_step(simulation, limit)
    for step in (present, *later_steps(hub)):
        asked = step.fixed_dt or (step.dt_factor or 0) * limit
        if step.scene != present.scene or not asked > stable * (1 + 1e-12):
            continue
        name = step_size.step_by_script(step.fixed_dt, step.dt_factor)
        command = name.split()[0]
        words = f"time step {asked:.4g} of {command} is "
        hint = step_size.own_step_instead(simulation, command)
        if asked > BORNE * of_heat and not step.halves:
            words += f"{asked / of_heat:.3g} x the stability limit of conduction: "
            words += "temperatures would oscillate"
            if step is present:
                raise ScriptError(words, mark=step.mark, hint=hint, code="step-above-limit")
        elif limit == of_heat:
            words += f"above the stability limit {limit:.4g} of conduction; "
            words += f"temperatures oscillate above {BORNE:g} x this limit"
        else:
            words += f"above the stability limit {stable:.4g}"
            words += step_size.what_follows(simulation, asked)
            if step.fixed_dt and asked > MIXED * stable:
                words += f"; {mixed_units(hub, simulation)}"
                hint = f"{UNITS}. If they are correct, {hint}"
        if hub.update.first_time(name) or (again and step is present):
            hub.warn(words, mark=step.mark, hint=hint, code="step-above-limit")
    hub.later.clear()


def _impossible_values(s: SceneFacts) -> Iterator[Advice]:
    laws = [solid.material.law for solid in s.hub.solids.values()]
    solid = any(not any(law_traits(k).any_speed for k in law_kind(law)) for law in laws)
    if solid and s.speed > 1 and not s.hub.update.above_waves:
        s.hub.update.above_waves = [float(s.speed), float(s.waves)]
    words = "The units of velocities, loads, densities and moduli may be mixed"
    if solid and s.speed > IMPOSSIBLE:
        fact = f"points move at {s.fastest:.3g}, {s.speed:.3g} x the wave speed ({s.waves:.3g})"
        words = f"{fact}: no solid survives an impact at that speed. {words}"
        yield Advice("units of velocities", words, UNITS)
    elif solid and s.sag > CRUSHED:
        words = f"under its load a body has a strain of {s.sag:.3g}, so it collapses. {words}"
        mark = next(fix.mark for fix in s.hub.fixes.values() if fix.accelerates)
        yield Advice("units of loads", words, UNITS, mark=mark)


def _other_units(s: SceneFacts) -> Iterator[Advice]:
    units, doubted = s.hub.output.units, {}
    for solid in s.hub.solids.values():
        speed = stable_step.elastic_speed(s.simulation, solid)[0]
        if words := _odd_in(units, solid.material.law, speed):
            doubted[solid.material] = words
    for material, (odd, fix) in list(doubted.items())[:1]:
        others = [repr(one.id) for one in doubted if one is not material]
        odd += f"; the same holds for {', '.join(others)}" * bool(others)
        yield Advice(f"units of material '{material.id}'", odd, fix, mark=material.mark)


def _odd_in(units: Units | None, law: NamedTuple, speed: float) -> tuple[str, str] | None:
    density = 1 / float(specific_volume(law))
    modulus = density * speed**2
    if units is None:
        if not any(density >= one and low <= modulus <= high for one, low, high in SWAPPED):
            return None
        words = f"its density {density:.3g} is far above its modulus {modulus:.3g}, which makes "
        return f"{words}waves of the speed {speed:.3g}: swapped?", "the density, then the modulus"
    density, speed = units.si(DENSITY) * density, units.si(VELOCITY) * speed
    odd, least = [], min(law_traits(kind).least_density for kind in law_kind(law))
    if not least <= density <= DENSITIES[1]:
        odd.append(f"density is {density:.3g} kg/m^3")
    if speed != 0 and not SPEEDS[0] <= speed <= SPEEDS[1]:  # speed 0 means a rigid solid
        odd.append(f"speed of waves is {speed:.3g} m/s")
    if not odd:
        return None
    return (
        f"with units({', '.join(units[:3])}) its {' and its '.join(odd)}: no real material has "
        "such values",
        f"in {units.name(DENSITY)} water has the density {1e3 / units.si(DENSITY):.3g}; "
        f"steel the modulus {2e11 / units.si(STRESS):.3g} {units.name(STRESS)}",
    )


def warn(hub: Hub, simulation: Simulation, duration: float, halves: bool) -> None:
    _warn_about_groups(hub, simulation)
    if not isfinite(simulation.fastest()):
        raise endless_speed(simulation)
    scene = SceneFacts(hub, simulation, duration)
    scene.duration += _gone(hub, simulation) + _duration_of_later(hub, simulation)
    one_step = 0 < scene.duration <= simulation.dt * (1 + 1e-9) and isfinite(simulation.steps.limit)
    if one_step and simulation.ruling_limit == "end" and hub.update.first_time("one step"):
        limit = simulation.steps.limit
        words = f"one step covers the whole run, but the stable step is {limit:.3g}"
        hub.warn(f"{words}; {mixed_units(hub, simulation)}", hint=UNITS, code="one-step")
    if scene.waves > 0 and step_size.blows_up(simulation):
        scene.duration = 0.0
    warn_about_steps(hub, simulation, halves)
    _warn_about_precision(scene)
    if duration >= PEEK * simulation.dt:
        warn_about_weightless_water(hub, simulation)
    warn_about_rest(hub, simulation, duration)
    _tell(hub, (*scene.advice("failure"), *_impossible_values(scene), *_other_units(scene)))


def warn_about_factor(hub: Hub) -> None:
    update = hub.update
    idle = update.dt_factor is not None and update.fixed_dt is None
    if idle and update.first_time("dt_factor"):
        hub.warn(
            "dt_factor has no effect: set_dt sets the size of load steps (default 1)",
            mark=update.dt_mark,
            hint="set_dt(...) instead",
            code="dt-factor-ignored",
        )


def warn_about_steps_of_1(hub: Hub, time: float, steps: float) -> None:
    """Warn once of load steps without set_dt in which heat or water flows or a load is complete."""
    update = hub.update
    if update.fixed_dt is not None or update.scheme.traits.inertia:
        return
    wet = any(solid.material.fluid for solid in hub.solids.values())
    if (wet or update.thermal) and update.first_time("load steps of 1"):
        what = "water" if wet else "heat"
        text = f"load steps of 1, as the script has no set_dt: {what} flows for that time in each"
        hub.warn(text, mark=update.scheme_mark, hint="set_dt(...), the time of a step")
    for fix in hub.fixes.values() if 2 <= steps < inf else ():
        for formula in fix.all_formulas:
            if formula.names != {"time"}:
                continue
            now, first, last = (evaluated(formula, lambda _, t=t: time + t) for t in (0, 1, steps))
            if now != first == last and update.first_time("loads at once"):
                hub.warn(
                    f"load steps of 1, as the script has no set_dt: '{formula.text}' has its last "
                    "value from the first step on",
                    mark=fix.mark,
                    hint=f"set_dt({1 / steps:.3g})",
                    code="loads-at-once",
                )


def warn_about_loads(hub: Hub, steps: float) -> None:
    """Warn once if constant loads act in the first load step only."""
    acting = [fix for fix in hub.fixes.values() if fix.hooks() and not fix.first_step_only]
    formulas_by_fix = {fix: fix.all_formulas for fix in acting}
    change = any(
        not formula.is_constant for formulas in formulas_by_fix.values() for formula in formulas
    )
    flows = hub.update.thermal or any(solid.material.fluid for solid in hub.solids.values())
    if hub.update.scheme.traits.inertia or flows or steps < 2 or change:
        return
    loads, moves = [], False
    for fix, formulas in formulas_by_fix.items():
        acts = not all(map(is_zero, formulas))
        if fix.prescribes_velocity or fix.prescribes_rotation or fix.leads_points:
            moves |= acts
        elif acts:
            loads.append(fix)
    if loads and not moves and hub.update.first_time("loads at once"):
        hub.warn(
            f"fix {loads[0].style} '{loads[0].id}' does not depend on time: its full load acts "
            "in the first load step and does not change in later steps",
            mark=loads[0].mark,
            hint="a formula of time, which grows by set_dt or 1 per load step: multiply by "
            "time/40 in run(40); or use run(1)",
            code="loads-at-once",
        )


def warn_about_laws(hub: Hub, simulation: Simulation, duration: float) -> None:
    _tell(hub, SceneFacts(hub, simulation, duration).advice("failure", of_laws=True))


def _tell(hub: Hub, advice: Iterable[Advice]) -> None:
    for each in advice:
        if hub.update.first_time(each.name):
            mark = each.mark or hub.update.method.mark
            hub.warn(f"{each.name}: {each.reason}", mark=mark, hint=each.cure, code=each.code)


def _duration_of_later(hub: Hub, simulation: Simulation) -> float:
    present = step_of(hub, False).scene
    later = [step for step in later_steps(hub) if step.scene == present]
    spans = [min(s.span[0], s.span[1] * (s.fixed_dt or simulation.dt)) for s in later]
    return fsum(span for span in spans if isfinite(span))


def _gone(hub: Hub, simulation: Simulation) -> float:
    fixes, update = list(hub.fixes.values()), hub.update
    before, since = update.moving
    if any(all(fix is not other for other in before) for fix in fixes):
        since = simulation.time
    update.moving = fixes, since
    return simulation.time - since


def _warn_about_precision(s: SceneFacts) -> None:
    """Warn if single precision cannot resolve how far points move in a step.

    At 50 000 cells from the origin, the path of a falling block has an error of 3.5 %. At 200 000
    cells, the block does not move. Raises ScriptError if positions are 1/500 cell or more apart.
    """
    if s.hub.settings.precision != "single":
        return
    x = max((max(-one.low.min(), one.high.max()) for one in s.motions), default=0.0)
    step, spacing = s.fastest * s.simulation.dt, float(np.spacing(np.float32(x)))
    far, apart = x / s.hub.domain.h, spacing / s.hub.domain.h
    hint, code = "precision(double), or a domain around the origin", "single-precision"
    words = (
        f"points lie up to {far:.3g} cells from the origin, where positions in single precision "
        f"have a spacing of {apart:.2g} cells: slow motion will be lost"
    )
    if apart > 2e-3:
        raise ScriptError(words, hint=hint, code=code)
    if 0 < step < 16 * spacing:
        s.hub.warn(
            f"a step moves points by {step:.2g} at most, and in single precision positions have "
            f"a spacing of {spacing:.2g}: motion will be lost to rounding",
            hint=hint,
            code=code,
        )
    elif apart > 1e-3:
        s.hub.warn(words, hint=hint, code=code)


def _out_of_reach(hub: Hub, simulation: Simulation, fix: Fix) -> bool:
    x = places_of(hub, fix.nodes)[:, : hub.domain.dimension]
    method, setup = hub.update.method, simulation.setup
    reach = (method.basis.traits.cells + 1) / 2 * max(lattice.h for lattice in hub.lattices)
    lo, hi = x.min(axis=0) - reach, x.max(axis=0) + reach

    def near(points: PointTable) -> np.ndarray:
        at = points.position if setup.frame.moves else points.reference_position
        return ((lo <= at) & (at <= hi)).all(axis=1).astype(float)

    return not simulation.points.largest(near)[0] > 0


def _warn_about_groups(hub: Hub, simulation: Simulation) -> None:
    for fix in hub.fixes.values():
        of_mass = any(
            hook.uses_share or moment in HEAT_STAGES
            for moment, hook in fix.hooks().items()
            if isinstance(hook, CompiledHook) and hook.on_nodes
        )
        chosen = of_mass and not fix.group.all and len(fix.group)
        unreached = chosen and _out_of_reach(hub, simulation, fix)
        if unreached and hub.update.first_time(f"out of reach {fix.id}"):
            hub.warn(
                f"fix {fix.style} '{fix.id}' acts on nodes that no point reaches: {NOTHING_THERE}",
                mark=fix.mark,
                hint="a region that reaches into the body",
                code="out-of-reach",
            )
    for group in hub.groups.values():
        if isinstance(group, NodeGroup) and group.awaits_solids and not len(group):
            group.awaits_solids = False
            hint = "nodes belong to the solids here: fix contact/surface makes walls next to them"
            message = f"group '{group.id}' holds no nodes; {NOTHING_THERE}"
            hub.warn(message, group.mark, hint, code="no-nodes")
