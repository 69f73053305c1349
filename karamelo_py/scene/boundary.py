"""Points at the edge of the domain stop the run, are deleted or are reflected."""

from typing import Any

import numpy as np

from karamelo_py.language import registry
from karamelo_py.language.scene import Scene
from karamelo_py.points.basis import carried
from karamelo_py.scene.solid import named
from karamelo_py.script.errors import Place, ScriptError


def check(hub: Scene) -> None:
    update = hub.update
    if not update.method.frame.moves:
        name = registry.name_of("method", type(update.method))
        raise ScriptError(
            f"boundary({update.boundary}) has no meaning here: the grids of {name} belong to "
            "the solids and go with them, so that no point can leave one",
            place=update.boundary_place,
            hint="fix(ID, contact/surface, all, region) makes walls here; or method(ulmpm, ...)",
        )
    carries = carried(update.method.basis, update.method.kinematics(hub)) > 0
    if update.boundary == "reflect" and carries:
        raise ScriptError(
            f"boundary(reflect) cannot mirror {type(update.method.basis).__name__} domains, "
            "whose corners go with the grid",
            place=update.boundary_place,
            hint="boundary(delete), or domains that do not carry corners, such as R4 and R8",
        )


def delete_leaving(hub: Scene, simulation: Any, snapshot: dict) -> bool:
    """Delete points that left the domain in a failed step, and restore its start.

    Depends on the state only, not on threads or on how a run is divided.
    """
    if hub.update.boundary != "delete":
        return False
    gone = simulation.leaving()
    if not len(gone):
        return False
    step, none_before = simulation.step, simulation.present.all()
    simulation.restore(snapshot)
    if step > simulation.step:
        simulation.advance(step - simulation.step)
    simulation.remove(gone)
    if none_before:
        hub.warn(
            f"step {step + 1}, time {simulation.time:.6g}: {named(hub, gone[0])} "
            "leaves the domain and is deleted; more are only counted",
            place=hub.update.boundary_place,
        )
    if not simulation.present.any():
        raise ScriptError(
            f"step {step + 1}, time {simulation.time:.6g}: all points have left the domain",
            place=hub.update.boundary_place,
            hint="a shorter run, or a larger domain",
        )
    return True


def take_away(hub: Scene, ids: np.ndarray, place: Place | None) -> tuple[float, float]:
    """Delete points (ids, ascending); mass and energy, negative work in the balance."""
    simulation = hub.simulation
    if len(ids) == np.count_nonzero(simulation.present):
        raise ScriptError(
            f"step {simulation.step}, time {simulation.time:.6g}: no point would be left",
            place=place,
            hint="a condition that some points do not meet, or another group",
        )
    return simulation.remove(ids)
