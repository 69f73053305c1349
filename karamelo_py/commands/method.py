"""Commands method, scheme, precision, anti_volumetric_locking."""

from collections.abc import Container, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Annotated, Any, Literal

from karamelo_py.advice import choosing
from karamelo_py.advice.choices import ALTERNATIVES, BY_RULES
from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.rules import Feature, compare
from karamelo_py.language.signature import Argument, In, Parameter, variants_of
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import check_part
from karamelo_py.schemes.quasi_static import PUBLISHED
from karamelo_py.script.errors import Mark, ScriptError, meant, unknown
from karamelo_py.script.syntax import CommandCall
from karamelo_py.styles.methods.base import CORRECTED


def method(
    hub: Hub,
    kind: Annotated[str, StyleOf("method")],
    transfer: Annotated[str, StyleOf("transfer")],
    basis: Annotated[str, StyleOf("basis")],
    *options: Argument,
    mass: Literal["lumped", "corrected"] = "lumped",
) -> None:
    """Choose the method, the velocity transfer and the basis functions.

    Parameters
    ----------
    kind
        The grids that are used, and whether points move through them.
    transfer
        How the velocity is mapped from the nodes to the points.
    basis
        The basis functions of the nodes; ``linear`` for the cpdi methods.
    options
        First the numbers of the transfer (the FLIP coefficient, the order of XPIC), of the basis
        and of the method; then words in any order. ``thermo-mechanical``: heat flows between points
        (default ``mechanical``: it does not). ``gradient-enhanced``: FLIP also maps the velocity
        gradient. ``det``, ``diagonal``, ``stretch`` or ``corners``: the variant of cpgimp. ``R4``,
        ``Q4``, ``R8``, ``H8``, ``T3`` or ``Tet4``: the domains of the cpdi methods.
    mass
        ``corrected``: remove from the accelerations most of the errors due to mass lumping.
        Available with APIC, AFLIP, ASFLIP, MLS, TPIC or TFLIP, and splines. Linear momentum is
        conserved.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    method(ulmpm, APIC, quadratic-spline)
    method(ulmpm, FLIP, cpgimp, 1, stretch)
    method(ulcpdi, FLIP, linear, 0.99, Q4)
    method(tlmpm, FLIP, linear, 0.99, thermo-mechanical)
    method(ulmpm, APIC, cubic-spline, mass=corrected)

    Notes
    -----
    This command must precede the first solid.

    ``method(auto)`` reads the script up to its first run and chooses method, transfer, basis,
    scheme, mass and F-bar for the scene (docs/choose.md). ``method(auto, accuracy=0.01)`` also
    states the largest error for ``karamelo-py advise``, which compares this choice with others.

    ``thermo-mechanical``: before each momentum update, heat is conducted between points of
    materials with a temperature (``linear``, ``neo-hookean`` and ``hencky`` with cp and kappa,
    ``eos-strength`` with a temperature), also between bodies with common nodes. Fixes can add heat.
    Temperature increments are mapped to the points (as in FLIP, for any velocity transfer), so the
    mapping itself does not smooth temperatures. `dt` is also limited by the stable step of
    conduction, h^2/(4 d) rho cp/kappa in d dimensions. With ``mechanical``, points are heated only
    by their own plastic and viscous work.

    See Also
    --------
    scheme, solid, temperature, fix temperature_nodes, fix temperature_particles,
    fix heat_flux_particles, fix convection_particles
    """
    call = _Call(hub, {"method": kind, "transfer": transfer, "basis": basis}, options)
    parts = call.parts()
    _refuse_after_solids(hub)
    before = hub.update.method
    if before is not None:
        hub.warn(
            f"this method replaces the one in line {before.mark.line}", hint="one line method(...)"
        )
    chosen = hub.update.method = parts["method"]
    hub.update.transfer, chosen.basis = parts["transfer"], parts["basis"]
    for family, item in parts.items():
        check_part(hub, f"{family} {call.names[family]}", item)
    chosen.basis_name = f"{basis} {call.variant}".strip()
    if mass == "corrected":
        names = ("method", kind), ("transfer", transfer), ("basis", chosen.basis_name)
        words = f"method {kind}", f"transfer {transfer}", f"the basis {chosen.basis_name}"
        compare(
            {Feature(CORRECTED.option, "", CORRECTED.option): CORRECTED},
            [Feature(*name, word) for name, word in zip(names, words, strict=True)],
        )
    chosen.mark, chosen.marks = hub.mark, _marks(hub)
    chosen.corrected = mass == "corrected"
    hub.update.thermal = chosen.thermal


