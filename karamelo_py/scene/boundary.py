"""Reflection, deletion and periodic return of points at the edge of the domain."""

from collections.abc import Callable
from typing import Any

import numpy as np

from karamelo_py.language.rules import FLAT, HATS_AND_SPLINES, Restrictions
from karamelo_py.language.scene import Scene
from karamelo_py.scene.modify import moved
from karamelo_py.scene.solid import named
from karamelo_py.script.errors import Mark, ScriptError

PERIODIC = Restrictions(
    "periodic", "no boundary(periodic)",
    only={"method": ("ulmpm",), "scheme": ("musl",), "basis": HATS_AND_SPLINES, "kinematics": FLAT},
    without=("heat", "series", "delete", "reflect", "ranks", "gpu", "rigid_body"),
    but={"ending tools": "a plane, or a region without ends in periodic directions: "
         "region(ground, block, -INF, INF, -INF, 0)"},
)  # fmt: skip
SHEARED = Restrictions(
    "sheared", "boundary(periodic) without shear", without=("pore_water",),
    but={"F-bar": "quadratic-spline, which locks less"},
)  # fmt: skip
WALLS = {
    "grids of solids": "method(ulmpm, ...), or walls by fix(ID, contact/surface, all, region): no "
    "point can leave the grid of its solid, which moves with it"
}
CORNERS = "boundary(delete), or R4 and R8, whose domains do not carry corners with the grid"
RESTRICTIONS = {
    "delete": Restrictions("delete", "boundary(error)", but=WALLS),
    "reflect": Restrictions("reflect", "boundary(error)", but={**WALLS, "corners": CORNERS}),
}


def delete_leaving(hub: Scene, simulation: Any, repeat: Callable[[], None]) -> bool:
    """Undo a step in which points left the domain, and delete them; return True if there are any.

    `repeat` restores the state before the step. The result does not depend on the number of
    threads, nor on how a simulation is divided into runs.
    """
    if hub.update.boundary != "delete":
        return False
    gone = simulation.leaving()
    if not len(gone):
        return False
    step, none_before = simulation.step, simulation.present.all()
    repeat()
    simulation.remove(gone)
    if none_before:
        hub.warn(
            f"step {step + 1}, time {simulation.time:.6g}: {named(hub, gone[0])} "
            "leaves the domain and is deleted; later ones are only counted",
            mark=hub.update.boundary_mark,
        )
    if not simulation.present.any():
        raise ScriptError(
            f"step {step + 1}, time {simulation.time:.6g}: all points have left the domain",
            mark=hub.update.boundary_mark,
            hint="a shorter run, or a larger domain",
        )
    return True


def take_away(hub: Scene, ids: np.ndarray, mark: Mark | None) -> tuple[float, float]:
    """Delete points with ascending `ids`; return their mass and energy (negative work)."""
    simulation = hub.simulation
    for body, fix in moved(hub).items():
        if np.any((ids >= body.first_id) & (ids < body.first_id + body.count)):
            raise ScriptError(
                f"points of '{body.id}' cannot be deleted: fix '{fix.id}' moves it as a rigid body",
                mark=mark,
                hint=f"a group without points of '{body.id}', or delete_fix({fix.id})",
            )
    if len(ids) == np.count_nonzero(simulation.present):
        raise ScriptError(
            f"step {simulation.step}, time {simulation.time:.6g}: no point would be left",
            mark=mark,
            hint="a condition that some points do not meet, or another group",
        )
    return simulation.remove(ids)
