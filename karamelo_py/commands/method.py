"""The command method: how points and grid are made and how velocity goes between them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument, Parameter
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, nearest


def method(
    hub: Hub,
    kind: StyleOf("method"),
    transfer: StyleOf("transfer"),
    basis: StyleOf("basis"),
    *options: Argument,
) -> None:
    """Choose the method, the transfer of velocity, and the basis functions.

    Parameters
    ----------
    kind
        Which grids there are, and whether points move through them.
    transfer
        How velocity goes from the nodes to the points.
    basis
        The functions of the nodes; with the cpdi methods ``linear``.
    options
        The numbers that the transfer asks for (the share of FLIP, the order of XPIC), then those of
        the basis and of the method; and, in any order, words that one of the three knows:
        ``mechanical`` (the default) or ``thermo-mechanical`` (heat flows between points, too),
        ``gradient-enhanced`` (FLIP maps the gradient of velocity too), the variant of cpgimp
        (``det``, ``diagonal``, ``stretch`` or ``corners``), and the shape of the domains of the
        cpdi methods (``R4``, ``Q4``, ``R8``, ``H8``, ``T3``, ``Tet4``). The page of each says more.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    method(ulmpm, APIC, quadratic-spline)
    method(ulmpm, FLIP, cpgimp, 1, stretch)
    method(ulcpdi, FLIP, linear, 0.99, Q4)
    method(tlmpm, FLIP, linear, 0.99, thermo-mechanical)

    Notes
    -----
    Comes before the first solid.

    ``thermo-mechanical``: before each update of momentum, heat flows between the points of
    materials with a temperature (``linear`` and ``neo-hookean`` with cp and kappa,
    ``eos-strength`` with a temperature; others take no part). Points take changes of the nodes'
    temperature (FLIP, whatever the transfer of velocity): nothing is smeared but by conduction.
    Without it points only heat by their own work. Conduction has a stable step of its own,
    h^2/(4 d) rho cp/kappa in d dimensions, which `dt` keeps too. Bodies that share nodes share
    heat; else it leaves a body only where a fix says so.

    See Also
    --------
    scheme, solid, temperature, fix temperature_nodes, fix temperature_particles,
    fix heat_flux_particles, fix convection_particles
    """
    call = _Call(hub, kind, transfer, basis, options)
    values = call.values()
    if hub.solids:
        raise ScriptError(
            "the method cannot change once there are solids",
            expected="method(...) before the first solid",
            hint=f"move it above line {next(iter(hub.solids.values())).place.line}",
        )
    hub.update.transfer = call.styles["transfer"](**values["transfer"])
    chosen = hub.update.method = call.styles["method"](hub, **values["method"])
    chosen.basis = call.styles["basis"](**values["basis"])
    chosen.basis_name = f"{basis} {call.variant}".strip()
    chosen.place = hub.place
    hub.update.thermal = chosen.thermal


def anti_volumetric_locking(hub: Hub, active: bool) -> None:
    """Average changes of volume over the surroundings of a point (F-bar).

    Nearly incompressible and plastic bodies are too stiff where each point keeps its own volume:
    low-order functions cannot follow. Averaging the increment of volume with the weights of the
    basis takes the excess of constraints away (Coombs et al. 2018).

    Parameters
    ----------
    active
        ``true`` or ``false`` (the default).

    Example
    -------
    anti_volumetric_locking(true)

    Notes
    -----
    One more visit of the points for each update of the stress.

    See Also
    --------
    method
    """
    hub.update.anti_locking = active


FAMILIES = ("transfer", "basis", "method")


class _Call:
    """The three styles of a call, and which of their parameters each option is."""

    def __init__(self, hub: Hub, kind: str, transfer: str, basis: str, options: tuple):
        self.hub = hub
        self.names = {"method": kind, "transfer": transfer, "basis": basis}
        self.options = options
        self.variant = ""
        domain = hub.domain
        self.dimension = domain.dimension if domain is not None else hub.announced_dimension
        self.styles = {"method": registry.find("method", kind)}
        # Domains have a shape, which chooses the class of the basis.
        self.shapes: Mapping[str, type] = getattr(self.styles["method"], "variants", {})
        self.styles["transfer"] = registry.find("transfer", transfer)
        if basis in self.shapes:
            fit = self._fitting()
            shape = basis if basis in fit or not fit else fit[0]
            instead = self.instead(basis="linear", option=shape)
            raise ScriptError(
                f"'{basis}' is the shape of the domains, not a basis",
                argument="basis",
                expected=f"linear, and the shape at the end: {instead}",
            )
        self.styles["basis"] = registry.find("basis", basis)
        self.variants = {
            "transfer": getattr(self.styles["transfer"], "variants", {}),
            "basis": self.shapes or getattr(self.styles["basis"], "variants", {}),
        }

    def values(self) -> dict[str, dict[str, Any]]:
        """What each style is made with; its variant takes its place in `styles`."""
        rest = list(self.options)
        if self.shapes:
            self._check_shapes(rest)
        for family in self.variants:
            self._choose(family, rest)
        slots = [(f, p) for f in FAMILIES for p in signature.parameters(self.styles[f])]
        values: dict[str, dict[str, Any]] = {family: {} for family in FAMILIES}
        numbers = [slot for slot in slots if not slot[1].kind.words]
        given: dict[str, Argument] = {}
        for argument in rest:
            slot = next((s for s in slots if _word(argument, s[1].kind.words)), None)
            slot = slot or (numbers.pop(0) if numbers else None)
            if slot is None:
                raise self._unknown(argument, slots)
            family, parameter = slot
            if parameter.name in values[family]:
                raise _chosen_twice(given[parameter.name], argument)
            given[parameter.name] = argument
            values[family][parameter.name] = signature.convert(self.hub, parameter, argument)
        for family, parameter in slots:
            if not parameter.optional and parameter.name not in values[family]:
                raise self._missing(family, parameter, slots, values)
        return values

    def _check_shapes(self, rest: list[Argument]) -> None:
        """Refuse functions that know no domains, and shapes for another dimension."""
        kind, fit = self.names["method"], self._fitting()
        if self.names["basis"] != "linear":
            raise ScriptError(
                f"method {kind} maps the corners of domains by linear functions only",
                argument="basis",
                expected="linear",
            )
        if not fit:
            raise ScriptError(
                f"method {kind} has no domains for {self.dimension} dimension",
                hint=f"{self.instead(basis='cpgimp', kind='ulmpm')}: in one dimension that is the "
                "same thing",
            )
        shapes = [(argument, _word(argument, self.shapes)) for argument in rest]
        for argument, shape in shapes:
            if shape and shape not in fit:
                raise ScriptError(
                    f"domains of the shape {shape} are for {self.shapes[shape].dimension} "
                    f"dimensions, and this scene has {self.dimension}",
                    place=argument.place,
                    expected="one of " + ", ".join(fit),
                )
        if not any(shape for _, shape in shapes):
            by_dimension: dict[int, list[str]] = {}
            for name in fit:
                by_dimension.setdefault(self.shapes[name].dimension, []).append(name)
            choices = [f"in {d}D one of {', '.join(s)}" for d, s in by_dimension.items()]
            choice = "; ".join(choices) if len(choices) > 1 else "one of " + ", ".join(fit)
            raise ScriptError(
                f"method {kind} needs the shape of the domains",
                expected=f"{choice}; at the end, as in {self.instead(option=fit[0])}",
            )

    def _fitting(self) -> list[str]:
        """Shapes for the dimension of the scene; all as long as that is not known."""
        d = self.dimension
        return [name for name, shape in self.shapes.items() if d in (None, shape.dimension)]

    def _choose(self, family: str, rest: list[Argument]) -> None:
        """Put the variant that a word asks for in the place of the style; take the word away."""
        variants = self.variants[family]
        words = [argument for argument in rest if _word(argument, variants)]
        if len(words) > 1:
            raise _chosen_twice(*words[:2])
        word = getattr(self.styles[family], "default_variant", None)
        if words:
            rest.remove(words[0])
            word = _word(words[0], variants)
        if word:
            style = variants[word]
            self.styles[family] = registry.find(family, style) if isinstance(style, str) else style
            if family == "basis":
                self.variant = word

    def instead(
        self, *, basis: str | None = None, option: str | None = None, kind: str | None = None
    ) -> str:
        """The same call with another basis or kind, and with `option` at the end."""
        count = len(signature.parameters(self.styles["transfer"]))
        numbers = [a.text for a in self.options if a.word() is None]
        numbers = (numbers + ["1"] * count)[:count]
        known = self._words(shapes=False)
        kept = [a.text for a in self.options if _word(a, known)]
        names = [kind or self.names["method"], self.names["transfer"], basis or self.names["basis"]]
        return f"method({', '.join([*names, *numbers, *kept, *([option] if option else [])])})"

    def _words(self, shapes: bool = True) -> list[str]:
        """Words that may stand among the options."""
        own = [signature.parameters(self.styles["method"])]
        own += [signature.parameters(self.styles[f]) for f in ("transfer", "basis") if shapes]
        words = [word for some in own for p in some for word in p.kind.words]
        words += getattr(registry.find("transfer", self.names["transfer"]), "variants", {})
        if shapes:
            words += self._fitting() if self.shapes else self.variants["basis"]
        return words

    def _missing(self, family: str, parameter: Parameter, slots: list, values: dict) -> ScriptError:
        name = parameter.name
        numbers = [p for _, p in slots if not p.kind.words and (not p.optional or p is parameter)]
        numbers = [p.shown for p in numbers]
        words = [a.text for a in self.options if a.word() is not None]
        typed = [a.text for a in self.options if a.word() is None]
        numbers[: len(typed)] = typed
        call = f"method({', '.join([*self.names.values(), *numbers, *words])})"
        return ScriptError(
            f"{self.names[family]} needs {name} after the basis",
            expected=f"{call} with {name} {parameter.kind.text}",
        )

    def _unknown(self, argument: Argument, slots: list) -> ScriptError:
        """What is wrong with an option that nothing asks for."""
        word = argument.word()
        asking = [(f, p.name) for f, p in slots if not p.kind.words]
        if word is None or isinstance(self.hub.interpreter.variables.get(word), float):
            who = " with ".join(dict.fromkeys(self.names[f] for f, _ in asking))
            takes = ", ".join(name for _, name in asking)
            chosen = next((a.text for a in self.options if _word(a, self.variants["basis"])), None)
            return ScriptError(
                f"{who} takes {takes} and no further number"
                if asking
                else f"{self.names['transfer']} takes no number",
                place=argument.place,
                expected=self.instead(option=chosen),
            )
        if home := _home(word):
            family, name = home
            return ScriptError(
                f"{word} goes with {name}, not with {self.names[family]}",
                place=argument.place,
                expected=f"karamelo-py help {family} {name} explains it",
            )
        known = self._words()
        close = nearest(word, known)
        return ScriptError(
            f"'{argument.text}' is not an option of method({', '.join(self.names.values())})",
            place=argument.place,
            expected="nothing more, or one of " + ", ".join(known),
            hint=f"did you mean '{close}'?" if close else None,
        )


def _word(argument: Argument, known: Any) -> str | None:
    """The one of the `known` words that an argument is; a variable of that name is passed over."""
    word = argument.text if argument.text in known else argument.word()
    return word if word in known else None


def _chosen_twice(first: Argument, second: Argument) -> ScriptError:
    return ScriptError(
        f"'{first.text}' was chosen already", place=second.place, expected="one of them"
    )


def _home(word: str) -> tuple[str, str] | None:
    """The family and name of the first style that has a variant of this name."""
    for family in FAMILIES:
        for name in registry.names(family):
            with suppress(ScriptError):  # a broken plug-in is not what this is about
                if word in getattr(registry.find(family, name), "variants", {}):
                    return family, name
    return None
