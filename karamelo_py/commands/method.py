"""The command method: how points and grid are made and how velocity goes between them."""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

from karamelo_py.language import registry
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.points.transfers.flip import FLIP
from karamelo_py.points.transfers.tflip import TFLIP
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, nearest

OPTIONS = ("mechanical", "thermo-mechanical", "gradient-enhanced")


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
        What the transfer asks for (the share of FLIP from 0 to 1, the order of XPIC); then, in any
        order, ``mechanical`` (the default) or ``thermo-mechanical`` (heat flows between points,
        too), ``gradient-enhanced`` (FLIP maps the gradient of velocity too), and
        the variant of the basis (cpgimp: ``det``, ``diagonal``, ``stretch`` or ``corners``; the
        cpdi methods: ``R4``, ``Q4``, ``R8``, ``H8``, ``T3``, ``Tet4``).

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
    method_class = registry.find("method", kind)
    transfer_class = registry.find("transfer", transfer)
    call = _Call(hub, kind, method_class, transfer_class, basis, options)
    _refuse_shape(call)
    basis_class = registry.find("basis", basis)
    variants = _variants(method_class, basis_class)
    words = list(options)
    parameters = [_parameter(call, variants, name, words) for name in transfer_class._fields]
    basis_class, chosen = _basis(call, basis_class, variants, words)
    for argument in words:
        word = argument.word() or argument.text
        if chosen is not None and argument is not chosen and word in variants:
            raise ScriptError(
                f"'{chosen.text}' was chosen already", place=argument.place, expected="one of them"
            )
        if word == "gradient-enhanced":
            transfer_class = _enhanced(transfer_class, argument)
        elif argument is not chosen and word not in OPTIONS:
            raise _unknown_option(call, variants, argument)
    if hub.solids:
        raise ScriptError(
            "the method cannot change once there are solids",
            expected="method(...) before the first solid",
            hint=f"move it above line {next(iter(hub.solids.values())).place.line}",
        )
    hub.update.method = method_class(hub, basis_class())
    hub.update.method.place = hub.place
    variant = next((name for name, other in variants.items() if other is basis_class), "")
    hub.update.method.basis_name = f"{basis} {variant}".strip()
    hub.update.transfer = transfer_class(*parameters)
    hub.update.thermal = any(argument.word() == "thermo-mechanical" for argument in words)


class _Call(NamedTuple):
    """What was typed, for messages that say what to type instead."""

    hub: Hub
    kind: str
    method_class: type
    transfer_class: type
    basis: str
    options: tuple[Argument, ...]

    @property
    def dimension(self) -> int | None:
        """That of the scene, where it is known already."""
        domain = self.hub.domain
        return domain.dimension if domain is not None else self.hub.announced_dimension

    def fitting(self, variants: dict[str, type]) -> list[str]:
        """Names of the variants for the dimension of the scene."""
        d = self.dimension
        return [n for n, v in variants.items() if d in (None, getattr(v, "dimension", d))]

    def choice(self, variants: dict[str, type]) -> str:
        """Which of the variants there are; those of each dimension as long as it is not known."""
        names: dict[int | None, list[str]] = {}
        for name in self.fitting(variants):
            names.setdefault(getattr(variants[name], "dimension", None), []).append(name)
        if len(names) == 1:
            return "one of " + ", ".join(*names.values())
        return "; ".join(f"in {d}D one of {', '.join(fit)}" for d, fit in names.items())

    def instead(self, *, basis: str, option: str | None = None, kind: str | None = None) -> str:
        """The same call with another basis, and with `option` at the end."""
        numbers = [argument.text for argument in self.options if argument.word() is None]
        names = self.transfer_class._fields
        numbers = (numbers + ["1"] * len(names))[: len(names)]
        kept = [argument.text for argument in self.options if argument.word() in OPTIONS]
        last = [option] if option is not None else []
        name = self.transfer_class.__name__
        return f"method({', '.join([kind or self.kind, name, basis, *numbers, *kept, *last])})"


def _variants(method_class: type, basis_class: type) -> dict[str, type]:
    """Variants of the basis by name: those of the method (cpdi), or of the basis (cpgimp)."""
    return getattr(method_class, "variants", None) or getattr(basis_class, "variants", {})


