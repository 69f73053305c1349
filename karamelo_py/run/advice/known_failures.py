"""Warnings before a run: combinations that are known to fail, with the reason and the cure.

Parts of the scene say them by their rules (`karamelo_py.language.rules`), by the name that the
documentation has for the failure; here is what no part says. `karamelo-py check` tells them, and a
run before its first step, once.
"""

from collections.abc import Iterator
from math import isfinite

import numpy as np

from karamelo_py.language.rules import Advice
from karamelo_py.output.units import DENSITY, STRESS, VELOCITY
from karamelo_py.points.laws import law_kind, specific_volume
from karamelo_py.run.advice.facts import SceneFacts
from karamelo_py.run.advice.large_steps import duration_of_later, warn_about_steps
from karamelo_py.run.advice.resting import UNITS, warn_about_rest
from karamelo_py.run.diagnosis.explain import no_number
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.timestep import blows_up, elastic_speed
from karamelo_py.scene.group import NOTHING_THERE, NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

DENSITIES = 10.0, 1e5  # kg/m^3, of all but gases: foams to beyond osmium
IMPOSSIBLE = 30.0  # times the speed of waves: mm/s in the place of m/s make 1000 of 1
SPEEDS = 1.0, 5e4  # m/s, of waves: jelly to beyond diamond


def _impossible_speeds(s: SceneFacts) -> Iterator[Advice]:
    """Look for speeds that no solid bears."""
    laws = [solid.material.law for solid in s.hub.solids.values()]
    solid = any(not any(getattr(k, "any_speed", False) for k in law_kind(law)) for law in laws)
    if solid and s.speed > IMPOSSIBLE:
        yield Advice(
            "units of velocities",
            f"points move at {s.fastest:.3g}, {s.speed:.3g} times the speed of waves "
            f"({s.waves:.3g}), which no solid bears when it meets another or a wall. The units of "
            "velocities, densities and moduli may be mixed",
            UNITS,
        )


def _other_units(s: SceneFacts) -> Iterator[Advice]:
    """Look for materials whose numbers are in others than those that `units` names."""
    units = s.hub.output.units
    for solid in s.hub.solids.values() if units else ():
        law = solid.material.law
        density = units.si(DENSITY) / float(specific_volume(law))
        speed = units.si(VELOCITY) * elastic_speed(s.simulation, solid)[0]
        least = min(getattr(kind, "least_density", DENSITIES[0]) for kind in law_kind(law))
        odd = []
        if not least <= density <= DENSITIES[1]:
            odd.append(f"density is {density:.3g} kg/m^3")
        if speed != 0 and not SPEEDS[0] <= speed <= SPEEDS[1]:  # 0 is rigid
            odd.append(f"speed of waves is {speed:.3g} m/s")
        if odd:
            yield Advice(
                f"units of material '{solid.material.id}'",
                f"with units({', '.join(units[:3])}) its {' and its '.join(odd)}, such as no real "
                "material has",
                f"in {units.name(DENSITY)} water has the density {1e3 / units.si(DENSITY):.3g}; "
                f"1 GPa is {1e9 / units.si(STRESS):.3g} {units.name(STRESS)}",
                place=solid.material.place,
            )


def warn(hub: Hub, simulation: Simulation, duration: float, halves: bool) -> None:
    """Tell what will go wrong in a run of `duration`, and the next; each failure once in a script.

    Raises
    ------
    ScriptError
        If temperatures would swing, in a run that does not halve its step then, or if points have
        velocities that are no numbers.
    """
    _warn_about_groups(hub)
    refuse_endless_speeds(hub, simulation)
    scene = SceneFacts(hub, simulation, duration)
    scene.duration += _gone(hub, simulation) + duration_of_later(hub, simulation)
    if scene.waves > 0 and blows_up(hub, simulation):
        scene.duration = 0.0  # it never comes so far
    warn_about_steps(hub, simulation, halves)
    _warn_about_precision(scene)
    warn_about_rest(hub, simulation, duration)
    for one in (*scene.advice("failure"), *_impossible_speeds(scene), *_other_units(scene)):
        if one.name not in hub.update.foreseen:
            hub.update.foreseen.append(one.name)
            place = one.place or hub.update.method.place
            hub.warn(f"{one.name}: {one.reason}", place=place, hint=one.cure)


def refuse_endless_speeds(hub: Hub, simulation: Simulation) -> None:
    """Refuse velocities of points that are no numbers, with the formula that they come from.

    Raises
    ------
    ScriptError
        If there are some.
    """
    if not isfinite(simulation.fastest()):
        found = no_number(
            hub,
            simulation,
            f"points have a velocity that is not a number at time {simulation.time:.6g}",
            "look for a formula that gives NaN or infinity, such as a division by zero",
        )
        raise ScriptError(found.message, place=found.place, hint=found.hint)


def _gone(hub: Hub, simulation: Simulation) -> float:
    """Time that the solids have moved: since the last fix has come."""
    fixes, update = list(hub.fixes.values()), hub.update
    known, since = update.moving
    if any(all(fix is not other for other in known) for fix in fixes):
        since = simulation.time
    update.moving = fixes, since
    return simulation.time - since


def _warn_about_precision(s: SceneFacts) -> None:
    """Say so when single precision cannot hold what a step adds to a position."""
    if s.hub.settings.precision != "single":
        return
    x = max((max(-one.low.min(), one.high.max()) for one in s.motions), default=0.0)
    step, spacing = s.fastest * s.simulation.dt, float(np.spacing(np.float32(x)))
    if 0 < step < 16 * spacing:
        s.hub.warn(
            f"a step moves points by {step:.2g} at most, and in single precision positions have "
            f"a spacing of {spacing:.2g}: motion will be lost to rounding",
            hint="precision(double), or a domain around the origin",
        )


def _warn_about_groups(hub: Hub) -> None:
    """Say so, once, where the solids have brought no nodes to a group that waited for them."""
    for group in hub.groups.values():
        if isinstance(group, NodeGroup) and group.awaits_solids and not len(group):
            group.awaits_solids = False
            hub.warn(f"group '{group.id}' holds no nodes; {NOTHING_THERE}", place=group.place)
