"""Points at the edge of the domain stop the run, are deleted or are reflected."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from karamelo_py.language import registry
from karamelo_py.language.scene import Scene
from karamelo_py.points.basis import carried
from karamelo_py.scene.solid import named
from karamelo_py.script.errors import Place, ScriptError


def _not_periodic(hub: Scene) -> Iterator[tuple[str, str, Place | None]]:
    """Yield what periodic directions do not support, what to write instead, and the location."""
    update, settings = hub.update, hub.settings
    method = update.method
    name = registry.name_of("method", type(method))
    if name != "ulmpm":
        yield f"method {name}", "method(ulmpm, ...)", method.place
    if method.basis_name not in ("linear", "quadratic-spline", "cubic-spline"):
        yield f"the basis {method.basis_name}", "linear or a spline", method.place
    if hasattr(update.transfer, "order"):
        yield "transfer XPIC", "APIC or FLIP", method.place
    scheme = registry.name_of("scheme", type(update.scheme))
    if scheme != "musl":
        yield f"scheme {scheme}", "scheme(musl)", update.scheme_place
    if method.kinematics(hub).hoops:
        yield f"{method.kinematics(hub).word} scenes", "plane strain, 3D or 1D", None
    if update.thermal:
        yield "heat conduction", "a mechanical method", method.place
    if update.anti_locking:
        yield "anti_volumetric_locking", "quadratic-spline, which locks less", None
    if update.boundary != "error":
        yield f"boundary({update.boundary})", "boundary(error)", update.boundary_place
    for solid in hub.solids.values():
        if solid.material.fluid is not None:
            yield "pore_water", "a dry material", solid.place
    for fix in hub.fixes.values():
        if fix.solids or fix.follows_points or fix.body:
            instead = "walls by fix velocity_nodes"
            yield f"fix {fix.style}, which knows one cell", instead, fix.place
    if settings.comm.size > 1:
        yield "--ranks", "--threads, which divides the points in one process", None
    if settings.engine == "gpu":
        yield "--gpu", "processors, which run the same script", None


def check_periodic(hub: Scene) -> None:
    """Refuse unsupported combinations, all in one message."""
    errors = [
        ScriptError(f"boundary(periodic) does not support {what}", expected=instead, place=place)
        for what, instead, place in _not_periodic(hub)
    ]
    if errors:
        errors[0].others = errors[1:]
        raise errors[0]


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


def delete_leaving(hub: Scene, simulation: Any, repeat: Callable[[], None]) -> bool:
    """Delete points that left the domain in a failed step, whose start `repeat` restores.

    The result depends on the state only, not on threads or on how a run is divided.
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
    """Delete points (ids, ascending); return mass and energy, negative work in the balance."""
    simulation = hub.simulation
    for fix in hub.fixes.values():
        body = fix.body
        if body and ((ids >= body.first_id) & (ids < body.first_id + body.count)).any():
            raise ScriptError(
                f"points of '{body.id}' cannot be deleted: fix '{fix.id}' moves it as a rigid body",
                place=place,
                hint=f"a group without points of '{body.id}', or delete_fix({fix.id})",
            )
    if len(ids) == np.count_nonzero(simulation.present):
        raise ScriptError(
            f"step {simulation.step}, time {simulation.time:.6g}: no point would be left",
            place=place,
            hint="a condition that some points do not meet, or another group",
        )
    return simulation.remove(ids)
