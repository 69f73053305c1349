"""Scenes that a scheme with a solution for the pore pressure does not support."""

from collections.abc import Iterator

from karamelo_py.language import registry
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


def check(hub: Hub) -> None:
    """Raise ScriptError with all reasons, if there are any."""
    errors = [*_errors(hub)]
    for error in errors:
        error.others = errors[1:]
        raise error


def _errors(hub: Hub) -> Iterator[ScriptError]:
    update = hub.update
    name = registry.name_of("scheme", type(update.scheme))
    if not any(solid.material.fluid is not None for solid in hub.solids.values()):
        yield ScriptError(
            f"scheme {name} solves for the pressure of pore water, and no solid has any",
            mark=update.scheme_mark,
            expected="pore_water(material, ...) before the solid, or scheme(musl)",
        )
    for fix in hub.fixes.values():
        prescribes = fix.prescribes_velocity or fix.first_step_only
        if "post_update_grid_state" in fix.hooks() and not prescribes:
            yield ScriptError(
                f"scheme {name} does not support fix {fix.style}, which changes velocities after "
                "the pressure is solved for",
                mark=fix.mark,
                expected="fix velocity_nodes, loads such as mass_damping, or scheme(musl)",
            )
        elif fix.leads_points:
            yield ScriptError(
                f"scheme {name} does not support fix {fix.style} on points that deform",
                mark=fix.mark,
                expected="fix velocity_nodes, or scheme(musl)",
            )
