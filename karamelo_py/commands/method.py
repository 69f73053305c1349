"""The command method: how points and grid are made and how velocity goes between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_type_hints

from karamelo_py import registry
from karamelo_py.points.transfers.flip import FLIP
from karamelo_py.points.transfers.tflip import TFLIP
from karamelo_py.script.errors import ScriptError, nearest
from karamelo_py.signature import Argument

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

OPTIONS = ("mechanical", "thermo-mechanical", "gradient-enhanced")


def method(hub: Hub, kind: str, transfer: str, basis: str, *options: Argument) -> None:
    """Choose the method, the transfer of velocity, and the basis functions.

    Parameters
    ----------
    kind
        Method style: ``ulmpm``, ``tlmpm``, ``ulcpdi``, ``tlcpdi``, ``ulmpm/contacts``.
    transfer
        ``PIC``, ``FLIP``, ``APIC``, ``AFLIP``, ``ASFLIP``, ``MLS``, ``TPIC`` or ``XPIC``.
    basis
        ``linear``, ``quadratic-spline``, ``cubic-spline``, ``Bernstein-quadratic``, ``ugimp`` or
        ``cpgimp``; with the cpdi methods ``linear``.
    options
        What the transfer asks for (the share of FLIP from 0 to 1, the order of XPIC); then, in any
        order, ``mechanical``, ``gradient-enhanced`` (FLIP maps the gradient of velocity too), and
        the variant of the basis (cpgimp: ``det``, ``diagonal``, ``stretch`` or ``corners``; the
        cpdi methods: ``R4``, ``Q4``, ``R8``, ``H8``, ``T3``, ``Tet4``).

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    method(ulmpm, APIC, quadratic-spline)
    method(ulmpm, FLIP, cpgimp, 1, stretch)
    method(ulcpdi, FLIP, linear, 0.99, Q4)

    Notes
    -----
    Comes before the first solid.

    See Also
    --------
    scheme, solid
    """
    method_class = registry.find("method", kind)
    transfer_class = registry.find("transfer", transfer)
    words = list(options)
    _refuse_shape(kind, transfer_class, method_class, basis, words)
    parameters = [
        _parameter(hub, transfer_class, name, words, f"method({kind}, {transfer}, {basis}")
        for name in transfer_class._fields
    ]
    variants = _variants(method_class, registry.find("basis", basis))
    basis_class, chosen = _basis(kind, method_class, basis, words)
    for argument in words:
        word = argument.word() or argument.text
        if word == "thermo-mechanical":
            raise ScriptError(
                "temperature is not there yet", place=argument.place, hint="mechanical"
            )
        if chosen is not None and argument is not chosen and word in variants:
            raise ScriptError(
                f"'{chosen.text}' was chosen already", place=argument.place, expected="one of them"
            )
        if word == "gradient-enhanced":
            transfer_class = _enhanced(transfer_class, argument)
        elif argument is not chosen and word not in OPTIONS:
            known = [*(o for o in OPTIONS if o != "thermo-mechanical"), *variants]
            close = nearest(word, known)
            raise ScriptError(
                f"'{argument.text}' is not an option of method({kind}, {transfer}, {basis})",
                place=argument.place,
                expected="nothing more, or one of " + ", ".join(known),
                hint=f"did you mean '{close}'?" if close else None,
            )
    if hub.solids:
        raise ScriptError(
            "the method cannot change once there are solids",
            expected="method(...) before the first solid",
            hint=f"move it above line {next(iter(hub.solids.values())).place.line}",
        )
    hub.update.method = method_class(hub, basis_class())
    hub.update.transfer = transfer_class(*parameters)


def _variants(method_class: type, basis_class: type) -> dict[str, type]:
    """Variants of the basis by name: those of the method (cpdi), or of the basis (cpgimp)."""
    return getattr(method_class, "variants", None) or getattr(basis_class, "variants", {})


def _refuse_shape(
    kind: str, transfer_class: type, method_class: type, basis: str, words: list[Argument]
) -> None:
    """The shape of the domains in the place of the basis, as older scripts have it."""
    if basis not in (getattr(method_class, "variants", None) or ()):
        return
    numbers = [x.text for x in words if x.word() is None] or ["1"] * len(transfer_class._fields)
    form = ", ".join([kind, transfer_class.__name__, "linear", *numbers, basis])
    raise ScriptError(
        f"'{basis}' is the shape of the domains, not a basis",
        argument="basis",
        expected=f"linear, and the shape at the end: method({form})",
    )


def _basis(
    kind: str, method_class: type, basis: str, words: list[Argument]
) -> tuple[type, Argument | None]:
    """The class of the basis, and the option that chose the variant."""
    basis_class = registry.find("basis", basis)
    variants = _variants(method_class, basis_class)
    if getattr(method_class, "variants", None) and basis != "linear":
        raise ScriptError(
            f"method {kind} maps the corners of domains by linear functions only",
            argument="basis",
            expected="linear",
        )
    if not variants:
        return basis_class, None
    for argument in words:
        if (word := argument.word()) in variants:
            return variants[word], argument
    default = getattr(basis_class, "default_variant", None)
    if default is not None and not getattr(method_class, "variants", None):
        return variants[default], None
    raise ScriptError(
        f"method {kind} needs the shape of the domains",
        expected="one of " + ", ".join(variants) + f" at the end, as in method({kind}, ..., "
        f"{next(iter(variants))})",
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


def _parameter(hub: Hub, transfer: type, name: str, words: list[Argument], call: str) -> Any:
    """The next number of a transfer: a share, or a whole number where the class says so."""
    whole = get_type_hints(transfer)[name] is int
    wanted = "a whole number from 1 to 20" if whole else "a number from 0 (PIC) to 1 (pure FLIP)"
    first_word = words[0].word() if words else None
    value = None
    if words and first_word not in OPTIONS:
        value = words[0].value(hub)
    if not isinstance(value, (int, float)):
        if words and first_word is None:
            raise ScriptError(f"{name} is {words[0].text}", place=words[0].place, expected=wanted)
        raise ScriptError(
            f"{transfer.__name__} needs a number {name} after the basis",
            expected=f"{call}, {name}) with {name} {wanted}",
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