def _marks(hub: Hub) -> dict[str, Mark]:
    statement = hub.interpreter.statement
    raws = statement.arguments if isinstance(statement, CommandCall) else ()
    words = [Argument(raw, hub.interpreter) for raw in raws[:3]]
    if len(words) < 3 or any(word.keyword() for word in words):
        return {}
    marks = dict(zip(("method", "transfer", "basis"), [word.mark for word in words], strict=True))
    here = hub.mark is not None and all(mark[:2] == hub.mark[:2] for mark in marks.values())
    return marks if here else {}


def _refuse_after_solids(hub: Hub) -> None:
    if hub.solids:
        message = "the method cannot change once there are solids"
        expected = "method(...) before the first solid"
        hint = f"move it above line {next(iter(hub.solids.values())).mark.line}"
        raise ScriptError(message, expected=expected, hint=hint, code="too-late")


def auto(
    hub: Hub,
    kind: Literal["auto"],
    *,
    accuracy: Annotated[float, In(0, 1, open=True)] | None = None,
) -> None:
    """Choose the method for the scene that the rest of the script describes.

    The script is read up to its first run; materials, bodies, speeds, contact and duration select a
    row of the table in docs/choose.md. The banner and ``check`` show the chosen lines, such as
    ``method(...)``. Commands ``scheme``, ``anti_volumetric_locking``, ``dt_factor`` and ``set_dt``
    in the script take precedence.

    Parameters
    ----------
    accuracy
        The largest error, a fraction, for ``karamelo-py advise``, which compares this choice with
        other set-ups (docs/studies/advise.md). A single run does not check this error.

    Example
    -------
    method(auto)
    method(auto, accuracy=0.01)
    """
    _refuse_after_solids(hub)
    interpreter = hub.interpreter
    if not interpreter.has_more:
        message = "method(auto) reads the script ahead, but no lines follow"
        hint = "in Python: Simulation.script(...) with the whole scene, or a method by name"
        raise ScriptError(message, expected="the whole scene and a run after it", hint=hint)
    name = interpreter.presets.get("auto", BY_RULES)
    if name not in (names := (BY_RULES, *ALTERNATIVES)):
        raise unknown(f"-var auto: unknown set-up '{name}'", name, names)
    chosen = choosing.choose(hub, name, accuracy)
    update, own_scheme = hub.update, hub.update.scheme_mark
    interpreter.perform(chosen.lines)
    update.chosen, update.scheme_mark = chosen, own_scheme


signature.FORMS[method] = {"auto": auto}


OF_IMPLICIT = "tolerance", "iterations", "solver", "limit"


