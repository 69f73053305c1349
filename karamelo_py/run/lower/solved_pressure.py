"""Scenes that schemes with an implicit pore pressure do not support."""

from collections.abc import Iterator

from karamelo_py.language import registry
from karamelo_py.run.lower.hooks import is_wet
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


def check(hub: Hub) -> None:
    """Raise one ScriptError with all reasons, if there are any."""
    update = hub.update
    name = f"scheme {registry.name_of('scheme', type(update.scheme))}"
    errors = [*unsupported(hub, name)]
    if not is_wet(hub):
        error = ScriptError(
            f"{name} solves for the pressure of pore water, and no solid has any",
            mark=update.scheme_mark,
            expected="pore_water(material, ...) before the solid, or scheme(musl)",
        )
        errors.insert(0, error)
    for error in errors:
        error.others = errors[1:]
        raise error


def unsupported(hub: Hub, name: str) -> Iterator[ScriptError]:
    """Yield an error for each fix that a scheme, called `name`, does not support."""
    for fix in hub.fixes.values():
        prescribes = fix.prescribes_velocity or fix.first_step_only
        if "post_update_grid_state" in fix.hooks() and not prescribes:
            yield ScriptError(
                f"{name} does not support fix {fix.style}, which changes velocities after the "
                "pressure is solved for",
                mark=fix.mark,
                expected="fix velocity_nodes, loads such as mass_damping, or scheme(musl)",
            )
        elif fix.leads_points:
            yield ScriptError(
                f"{name} does not support fix {fix.style} on points that deform",
                mark=fix.mark,
                expected="fix velocity_nodes, or scheme(musl)",
            )
