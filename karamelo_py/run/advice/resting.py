"""Runs in which nothing happens, or that hardly end: told before them, where that is certain."""

from math import isfinite
from typing import Any

import numpy as np

from karamelo_py.output.point_table import COMPONENTS, PointTable
from karamelo_py.points.laws import can, constrained_velocity, law_kind
from karamelo_py.run.timestep import fastest_wave, ruling_limit
from karamelo_py.scene.hub import Hub

LOOK = 100  # steps: shorter runs look at a scene
ENDLESS = 1e8  # steps
REST = "a scene at rest"
UNITS = (
    "in m, kg, s water has the density 1000, steel the modulus 2e11; in mm, t, s 1e-9 and 2e5 (MPa)"
)


def warn_about_rest(hub: Hub, simulation: Any, duration: float) -> None:
    """Say so, once, where nothing can move in a run of `duration`."""
    if duration >= LOOK * simulation.dt and _rests(hub, simulation) and hub.update.first_time(REST):
        hub.warn(
            "nothing moves in this run: no point has a velocity or a stress, and no fix a load",
            hint="fix(ID, initial_velocity_particles, ...), fix(ID, body_force, ...) or another "
            "load, in front of it",
        )


def _rests(hub: Hub, simulation: Any) -> bool:
    """Tell whether nothing can move, by the parts of this program: others may do anything."""
    laws = [solid.material.law for solid in hub.solids.values()]
    update = hub.update
    parts = [type(p) for p in (update.method, update.method.basis, update.transfer, update.scheme)]
    parts += [kind for law in laws for kind in law_kind(law)]
    own = all(kind.__module__.startswith("karamelo_py.") for kind in parts)
    acting = any((fix.hooks() and not _zero(fix)) or fix.for_method for fix in hub.fixes.values())
    if acting or not own or update.thermal or any(can(law, constrained_velocity) for law in laws):
        return False
    return simulation.fastest() == 0 and simulation.largest(_stress)[0] == 0


def _zero(fix: Any) -> bool:
    """Tell whether a fix holds what it acts on at zero: walls, loads that are none."""
    formulas = getattr(fix, "formulas", ())
    return bool(formulas) and all(
        formula is None or (formula.is_constant and formula.constant == 0) for formula in formulas
    )


def _stress(points: PointTable) -> np.ndarray:
    return np.max([np.abs(points.particle("s" + c)) for c in COMPONENTS], axis=0)


def warn_about_length(hub: Hub, simulation: Any, end_time: float) -> None:
    """Say so where a run to `end_time` takes more steps than anybody waits for."""
    span = end_time - simulation.time
    if not (isfinite(span) and span > ENDLESS * simulation.dt > 0):
        return
    about = f"about {span / simulation.dt:.2g} steps of {simulation.dt:.3g} from here to time"
    if hub.update.fixed_dt is not None:
        hub.warn(f"{about} {end_time:.6g}", hint="a larger step with set_dt, or an earlier end")
        return
    if ruling_limit(simulation) == "conduction":
        hub.warn(
            f"{about} {end_time:.6g}: heat goes through cells of {hub.domain.h:g} that fast. The "
            "units of conductivities, heat capacities, lengths and times may be mixed",
            hint="an earlier end, or larger cells; in m, kg, s, K copper has kappa = 401, cp = 385",
        )
        return
    hub.warn(f"{about} {end_time:.6g}: {mixed_units(hub, simulation)}", hint=UNITS)


def mixed_units(hub: Hub, simulation: Any) -> str:
    """Doubt the units where a step does not fit the numbers of a scene by any means."""
    return (
        f"waves move at {fastest_wave(simulation):.3g} through cells of {hub.domain.h:g}. The "
        "units of densities, moduli, lengths and times may be mixed"
    )