def scheme(
    hub: Hub,
    style: Annotated[str, StyleOf("scheme")],
    *arguments: Argument,
    start: Literal["full", "half"] = "full",
) -> None:
    """Choose when the stress is updated in an explicit step, or choose an implicit scheme.

    Parameters
    ----------
    style
        The time integration; default ``musl``.
    arguments
        Arguments of the style; explicit schemes have none.
    start
        With ``half``, forces act for half of the first explicit step, so that velocities and
        kinetic energies belong to the logged time; with ``full`` (default), for all of it.

    Example
    -------
    scheme(usl)
    scheme(musl, start=half)

    Notes
    -----
    Explicit positions belong to the end of a step, velocities to its middle. With ``full`` the
    initial velocity is taken as the velocity at t = -dt/2. The position of a projectile then has
    the error g dt t/2, and logged velocities and kinetic energies lag by half a step. With ``half``
    positions and velocities are second-order accurate in the step, and points also store their
    previous velocity. Velocities set later, such as ``sim.points["vx"] = values``, are taken as the
    velocities half a step earlier.

    See Also
    --------
    method
    """
    try:
        target = registry.find("scheme", style)
        chosen = signature.call(target, hub, arguments, f"scheme {style}")
        check_part(hub, f"scheme {style}", chosen)
    except ScriptError as error:
        if (pair := arguments[-1].keyword() if arguments else None) and not error.hint:
            error.hint = meant(pair[0], ["start"])
            error.expected = "start=full or start=half" if error.hint else error.expected
            if pair[0] in OF_IMPLICIT and not error.expected:
                error.expected = f"scheme({style}), or scheme(quasi-static, {pair[0]}=...)"
        for name in PUBLISHED:  # publishes the names, to avoid follow-up errors about them
            hub.values.publish(name)
        raise
    if start == "half" and chosen.traits.implicit:
        message = "start is for explicit schemes; implicit velocities belong to the end of a step"
        raise ScriptError(message, argument="start", expected="an explicit scheme, or no start")
    update, runs = hub.update, len(hub.runs)
    update.half_start = start == "half"
    if update.scheme_mark is not None and update.scheme_behind == runs:
        hub.warn(
            f"this scheme replaces the one in line {update.scheme_mark.line}, which no run "
            "has used",
            hint="one line scheme(...) before a run",
        )
    update.scheme, update.scheme_mark, update.scheme_behind = chosen, hub.mark, runs
    for name in PUBLISHED:
        if name in hub.values or chosen.traits.implicit:
            hub.values.publish(name)


registry.may_differ(scheme, keywords=OF_IMPLICIT)


def precision(hub: Hub, kind: Literal["double", "single"]) -> None:
    """Choose the floating-point precision of points and nodes, before the first run.

    Parameters
    ----------
    kind
        ``double`` (the default) or ``single``, which halves the memory.

    Example
    -------
    precision(single)
    """
    if hub.has_run:
        message = "the precision cannot change after the first run"
        raise ScriptError(message, expected="precision(...) before the first run", code="too-late")
    hub.settings.precision = kind


def anti_volumetric_locking(hub: Hub, active: bool) -> None:
    """Average volume changes over neighbouring points (F-bar), to avoid volumetric locking.

    With low-order basis functions, a constant volume at each point is too strong a constraint:
    nearly incompressible and plastic bodies are too stiff. Averaging the volume increment with the
    basis weights removes the excess constraints (Coombs et al. 2018). The mean stress is averaged
    with the same weights, so that nodal forces are work-conjugate to the averaged strain.

    Example
    -------
    anti_volumetric_locking(true)

    Notes
    -----
    F-bar costs one more pass over the points per stress update and one per force evaluation.

    Yield surfaces of mohr-coulomb, drucker-prager and mu-i use the pressure p + c (p_mean - p),
    where p is the pressure of the point, p_mean the averaged pressure, and c = (sin(phi) -
    sin(psi))/(sin(phi) (1 - sin(psi))). With p alone, non-dilatant sand would lose half of its
    strength. Implicit load steps use p alone: with them, do not use F-bar for non-dilatant sand.

    See Also
    --------
    method
    """
    hub.update.anti_locking = active


FAMILIES = ("transfer", "basis", "method")


