"""Commands for materials and their parts; element."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

from karamelo_py.commands.thin import fit_to_domain, refuse_flattening
from karamelo_py.language import registry
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument, Positive, style_of
from karamelo_py.language.unknown import longer
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space
from karamelo_py.points.laws import can, constrained_velocity, law_parts, law_traits
from karamelo_py.points.laws.doubts import doubts
from karamelo_py.points.laws.placed import place_of
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.points.laws.thin import ThinInLargeIncrements
from karamelo_py.run.element import COMPONENTS, NORMAL, LoadPath, Point, Response, Unreachable
from karamelo_py.run.lower.check_plugins import try_law
from karamelo_py.scene.hub import Catalogue, Hub
from karamelo_py.scene.material import Material, MaterialPart
from karamelo_py.scene.plugins import attributed, check_law
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.parser import parse_text


def material(
    hub: Hub, ID: str, style: Annotated[str, StyleOf("material")], *arguments: Argument
) -> None:
    """Define a material.

    Parameters
    ----------
    style
        The constitutive law.

    Example
    -------
    material(mat1, linear, 1000, 1000, 0.3)

    See Also
    --------
    solid
    """
    if style in hub.parts["eos"] and arguments and not registry.knows("material", style):
        # In scripts of 2020, there is no style: material(ID, eosID, strengthID).
        arguments = (Argument(parse_text(style)[0], hub.interpreter), *arguments)
        style = "eos-strength"
    define(hub, hub.materials, ID, style, arguments)
    judge(hub, hub.materials[ID])


def judge(hub: Hub, made: Material) -> None:
    try_law(hub, made)
    with attributed(hub):
        for doubt, hint in doubts(made.whole):
            hub.warn(f"material '{made.id}': {doubt}", hint=hint)


def _part(kind: str, summary: str, example: str, others: str) -> Callable:
    def command(
        hub: Hub, ID: str, style: Annotated[str, StyleOf(kind)], *arguments: Argument
    ) -> None:
        if (kind, style) == ("strength", "JC") and not registry.knows(kind, style):
            message = "unknown strength style 'JC'"
            expected = "the style johnson_cook, with G, A, B, n, epsdot0, C, m, Tr, Tm"
            hint = longer("strength johnson_cook", arguments)
            raise ScriptError(message, argument="style", expected=expected, hint=hint)
        define(hub, hub.parts[kind], ID, style, arguments)

    command.__doc__ = f"""{summary}

    Parameters
    ----------
    style
        The law.

    Example
    -------
    {example}

    See Also
    --------
    {others}, material, material eos-strength
    """
    return command


eos = _part(
    "eos",
    "Define an equation of state: the pressure of a material, and its density.",
    "eos(bulk, linear, 7850, 160e9)",
    "strength",
)
strength = _part(
    "strength",
    "Define a strength: the deviatoric stress of a material.",
    "strength(mild, plastic, 80e9, 400e6)",
    "eos, damage, temperature",
)
damage = _part(
    "damage",
    "Define a damage: how a material loses its strength.",
    "damage(ductile, damage_johnson_cook, 0.54, 4.89, -3.03, 0.014, 1.12, 1, 298, 1356)",
    "strength, temperature",
)
temperature = _part(
    "temperature",
    "Define a temperature: how a material heats, and how temperature changes its pressure.",
    "temperature(warm, plastic_work, 0.9, 385, 0, 0, 298, 1356)",
    "strength, damage",
)


def define(hub: Hub, catalogue: Catalogue, ID: str, style: str, arguments: Sequence[Argument]):
    kind = catalogue.kind
    catalogue.refuse(ID)
    values: dict = {}
    made = style_of(hub, kind, ID, style, arguments, values=values)
    entry = (Material if kind == "material" else MaterialPart)(kind, style, made, values)
    if isinstance(entry, Material):
        fit_to_domain(hub, entry)
    check_law(hub, f"{kind} {style}", entry.law)
    catalogue.add(ID, entry)


KINEMATICS = {kin.word: kin for kin in (Space(), PlaneStrain(), Axisymmetric(), Line())}


def load_path(
    hub: Hub, ID: str, increments: Annotated[int, Positive], *,
    exx: float | None = None, eyy: float | None = None, ezz: float | None = None,
    exy: float | None = None, exz: float | None = None, eyz: float | None = None,
    gxy: float | None = None, gxz: float | None = None, gyz: float | None = None,
    sxx: float | None = None, syy: float | None = None, szz: float | None = None,
    sxy: float | None = None, sxz: float | None = None, syz: float | None = None,
    volumetric: float | None = None, turn: float = 0.0,
    duration: Annotated[float, Positive] | None = None,
) -> None:  # fmt: skip
    """Define one segment of a load path by its final strains or stresses.

    The current state changes to the final values in equal increments. Strain components that are
    not named stay constant.

    Parameters
    ----------
    increments
        Number of increments.
    exx, eyy, ezz, exy, exz, eyz
        Strain, summed over the increments: ln(length/initial length) for many increments. Shear
        strains are tensor components, half the shear angle.
    gxy, gxz, gyz
        Angle of simple shear, twice the tensor strain: gxy, a displacement in x that grows with y,
        rotates the point by gxy/2; exy does not.
    sxx, syy, szz, sxy, sxz, syz
        Prescribed Cauchy stress, tension positive; the strain is found by iteration.
    volumetric
        Volumetric strain exx + eyy + ezz. Unspecified normal strains are equal to each other.
    turn
        Angle in radians by which the point rotates about z, in fixed axes.
    duration
        Duration, for rate-dependent laws; default 1. Without strains and stresses, a hold time.

    Example
    -------
    load_path(pull, 100, exx=0.01, syy=0, szz=0)
    load_path(release, 100, sxx=0, syy=0, szz=0)
    load_path(confine, 50, sxx=-1e5, syy=-1e5, szz=-1e5)
    load_path(squeeze, 200, exx=-0.05, syy=-1e5, szz=-1e5)
    load_path(undrained, 200, exx=-0.05, volumetric=0)
    load_path(shear, 100, gxy=0.2)
    load_path(quarter, 1000, turn=PI/2)

    See Also
    --------
    element
    """
    strains = dict(zip(COMPONENTS, (exx, eyy, ezz, exy, exz, eyz), strict=True))
    stresses = dict(zip(COMPONENTS, (sxx, syy, szz, sxy, sxz, syz), strict=True))
    angles = {"xy": gxy, "xz": gxz, "yz": gyz}
    shear = {name: value for name, value in angles.items() if value is not None}
    for name, angle in shear.items():
        if strains[name] is not None:
            message = f"g{name} and e{name} are the same strain, with and without rotation"
            raise ScriptError(message, argument=f"g{name}", expected="one of them")
        strains[name] = angle / 2
    prescribed = *strains.values(), *stresses.values(), volumetric, duration
    if not turn and all(value is None for value in prescribed):
        raise ScriptError(
            "no strain and no stress is prescribed: nothing would change",
            expected="exx=..., sxx=..., gxy=..., volumetric=... or turn=...; duration=... to hold",
        )
    path = LoadPath(
        increments=increments,
        duration=1.0 if duration is None else duration,
        strain={name: value for name, value in strains.items() if value is not None},
        stress={name: value for name, value in stresses.items() if value is not None},
        shear=[*shear],
        volumetric=volumetric,
        turn=turn,
    )
    hub.load_paths.add(ID, path)


load_path.syntax = (
    "ID, increments[, exx=..., sxx=..., gxy=..., volumetric=..., turn=..., duration=...]"
)


def element(
    hub: Hub,
    ID: str,
    material: Material,
    first: LoadPath,
    *more: LoadPath,
    kinematics: Literal[
        "3D", "plane-strain", "plane-stress", "axisymmetric", "1D", "uniaxial-stress"
    ] = "3D",
    tangent: bool = False,
    T: float | None = None,
) -> None:
    """Take one point of a material along a load path, to check its law before a run.

    The command writes the table element_ID.txt and the plot element_ID.png. The test needs no
    domain and no compilation. The point begins stress-free; cam-clay begins at its pressure p0.

    Parameters
    ----------
    ID
        Name of the test, used in file names.
    material
        ID of a material.
    first, more
        Load paths in order; they may be repeated.
    kinematics
        Possible strains: ``3D``; ``plane-strain`` (none out of the plane xy); ``plane-stress`` (no
        stress szz); ``axisymmetric`` (x the radius, y the axis, z around it); ``1D`` (exx only);
        ``uniaxial-stress`` (stress sxx only).
    tangent
        Print derivatives of the Cauchy stress with respect to the strains and shear angles (twice
        the tensor strains) of the last increment.
    T
        Temperature at the start.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.3)
    load_path(pull, 100, exx=0.5, syy=0, szz=0)
    load_path(release, 100, sxx=0, syy=0, szz=0)
    element(tension, rubber, pull, release)
    element(soft, rubber, pull, tangent=true)

    Notes
    -----
    The table has the format of the log, with a row per increment: time; strain exx ...; Cauchy
    stress sxx ...; pressure p and von Mises stress q; J = det F; stored energy and stress work per
    reference volume; columns of the law, such as the equivalent plastic strain ep. The last row is
    published as ID_exx, ID_sxx and so on.

    As in a run, each increment passes dt grad v to the law, so n uniaxial increments e give det F =
    (1 + e)^n. For a rotation, dt grad v is skew to first order, and its second-order part is chosen
    such that the least energy is stored. Strains for prescribed stresses are found by Newton's
    method with the exact tangent. An increment that does not converge is halved, up to eight times;
    if that fails, the files show the increments before it.

    See Also
    --------
    load_path, material
    """
    hub.elements.refuse_unnameable(ID)
    if can(material.law, constrained_velocity):
        message = f"material '{material.id}' is rigid: it has no strain and no stress"
        raise ScriptError(message, argument="material", expected="a material that deforms")
    if place_of(material.whole):
        message = f"the directions of material '{material.id}' differ from point to point"
        raise ScriptError(message, argument="material", expected="directions given by numbers")
    if T is not None and not can(material.whole, initial_heat):
        message = f"material '{material.id}' has no temperature"
        raise ScriptError(message, argument="T", expected="a material with cp, or leave out T")
    if T is None and any(law_traits(one).by_temperature for one in law_parts(material.whole)):
        hint = f"element({ID}, ..., T=293)"
        hub.warn("the point starts at the temperature 0, which shifts its relaxation", hint=hint)
    law, kin = material.filled, KINEMATICS.get(kinematics)
    if kinematics == "uniaxial-stress":
        refuse_flattening(material, "kinematics", "3D with syy=0 and szz=0")
    if kin is None:
        law = ThinInLargeIncrements(material.whole)
        kin = PlaneStrain() if kinematics == "plane-stress" else Line()
    point = Point(law, kin, T)
    paths = (first, *more)
    for number, path in enumerate(paths):
        _check_components(path, point, kinematics, number)
    response = Response(point)
    table, picture = (Path(f"element_{ID}.{ending}") for ending in ("txt", "png"))
    for file in (table, picture):
        hub.output.check_file(file)
    hub.elements.add(ID, response)
    hub.values.publish_vector(ID, response.names)
    if hub.rehearsing:
        return
    hub.rehearse()
    title = f"element {ID}: {material.words}, {kinematics}"
    try:
        with attributed(hub):
            _follow(point, paths, response)
    finally:
        for name, value in response.last().items():
            hub.values.set(f"{ID}_{name}", value)
        # The increments before an error show where the law fails.
        if not hub.checking:
            response.write(hub.folder / table)
            response.draw(hub.folder / picture, title)
    files = "" if hub.checking else f": {table}, {picture}"
    hub.console.say(f"{title}, {len(response.rows) - 1} increments{files}")
    if tangent:
        names = [f"e{name}" if name in NORMAL else f"g{name}" for name in point.free]
        lines = [" " * 4 + "".join(f"{name:>14}" for name in names)]
        for name, row in zip(COMPONENTS, point.tangent(), strict=False):
            lines.append(f"s{name:<3}" + "".join(f"{x + 0.0:14.6g}" for x in row))
        hub.console.say("\n".join(lines))


def _follow(point: Point, paths: tuple[LoadPath, ...], response: Response) -> None:
    for number, path in enumerate(paths):
        try:
            point.follow(path, response.observe)
        except Unreachable as error:
            stresses = zip(COMPONENTS, point.stress, strict=True)
            reached = ", ".join(f"s{n} = {s:.6g}" for n, s in stresses if n in path.stress)
            raise ScriptError(
                f"load path '{path.id}' (number {number + 1}), {error}"
                + (f"; the last increment ended at {reached}" if reached else ""),
                argument=2 + number,
                hint="smaller stresses, or strains instead" if path.stress
                else "more increments",
            ) from None  # fmt: skip


def _check_components(path: LoadPath, point: Point, kinematics: str, number: int) -> None:
    subject, argument = f"load path '{path.id}'", 2 + number
    for kind, names in (("e", path.strain), ("s", path.stress)):
        for name in names:
            if name not in point.free:
                raise ScriptError(
                    f"{subject} prescribes {kind}{name}, and {kinematics} has no strain e{name}",
                    argument=argument,
                    expected="components of " + " ".join(point.free),
                    hint="kinematics=3D",
                )
    if path.volumetric is not None and set(NORMAL) & set(point.free) <= set(path.strain):
        message = f"{subject} prescribes volumetric and every normal strain that {kinematics} has"
        hint = "leave out volumetric, or one of the strains"
        raise ScriptError(message, argument=argument, hint=hint)
    if path.turn and "xy" not in point.free:
        message = f"{subject} rotates the point, and {kinematics} cannot rotate"
        raise ScriptError(message, argument=argument, hint="kinematics=3D")