def _refuse_shape(call: _Call) -> None:
    """The shape of the domains in the place of the basis, as older scripts have it."""
    variants = getattr(call.method_class, "variants", None) or {}
    if call.basis not in variants:
        return
    fit = call.fitting(variants)
    shape = call.basis if call.basis in fit or not fit else fit[0]
    raise ScriptError(
        f"'{call.basis}' is the shape of the domains, not a basis",
        argument="basis",
        expected=f"linear, and the shape at the end: {call.instead(basis='linear', option=shape)}",
    )


def _basis(
    call: _Call, basis_class: type, variants: dict[str, type], words: list[Argument]
) -> tuple[type, Argument | None]:
    """The class of the basis, and the option that chose the variant."""
    shaped = bool(getattr(call.method_class, "variants", None))
    if shaped and call.basis != "linear":
        raise ScriptError(
            f"method {call.kind} maps the corners of domains by linear functions only",
            argument="basis",
            expected="linear",
        )
    if not variants:
        return basis_class, None
    fit = call.fitting(variants)
    if not fit:
        raise ScriptError(
            f"method {call.kind} has no domains for {call.dimension} dimension",
            hint=f"{call.instead(basis='cpgimp', kind='ulmpm')}: in one dimension that is the "
            "same thing",
        )
    for argument in words:
        if (word := argument.word()) in fit:
            return variants[word], argument
        if word in variants:
            raise ScriptError(
                f"domains of the shape {word} are for {variants[word].dimension} dimensions, and "
                f"this scene has {call.dimension}",
                place=argument.place,
                expected="one of " + ", ".join(fit),
            )
    default = getattr(basis_class, "default_variant", None)
    if default is not None and not shaped:
        return variants[default], None
    raise ScriptError(
        f"method {call.kind} needs the shape of the domains",
        expected=f"{call.choice(variants)}; at the end, as in "
        + call.instead(basis=call.basis, option=fit[0]),
    )


def _unknown_option(call: _Call, variants: dict, argument: Argument) -> ScriptError:
    """What is wrong with an option that nothing asks for."""
    name, asked = call.transfer_class.__name__, call.transfer_class._fields
    word = argument.word()
    if word is None or isinstance(call.hub.interpreter.variables.get(word), float):
        takes = f"{', '.join(asked)} and no further number" if asked else "no share of FLIP"
        variant = next((o.word() for o in call.options if o.word() in variants), None)
        return ScriptError(
            f"{name} takes {takes}",
            place=argument.place,
            expected=call.instead(basis=call.basis, option=variant),
        )
    enhanced = [] if call.transfer_class is FLIP else ["gradient-enhanced"]
    known = [option for option in OPTIONS if option not in enhanced]
    known += call.fitting(variants)
    close = nearest(word, known)
    return ScriptError(
        f"'{argument.text}' is not an option of method({call.kind}, {name}, {call.basis})",
        place=argument.place,
        expected="nothing more, or one of " + ", ".join(known),
        hint=f"did you mean '{close}'?" if close else None,
    )


def _enhanced(transfer_class: type, argument: Argument) -> type:
    """The transfer that maps the gradient of velocity, too."""
    if transfer_class is not FLIP:
        raise ScriptError(
            f"gradient-enhanced goes with FLIP, not with {transfer_class.__name__}",
            place=argument.place,
            hint="TPIC is PIC with the gradient; affine transfers have it already",
        )
    return TFLIP


def _parameter(call: _Call, variants: dict, name: str, words: list[Argument]) -> Any:
    """The next number of a transfer: a share, or a whole number where the class says so."""
    transfer = call.transfer_class
    whole = get_type_hints(transfer)[name] is int
    wanted = "a whole number from 1 to 20" if whole else "a number from 0 (PIC) to 1 (pure FLIP)"
    first_word = words[0].word() if words else None
    value = None
    if words and first_word not in (*OPTIONS, *variants):
        value = words[0].value(call.hub)
    if not isinstance(value, (int, float)):
        if words and first_word is None:
            raise ScriptError(f"{name} is {words[0].text}", place=words[0].place, expected=wanted)
        rest = [argument.text for argument in words]
        typed = f"method({', '.join([call.kind, transfer.__name__, call.basis, name, *rest])}"
        raise ScriptError(
            f"{transfer.__name__} needs a number {name} after the basis",
            expected=f"{typed}) with {name} {wanted}",
        )
    argument = words.pop(0)
    in_range = 1 <= value <= 20 and value == int(value) if whole else 0 <= value <= 1
    if not in_range:
        raise ScriptError(f"{name} is {value}", place=argument.place, expected=wanted)
    return int(value) if whole else float(value)


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
