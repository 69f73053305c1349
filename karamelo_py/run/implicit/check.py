"""Scenes that implicit schemes do not support."""

import importlib.util
from collections.abc import Iterator

from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.fields import declared
from karamelo_py.compiler.slopes import NoSlope
from karamelo_py.kernels.arrays import Tag
from karamelo_py.kernels.implicit import IncrementAt, stress_and_tangent
from karamelo_py.language import registry
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.laws import initial_state
from karamelo_py.points.laws.strengths.mu_i import yields_early_with_fbar
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.styles.methods.base import takes_average

# Hooks of plug-ins may be called several times per step.
_MOMENTS = "initial_integrate", "post_particles_to_grid", "post_update_grid_state"
_OF_HEAT = "post_heat_to_grid", "supply_heat", "post_update_grid_heat"
_OF_ROTATION = "post_update_grid_rotation", "post_rotation_to_grid"
_OF_PLUGINS = _MOMENTS[1:]
RELAXED = 1e30  # a duration after which viscosity sustains no stress
_EXPLICIT = "an explicit scheme, scheme(musl)"


def _reasons(hub: Hub) -> Iterator[tuple[str, str, Mark | None]]:
    update = hub.update
    method = update.method
    if update.thermal and any(solid.rigid for solid in hub.solids.values()):
        yield "cannot conduct heat with rigid solids", f"mechanical, or {_EXPLICIT}", None
    if update.thermal and method.fields_per_solid:
        yield "cannot conduct heat with contact", f"mechanical, or {_EXPLICIT}", method.mark
    if update.scheme.solver == "amg" and any(s.material.fluid for s in hub.solids.values()):
        yield "supports water in pores only with a direct solver", "solver=direct, or auto", None
    if method.fields_per_solid and declared([update.scheme], "point_fields"):
        yield "does not support rho with contact", "beta and gamma, or rule=euler", None
    yield from _of_bodies(hub)
    kin = method.kinematics(hub)
    if method.fields_per_solid and isinstance(kin, Twisted):
        yield "does not support contact with friction and twist=true", _EXPLICIT, method.mark
    for solid in hub.solids.values():
        law = solid.material.law
        if solid.rigid:
            continue
        # With F-bar, some laws yield too early in load steps.
        averaged = update.anti_locking and takes_average(law)
        if averaged and yields_early_with_fbar(law.strength):
            yield (
                f"makes '{solid.id}' too weak: with averaged pressure (F-bar) in its yield "
                "surface, the passive pressure of sand was 1.8 instead of 3",
                "anti_volumetric_locking(false), a dilatancy of 1/3 of the friction, or "
                f"{_EXPLICIT}",
                solid.mark,
            )
        try:
            bears = _bears_shear(law, kin)
        except NoSlope as function:
            yield (
                f"cannot differentiate {function}, which the law of '{solid.id}' calls",
                f"another function in the law, or {_EXPLICIT}",
                solid.mark,
            )
            continue
        if not bears and not update.scheme.traits.inertia:
            yield (
                f"finds no equilibrium of '{solid.id}': a gas or fluid carries no shear",
                f"scheme(newmark), or {_EXPLICIT}",
                solid.mark,
            )
    for fix in hub.fixes.values():
        ours = registry.origin("fix", fix.style).startswith("karamelo-py ")
        built_in = ours and fix.style != "python"
        other = [
            hook
            for hook in fix.hooks()
            if hook not in (_MOMENTS + _OF_HEAT + _OF_ROTATION if built_in else _OF_PLUGINS)
        ]
        prescribes = fix.prescribes_velocity or fix.first_step_only
        if prescribes:
            other = [hook for hook in other if hook != "post_velocities_to_grid"]
        if fix.of_rigid_points:
            other = [hook for hook in other if hook != "post_advance_particles"]
        only_prescribes = prescribes and fix.wall_friction is None
        if "post_update_grid_state" in fix.hooks() and not only_prescribes:
            yield (
                f"does not support fix {fix.style} whose changes depend on the velocities",
                f"fix velocity_nodes without leq, geq and friction, or {_EXPLICIT}",
                fix.mark,
            )
        elif other:
            yield (
                f"does not support fix {fix.style}, which acts at a stage that only explicit "
                "steps have" + ("" if built_in else f": {other[0]}"),
                "fix velocity_nodes, or loads: force_particles, edge_traction; velocity_particles "
                "for rigid solids",
                fix.mark,
            )
        elif (
            not update.scheme.traits.inertia
            and fix.style.startswith("initial_velocity")
            and not fix.of_rigid_points
        ):
            yield (
                f"has no inertia: the velocities of fix {fix.style} would have no effect",
                "scheme(newmark)",
                fix.mark,
            )
        elif len(fix.solids) > 1 and fix.friction is None:
            yield (
                f"does not support fix {fix.style}, which computes its force once per step, "
                "before the points move",
                f"method ulmpm/contacts, or {_EXPLICIT}",
                fix.mark,
            )
        elif fix.follows_points and fix.impulsive:
            yield (
                f"does not support fix {fix.style}, whose force stops points within a step",
                "fix impenetrablesurface or indent, or a solid of material rigid in method "
                f"ulmpm/contacts; or {_EXPLICIT}",
                fix.mark,
            )


def _of_bodies(hub: Hub) -> Iterator[tuple[str, str, Mark | None]]:
    update = hub.update
    fixes = [fix for fix in hub.fixes.values() if fix.of_bodies]
    for fix in fixes:
        if update.scheme.traits.inertia or fix.links:
            yield f"does not support fix {fix.style}", _EXPLICIT, fix.mark
        elif not update.method.fields_per_solid:
            instead = f"method(ulmpm/contacts, ...), or {_EXPLICIT}"
            yield f"supports fix {fix.style} only in ulmpm/contacts", instead, update.method.mark
    if fixes and update.scheme.solver == "amg":
        yield "supports rigid bodies only with a direct solver", "solver=direct, or auto", None


def _bears_shear(law: Tag, kin: Tag) -> bool:
    places = kin.Tensor.places
    rest = kin.Tensor._make([0.0] * len(places))
    state = initial_state(law, kin, 1.0)
    _, C = on_numbers(stress_and_tangent)(law, kin, state, IncrementAt(rest, 1.0), RELAXED)
    if kin.dimension == 1:
        return True
    shear = places.index((0, 1))
    return abs(C[shear][shear]) > 1e-12 * abs(C[0][0])


def check(hub: Hub) -> None:
    update = hub.update
    name = f"scheme {registry.name_of('scheme', type(update.scheme))}"
    if importlib.util.find_spec("scipy") is None:
        raise ScriptError(
            f"{name} needs SciPy",
            mark=update.scheme_mark,
            hint="pip install '.[implicit]' in the folder of karamelo-py",
        )
    if update.scheme.solver == "amg" and importlib.util.find_spec("pyamg") is None:
        raise ScriptError(
            "solver=amg needs PyAMG",
            mark=update.scheme_mark,
            hint="pip install '.[implicit]' in the folder of karamelo-py, or solver=direct",
        )
    for reason, instead, mark in _reasons(hub):
        raise ScriptError(f"{name} {reason}", mark=mark or update.scheme_mark, expected=instead)
    if update.scheme.traits.inertia and not update.fixed_dt:
        raise ScriptError(
            f"{name} has no default step",
            mark=update.scheme_mark,
            hint="set_dt(...): with twenty steps per vibration the period is right within 1 %",
        )