class _Call:
    def __init__(self, hub: Hub, names: dict[str, str], options: Sequence[Argument]):
        self.hub = hub
        self.names = names
        basis = names["basis"]
        self.options = list(options)
        self.variant = ""
        domain = hub.domain
        self.dimension = domain.dimension if domain is not None else hub.announced_dimension
        self.styles = self._found()
        self.shapes = variants_of(self.styles["method"])
        self.variants = {"method": {}, "transfer": variants_of(self.styles["transfer"])}
        self.fit = [n for n, s in self.shapes.items() if self.dimension in (None, s.dimension)]
        if basis in self.shapes:
            shape = basis if basis in self.fit or not self.fit else self.fit[0]
            instead = self.instead(shape, basis="linear")
            message = f"'{basis}' is the shape of the domains, not a basis"
            expected = f"linear, and the shape at the end: {instead}"
            raise ScriptError(message, argument="basis", expected=expected)
        self.styles["basis"] = registry.find("basis", basis)
        self.variants["basis"] = self.shapes or variants_of(self.styles["basis"])

    def _found(self) -> dict[str, type]:
        styles: dict[str, type] = {}
        errors: list[ScriptError] = []
        for family, name in self.names.items():
            if family == "basis" and not errors:
                break  # a word that may be a shape of domains
            try:
                styles[family] = registry.find(family, name)
            except ScriptError as error:
                error.argument = "kind" if family == "method" else family
                errors.append(error)
        if errors:
            first, *first.others = errors
            owners = {f: n for n in self.names.values() for f in FAMILIES if registry.knows(f, n)}
            if len(owners) == len(FAMILIES):
                words = [owners[family] for family in ("method", "transfer", "basis")]
                first.hint = f"method({', '.join([*words, *(a.text for a in self.options)])})"
                first.others = []
            raise first
        return styles

    def parts(self) -> dict[str, Any]:
        if self.shapes:
            self._check_shapes()
        rest = self._choose("basis", self._choose("transfer", self.options))
        slots = [(f, p) for f in FAMILIES for p in signature.parameters(self.styles[f])]
        numbers = [slot for slot in slots if not slot[1].kind.words]
        chosen: dict[tuple[str, str], Argument] = {}
        for argument in rest:
            slot = next((s for s in slots if _word(argument, s[1].kind.words)), None)
            if slot is None and not numbers:
                raise self._unknown(argument, slots)
            family, parameter = slot or numbers.pop(0)
            before, words = chosen.get((family, parameter.name)), parameter.kind.words
            if before and not (words and _word(before, words) == _word(argument, words)):
                raise _chosen_twice(before, argument)
            chosen[family, parameter.name] = argument
        for family, parameter in slots:
            if not parameter.optional and (family, parameter.name) not in chosen:
                word = next((a.text for a in self.options if a not in rest), None)
                raise ScriptError(
                    f"{self.names[family]} needs {parameter.name} after the basis",
                    expected=f"{self.instead(word, by_name=True)} with {parameter.name} "
                    + parameter.kind.text,
                )
        values: dict[str, dict[str, Any]] = {family: {} for family in FAMILIES}
        for family, p in slots:
            if value := chosen.get((family, p.name)):
                values[family][p.name] = signature.convert(self.hub, p, value)
        return {
            family: signature.make(
                style, self.hub, f"{family} {self.names[family]}", **values[family]
            )
            for family, style in self.styles.items()
        }

    def _check_shapes(self) -> None:
        kind, fit = self.names["method"], self.fit
        if self.names["basis"] != "linear":
            message = f"method {kind} maps the corners of domains with a linear basis only"
            raise ScriptError(message, argument="basis", expected="linear")
        if not fit:
            raise ScriptError(
                f"method {kind} has no domains for {self.dimension} dimension",
                hint=f"{self.instead(kind='ulmpm', basis='cpgimp')}, which is the same in 1D",
            )
        shapes = {shape: a for a in self.options if (shape := _word(a, self.shapes))}
        for shape in (shape for shape in shapes if shape not in fit):
            raise ScriptError(
                f"domains of the shape {shape} are for {self.shapes[shape].dimension} "
                f"dimensions, and this scene has {self.dimension}",
                mark=shapes[shape].mark,
                expected="one of " + ", ".join(fit),
            )
        if not shapes:
            by_dimension = groupby(fit, lambda name: self.shapes[name].dimension)
            choice = [f"in {d}D one of {', '.join(names)}" for d, names in by_dimension]
            choice = choice if len(choice) > 1 else ["one of " + ", ".join(fit)]
            raise ScriptError(
                f"method {kind} needs the shape of the domains",
                expected=f"{'; '.join(choice)}; at the end, as in {self.instead(fit[0])}",
            )

    def _choose(self, family: str, options: list[Argument]) -> list[Argument]:
        """Choose the variant that a word selects; return the remaining options."""
        variants = self.variants[family]
        words = [argument for argument in options if _word(argument, variants)]
        if len(words) > 1:
            raise _chosen_twice(*words[:2])
        default = signature.default_variant(self.styles[family])
        if word := _word(words[0], variants) if words else default:
            style = variants[word]
            self.styles[family] = registry.find(family, style) if isinstance(style, str) else style
            self.variant = word if family == "basis" else self.variant
        return [argument for argument in options if argument not in words]

    def instead(
        self,
        option: str | None = None,
        *,
        kind: str | None = None,
        basis: str | None = None,
        by_name: bool = False,
    ) -> str:
        """Return the command with another kind or basis, and `option` at the end."""
        styles = [self.styles[family] for family in FAMILIES if family in self.styles]
        asked = [p for s in styles for p in signature.parameters(s) if not p.kind.words]
        typed = [argument.text for argument in self.options if self._is_number(argument)]
        lacking = [p for p in asked[len(typed) :] if not p.optional]
        kept = self._words("method", "transfer")
        words = [
            kind or self.names["method"], self.names["transfer"], basis or self.names["basis"],
            *typed[: len(asked)], *(p.name if by_name else "1" for p in lacking),
            *(argument.text for argument in self.options if _word(argument, kept)),
        ]  # fmt: skip
        if option and option not in words:
            words.append(option)
        return f"method({', '.join(words)})"

    def _is_number(self, argument: Argument) -> bool:
        word = argument.word()
        return word is None or isinstance(self.hub.interpreter.variables.get(word), float)

    def _words(self, *families: str) -> list[str]:
        words = []
        for family in families:
            words += [w for p in signature.parameters(self.styles[family]) for w in p.kind.words]
            words += self.fit if family == "basis" and self.shapes else self.variants[family]
        return words

    def _unknown(self, argument: Argument, slots: list[tuple[str, Parameter]]) -> ScriptError:
        word = argument.word()
        if self._is_number(argument):
            asking = {p.name: self.names[f] for f, p in slots if not p.kind.words}
            who = " with ".join(dict.fromkeys(asking.values())) or self.names["transfer"]
            takes = f"{', '.join(asking)} and no further number" if asking else "no number"
            chosen = next((a.text for a in self.options if _word(a, self.variants["basis"])), None)
            return ScriptError(
                f"{who} takes {takes}",
                mark=argument.mark,
                expected=self.instead(chosen),
                hint=f"-var {word} mechanical removes it" if word else None,
            )
        for family in FAMILIES:
            owners = []
            for name in registry.names(family):
                with suppress(ScriptError):  # broken plug-ins are reported elsewhere
                    if word in variants_of(registry.find(family, name)):
                        owners.append(name)
            if owners:
                return ScriptError(
                    f"{word} goes with {' or '.join(owners)}, not with {self.names[family]}",
                    mark=argument.mark,
                    hint=f"karamelo-py help {family} {owners[0]} explains it",
                )
        options = self._words("method", "transfer", "basis")
        return ScriptError(
            f"'{argument.text}' is not an option of method({', '.join(self.names.values())})",
            mark=argument.mark,
            expected="nothing more, or one of " + ", ".join(options),
            hint=meant(word, options),
        )


def _word(argument: Argument, words: Container[str]) -> str | None:
    """Return the option if it is one of `words`; a variable of that name is ignored."""
    word = argument.text if argument.text in words else argument.word()
    return word if word in words else None


def _chosen_twice(first: Argument, second: Argument) -> ScriptError:
    return ScriptError(
        f"'{first.text}' was chosen already", mark=second.mark, expected="one of them"
    )
