"""Commands for thin bodies: plane_stress, uniaxial_stress."""

from typing import Annotated

from karamelo_py.language import registry
from karamelo_py.language.signature import Positive
from karamelo_py.points.laws import is_rigid, is_round, law_parts, law_traits, parameter
from karamelo_py.points.laws.across import Across
from karamelo_py.points.laws.thin import Thin
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.script.errors import ScriptError, plural


def plane_stress(hub: Hub, active: bool, *, thickness: Annotated[float, Positive] = 1.0) -> None:
    """Treat a 2D scene as a thin plate without stress through its thickness.

    Parameters
    ----------
    active
        ``true``, or ``false`` for plane strain (the default).
    thickness
        Initial thickness of the plate.

    Example
    -------
    dimension(2, 0, 10, 0, 30, 0.5)
    plane_stress(true, thickness=0.2)

    Notes
    -----
    Use this command before the first material. Each law finds the strain across the plate for which
    szz vanishes. The column ``thickness`` is the present thickness divided by the initial one;
    ``stress_left`` is the largest remaining szz of any step divided by the largest stress: a run
    warns above 2 %. Masses, forces and energies refer to the whole thickness.

    Liquids, gases and loose grains are refused, since they have no strength unless confined, and
    anti_volumetric_locking, since plane stress does not lock. With a thickness other than 1, fixes
    that use sizes of points (contact between points and with surfaces, fluxes through faces of
    points) are refused, too.

    See Also
    --------
    uniaxial_stress, axisymmetric, material
    """
    _set(hub, active, "plane_stress", 2, thickness)


def uniaxial_stress(hub: Hub, active: bool, *, area: Annotated[float, Positive] = 1.0) -> None:
    """Treat a 1D scene as a bar without lateral stress.

    Parameters
    ----------
    active
        ``true``, or ``false`` for uniaxial strain (the default).
    area
        Initial cross-section of the bar.

    Example
    -------
    dimension(1, 0, 10, 0.5)
    uniaxial_stress(true, area=1e-4)

    Notes
    -----
    Use this command before the first material. Each law finds the lateral strain, equal in y and z,
    for which the lateral stress vanishes. The column ``thickness`` is the lateral stretch. Masses,
    forces and energies refer to the whole cross-section. Materials and fixes that plane_stress
    refuses, and orthotropic materials that differ in y and z, are refused.

    See Also
    --------
    plane_stress, dimension
    """
    _set(hub, active, "uniaxial_stress", 1, area)


def _set(hub: Hub, active: bool, command: str, dimension: int, thickness: float) -> None:
    domain = hub.require_domain()
    if domain.dimension != dimension:
        message = f"the scene has {plural(domain.dimension, 'dimension')}, not {dimension}"
        expected = f"dimension({dimension}, ...) before {command}(true)"
        hint = {1: "uniaxial_stress(true)", 2: "plane_stress(true)"}.get(domain.dimension)
        raise ScriptError(message, argument="active", expected=expected, hint=hint)
    refuse_across(domain, active)
    if not active and thickness != 1:
        name = "thickness" if dimension == 2 else "area"
        message = f"{command}(false) does not use {name}={thickness:g}"
        raise ScriptError(message, argument=name, expected=f"{command}(true, ...), or no {name}")
    if active and domain.thin and thickness != domain.thickness:
        message = f"{command} is already set, with {domain.thickness:g} across the body"
        raise ScriptError(message, argument="active", expected=f"one {command}(true, ...)")
    if active and domain.kin.hoops:
        message = f"the scene is {domain.kin.word}, which has hoop stress"
        raise ScriptError(message, argument="active", expected=f"{domain.kin.word}(false)")
    if hub.materials and active != domain.thin:
        first = next(iter(hub.materials))
        message = f"material '{first}' is defined already"
        expected = f"{command}({'true' if active else 'false'}) before the first material"
        raise ScriptError(message, argument="active", expected=expected, code="too-late")
    if hub.solids:
        message = "the points of solids already have masses"
        expected = f"{command} before the first solid"
        raise ScriptError(message, argument="active", expected=expected, code="too-late")
    domain.thin, domain.thickness = active, float(thickness) if active else 1.0


def refuse_uneven(hub: Hub, material: Material, argument: str) -> None:
    if hub.domain is None or hub.domain.kin.hoops < 2 or is_round(material.whole):
        return
    raise ScriptError(
        "the material is not the same in y and z, so that a sphere of it would not stay round",
        argument=argument,
        expected="cylindrical(true), or a material with equal axes y and z",
    )


def refuse_flattening(material: Material, argument: str, instead: str) -> None:
    if not is_round(material.whole):
        raise ScriptError(
            "the material is not the same in y and z, so that a bar of it would bend or flatten",
            argument=argument,
            expected=f"{instead}, or a material with equal axes y and z",
        )


def refuse_across(domain: Domain, active: bool) -> None:
    if active and domain.across is not None:
        message = f"plane_strain prescribes the strain across (line {domain.across.mark.line})"
        raise ScriptError(message, argument="active", expected="one of the two")


def refuse_late(hub: Hub) -> None:
    if hub.domain is not None and hub.domain.across is not None and hub.has_run:
        message = "points that enter after a run would get all of ezz of plane_strain at once"
        raise ScriptError(message, expected="all points before the first run", code="too-late")


def _name_of(law: object) -> str:
    """Return the family and style of a law or of its part, such as 'eos ideal-gas'."""
    kind, families = type(law), ("eos", "strength", "material")
    named = ((family, registry.name_of(family, kind)) for family in families)
    return next((f"{a} {name}" for a, name in named if registry.knows(a, name)), kind.__name__)


def fit_to_domain(hub: Hub, material: Material) -> None:
    refuse_uneven(hub, material, "style")
    if hub.domain is None or is_rigid(material.whole):
        return
    if hub.domain.across is not None:
        material.flat = Across
    if not hub.domain.thin:
        return
    for law in law_parts(material.whole):
        traits = law_traits(law)
        if traits.fluid or (traits.flows and not parameter(law, "cohesion") > 0):
            name = _name_of(law)
            raise ScriptError(
                f"{name} is for fluids or loose grains, which have no strength without stress "
                f"across the body ({'plane' if hub.domain.dimension == 2 else 'uniaxial'} stress)",
                argument="style",
                expected="a solid that sustains tension, or plane strain",
            )
    if hub.domain.dimension == 1:
        refuse_flattening(material, "style", "plane_stress in 2D")
    material.flat = Thin
