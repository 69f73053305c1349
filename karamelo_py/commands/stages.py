"""Commands for construction stages."""

import numpy as np

from karamelo_py.commands.thin import refuse_late
from karamelo_py.output.point_table import from_solids, places_before
from karamelo_py.scene.boundary import take_away
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import named
from karamelo_py.script.errors import ScriptError, plural, render_message


def deactivate(hub: Hub, group: ParticleGroup) -> None:
    """Remove points from a scene, for an excavation or for fill that is placed later.

    Parameters
    ----------
    group
        Group of points. These points have no mass, stress or position until they are activated.

    Example
    -------
    group(pit, particles, region, box, all)
    deactivate(pit)

    Notes
    -----
    Use this command before the first run or between runs. Output, groups and fixes then omit the
    points; ids do not change. Between runs, the mass and energy of the points are printed, and the
    energy balance counts their energy as work.

    See Also
    --------
    activate, delete_particles, fix geostatic_stress
    """
    ids = _members(hub, group)
    hub.inactive = np.union1d(hub.inactive, ids)
    if not hub.has_run:
        hub.waiting = np.union1d(hub.waiting, ids)
        hub.forget_simulation()
        return
    if _skipped(hub):
        return
    ids = ids[hub.simulation.present[ids]]
    if not len(ids):
        hub.warn(f"all points of group '{group.id}' are inactive already")
        return
    mass, energy = take_away(hub, ids, hub.mark)
    _say(hub, ids, "deactivated", mass, energy)


def activate(hub: Hub, group: ParticleGroup) -> None:
    """Insert deactivated points into a scene: fill, a lift of a dam, a strut.

    Parameters
    ----------
    group
        Group of points that were deactivated.

    Example
    -------
    group(lift, particles, region, box, all)
    deactivate(lift)
    activate(lift)

    Notes
    -----
    The points enter at their initial positions, at rest, without stress, with their initial mass,
    temperature and state. To give them a stress, define a fix initial_stress or geostatic_stress of
    the group afterwards. If other points are at these positions, a warning is given.

    See Also
    --------
    deactivate, solid, fix initial_stress, fix inflow
    """
    refuse_late(hub)
    ids = np.intersect1d(_members(hub, group), hub.inactive)
    hub.inactive = np.setdiff1d(hub.inactive, ids)
    if not len(ids) and not hub.rehearsing:
        hub.warn(
            f"all points of group '{group.id}' are active already",
            hint=f"deactivate({group.id}) before",
        )
    if not hub.has_run:
        hub.waiting = np.setdiff1d(hub.waiting, ids)
        hub.forget_simulation()
    if not hub.has_run or _skipped(hub) or not len(ids):
        return
    simulation = hub.simulation
    ids = ids[~simulation.present[ids]]
    halves = from_solids(hub, ids, lambda solid, rows: solid.half_size[rows], hub.domain.dimension)
    hit = hub.fields.near(places_before(hub, ids), 0.9 * halves)
    if len(hit):
        hub.warn(
            f"{plural(len(hit), 'point')} are at positions where points of group '{group.id}' "
            f"enter, such as {named(hub, int(hit[0]))}: the mass there doubles",
            hint="deactivate them before, or activate points above them",
        )
    energy = simulation.insert(ids)
    simulation.changed()
    new = ParticleGroup(hub)
    new.take([ids])
    _say(hub, ids, "activated", simulation.points.total("mass", new), energy)


def _members(hub: Hub, group: ParticleGroup) -> np.ndarray:
    ids = group.members
    if not len(ids) and not hub.rehearsing:
        raise ScriptError(
            f"group '{group.id}' has no points", argument="group", expected="a group with points"
        )
    return ids


def _skipped(hub: Hub) -> bool:
    """Return True if the command does nothing: in a rehearsal or resumed script, points differ."""
    return hub.rehearsing or hub.interpreter.replay is not None


def _say(hub: Hub, ids: np.ndarray, done: str, mass: float, energy: float) -> None:
    count = plural(len(ids), "point")
    words = f"{count} {done}, with a mass of {mass:.6g} and an energy of {energy:.6g}"
    hub.console.say(render_message("note", words))
