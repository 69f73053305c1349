"""The signature is the syntax: from a script's arguments to a Python call, and to help about it.

Commands are functions and styles are classes; the first parameter is the hub, the others say by
their annotations what a script has to give::

    class Gravity(Fix):
        def __init__(self, hub, group: NodeGroup, g: Annotated[float, Positive] = 9.81):

Annotations that are understood: float, int, bool, str, Literal words, Expression, InputFile,
TableFile, OutputFile, Argument (left to the callee), any class with a classmethod
``from_script(cls, hub, argument)``, and unions of these, where None is the word NULL. Constraints
are added with Annotated. ``*args`` take any number, keyword-only parameters are given as
``name=value``.
"""

import inspect
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_type_hints

from karamelo_py.language import registry
from karamelo_py.language.arguments import NULL, NUMBER, Argument, with_gap
from karamelo_py.language.faults import as_script_error
from karamelo_py.language.kinds import (
    AtLeast,
    Constraint,
    In,
    InputFile,
    Kind,
    NonNegative,
    OutputFile,
    Positive,
    TableFile,
    Unfit,
    is_raw,
    kind_of,
)
from karamelo_py.language.unknown import longer, renamed
from karamelo_py.script.errors import Place, ScriptError, meant, nearest, table

__all__ = [
    "Argument", "AtLeast", "Constraint", "In", "InputFile", "NonNegative", "OutputFile", "Positive",
    "TableFile",
]  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """One parameter of a command or style, as a script sees it."""

    name: str
    kind: Kind
    variadic: bool = False
    keyword: bool = False
    optional: bool = False
    default: Any = None
    description: str = ""

    @property
    def shown(self) -> str:
        """Write it as in a line of syntax."""
        if self.keyword:
            return f"{self.name}={'|'.join(self.kind.words) or self.name}"
        if len(self.kind.words) == 1:
            return self.kind.words[0]
        if self.kind.words and self.kind.text.startswith("one of "):
            return "|".join(self.kind.words)
        return self.name


@cache
def parameters(target: Callable) -> list[Parameter]:
    """List the parameters of a command or style, without the hub; of a record, its fields.

    A TypeError says that the signature cannot be understood, a fault of whoever wrote it.
    """
    record = is_record(target)
    try:
        if record and not hasattr(target, "given"):
            hints = get_type_hints(target, include_extras=True)
            empty, defaults = inspect.Parameter.empty, target._field_defaults
            return [_parameter(n, hints[n], defaults.get(n, empty)) for n in target._fields]
        function = target.given if record else target
        found = [*inspect.signature(function, eval_str=True).parameters.values()]
    except TypeError:
        raise
    except Exception as error:
        raise TypeError(f"an annotation cannot be evaluated ({error})") from error
    return [_parameter(p.name, p.annotation, p.default, p.kind) for p in found[not record :]]


def is_record(target: Any) -> bool:
    """Tell if a style is a NamedTuple, a tag that needs no hub.

    Its fields are its arguments, or those of its classmethod ``given`` where it has one. A method
    ``checked`` returns what is used in its place.
    """
    return inspect.isclass(target) and issubclass(target, tuple)


def _parameter(name: str, annotation: Any, default: Any, kind: Any = None) -> Parameter:
    optional = default is not inspect.Parameter.empty
    return Parameter(
        name,
        kind_of(annotation),
        variadic=kind is inspect.Parameter.VAR_POSITIONAL,
        keyword=kind is inspect.Parameter.KEYWORD_ONLY,
        optional=optional,
        default=default if optional else None,
    )


def call(
    target: Callable, hub: Any, arguments: Sequence[Argument], name: str, given: Any = None
) -> Any:
    """Call a command or make a style with the hub and a script's arguments; note them in `given`.

    The user calls it by `name`: ``run``, or ``fix body_force``. Whatever is wrong, with the count
    or kind of arguments or in the target itself, is a ScriptError with a place in the script.
    """
    try:
        expected = parameters(target)
    except TypeError as error:
        raise ScriptError(f"{name} is broken: {error}") from error
    bound: dict[str, list[Argument]] = {}
    try:
        _bind(target, expected, arguments, name, bound)
        values, named = [], {}
        for parameter in expected:
            for argument in bound.get(parameter.name, ()):
                number = None if parameter.keyword else len(values) + 1
                try:
                    value = convert(hub, parameter, argument, number)
                except ScriptError as error:
                    error.hint = _swapped(hub, expected, bound, parameter) or error.hint
                    raise
                if parameter.keyword:
                    named[parameter.name] = value
                else:
                    values.append(value)
                if given is not None:
                    before = given.get(parameter.name, ())
                    given[parameter.name] = (*before, value) if parameter.variadic else value
        try:
            return make(target, hub, name, *values, **named)
        except OSError as error:
            what = f"{error.filename}: " if error.filename else ""
            raise ScriptError(f"{what}{error.strerror or error}") from error
        except OverflowError as error:
            message = "a number is too large for what is done with it"
            raise ScriptError(message, expected="numbers in proportion to each other") from error
        except MemoryError as error:
            message = "there is not enough memory for this"
            raise ScriptError(message, hint="use larger cells or fewer points") from error
    except ScriptError as error:
        for wrong in () if error.complete else (error, *error.others):
            wrong.place = wrong.place or _guilty(wrong, arguments, bound)
            wrong.command = wrong.command or name
        raise


def style_of(
    hub: Any, family: str, ID: str, style: str, arguments: Sequence[Argument], given: Any = None
) -> Any:
    """Make what a style of a family, called `ID` by the script, makes of its arguments.

    Their values are noted in `given`, a dict, by name.
    """
    with in_new_words(family, ID, style, arguments):
        target = registry.called(family, ID, style)
        return call(target, hub, arguments, f"{family} {style}", given)


def remade(
    hub: Any, family: str, ID: str, style: str, given: dict, arguments: Sequence[Argument]
) -> tuple[Any, dict]:
    """Make a law again from the values `given` to it, but for those of ``name=value`` arguments.

    Returns what was made, and its values.
    """
    target, name = registry.called(family, ID, style), f"{family} {style}"
    expected = {p.name: p for p in parameters(target)}
    bound: dict[str, list[Argument]] = {}
    try:
        for argument in arguments:
            word, value = argument.keyword() or ("", argument)
            if word not in expected:
                raise ScriptError(
                    f"{name} has no '{word}'" if word else f"'{argument.text}' has no name",
                    place=argument.place,
                    expected=", ".join(f"{n}=..." for n in expected),
                    hint=meant(word, expected),
                )
            bound[word] = [value]
            given = given | {word: convert(hub, expected[word], value)}
        several = next((p.name for p in expected.values() if p.variadic), None)
        if several is None:
            return make(target, hub, name, **given), given
        names = [*expected]
        first = [given[n] for n in names[: names.index(several)]]
        last = {n: given[n] for n in names[names.index(several) + 1 :] if n in given}
        return make(target, hub, name, *first, *given.get(several, ()), **last), given
    except ScriptError as error:
        error.place = error.place or _guilty(error, arguments, bound)
        error.command = error.command or name
        raise


@contextmanager
def in_new_words(family: str, ID: str, style: str, arguments: Sequence[Argument]) -> Iterator[None]:
    """Let an error about a line of a former Karamelo end in the line to write."""
    try:
        yield
    except ScriptError as error:
        if not arguments or not registry.knows(family, style):
            words = [argument.text for argument in arguments]
            error.hint = renamed(family, style, ID, words) or error.hint
        raise


def make(target: Callable, hub: Any, name: str, *values: Any, **named: Any) -> Any:
    """Call a command or make a style with values; a fault of its author is told as such."""
    place = getattr(hub, "place", None)
    if not inspect.isclass(target):
        if target.__module__.startswith(registry.PREFIX):
            return target(hub, *values, **named)
        with as_script_error(name, "it", target, place):
            return target(hub, *values, **named)
    with as_script_error(name, "__init__", target, place):
        if not is_record(target):
            return target(hub, *values, **named)
        made = getattr(target, "given", target)(*values, **named)
        return made.checked() if hasattr(made, "checked") else made


def _bind(
    target: Callable,
    expected: list[Parameter],
    arguments: Sequence[Argument],
    name: str,
    bound: dict[str, list[Argument]],
) -> None:
    """Add to `bound` the arguments of each parameter: by position, or by name where it is given."""
    by_name = {p.name: p for p in expected if p.keyword}
    slots = [p for p in expected if not p.keyword]
    variadic = next((p for p in slots if p.variadic), None)
    given: list[Argument] = []
    # Raw arguments are passed on to a style, which knows the names.
    passed_on = variadic is not None and is_raw(variadic.kind)
    for argument in arguments:
        pair = argument.keyword()
        if pair is None or (passed_on and pair[0] not in by_name):
            given.append(argument)
            continue
        word, value = pair
        if word not in by_name:
            raise _unknown_keyword(word, argument, expected, by_name)
        if word in bound:
            raise ScriptError(f"{word} is given twice", place=argument.place)
        bound[word] = [value]
    needed = sum(1 for p in slots if not p.optional and not p.variadic)
    missing = [p.name for p in by_name.values() if not p.optional and p.name not in bound]
    if len(given) < needed or missing or (variadic is None and len(given) > len(slots)):
        few, gap, hint = len(given) < needed, with_gap(given), None
        surplus = given[len(slots)] if len(given) > len(slots) and not variadic else None
        if few:
            hint = longer(name, given) or table()["otherwise"].get(name)
        if surplus is not None:
            values = {word: f"{p.name}={word}" for p in by_name.values() for word in p.kind.words}
            word = surplus.text if surplus.text in values else nearest(surplus.text, values)
            hint = values.get(word or "", hint) or table()["surplus"].get(name)
        if gap:
            hint = f"is a comma missing in '{gap.text}'?"
        left_out = _left_out(slots[:needed], given) if few and not gap else []
        if left_out:
            surplus, filled = _filled(slots[:needed], given, left_out)
            hint = hint or (filled and f"{name}({filled})")
        missing = [f"{m}=..." for m in missing]
        missing = _named(left_out or slots[len(given) : needed], slots) or missing
        more = len(given) - len(slots)
        message = f"{'one argument' if more == 1 else f'{more} arguments'} too many"
        if missing:
            message = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        place = gap.place if gap else surplus.place if surplus else None
        form = syntax(target, name)
        raise ScriptError(message, place=place, expected=form, hint=hint, code="arguments")
    for k, argument in enumerate(given):
        parameter = slots[k] if k < len(slots) and not slots[k].variadic else variadic
        bound.setdefault(parameter.name, []).append(argument)


def _left_out(slots: list[Parameter], given: Sequence[Argument]) -> list[Parameter]:
    """List the parameters that were left out, by words that fit only further back."""
    missing, rest = [], list(given)
    for slot in slots:
        words = () if slot.shown == slot.name else slot.kind.words
        if rest and (not words or rest[0].text in words):
            del rest[0]
        else:
            missing.append(slot)
    return [] if rest or missing == slots[len(given) :] else missing


def _named(missing: list[Parameter], slots: list[Parameter]) -> list[str]:
    """List what is missing; an ID behind a word of its own is no second such word."""
    words = {p.shown for p in slots if p.shown != p.name}
    return [f"{p.name}ID" if p.shown == p.name in words else p.shown for p in missing]


def _filled(
    slots: list[Parameter], given: Sequence[Argument], missing: list[Parameter]
) -> tuple[Argument | None, str | None]:
    """Find what stands in the place of the first that is missing; fill words into all arguments."""
    rest, before = iter(given), next(k for k, slot in enumerate(slots) if slot in missing)
    words = [p.kind.words[0] if p in missing and p.kind.words else p in missing for p in slots]
    if True in words:
        return given[before], None
    return given[before], ", ".join(word or next(rest).text for word in words)


def _unknown_keyword(
    word: str, argument: Argument, expected: list[Parameter], by_name: dict
) -> ScriptError:
    longer = next((f"did you mean '{name}'?" for name in by_name if name.startswith(word)), None)
    turned = next((f"did you mean '{n}'?" for n in by_name if n == word[:1] + word[:0:-1]), None)
    hint = turned or meant(word, by_name) or longer
    if not hint and not all(p.keyword for p in expected):
        hint = f"leave out '{word} ='; == compares"
    if any(p.name == word for p in expected):
        hint = f"arguments are given by position: leave out '{word} ='"
    known = ", ".join(f"{n}=..." for n in by_name) or "arguments in their order, without names"
    message = f"there is no argument to be given as '{word} = ...'"
    place = argument.place
    return ScriptError(message, place=place, expected=known, hint=hint, code="arguments", name=word)


def convert(hub: Any, parameter: Parameter, argument: Argument, number: int | None = None) -> Any:
    """Convert an argument, the one of this number, to the value of a parameter."""
    if argument.is_null and not parameter.kind.nullable and not is_raw(parameter.kind):
        raise _misfit(parameter, argument, number, Unfit(NULL))
    try:
        return parameter.kind.convert(hub, argument)
    except Unfit as unfit:
        raise _misfit(parameter, argument, number, unfit) from None
    except ScriptError as error:
        error.place = error.place or argument.place
        error.expected = error.expected or f"{parameter.name}: {parameter.kind.text}"
        raise


def _swapped(
    hub: Any, expected: list[Parameter], bound: dict[str, list[Argument]], wrong: Parameter
) -> str | None:
    """Write the hint for two arguments of which each fits in the place of the other."""

    def fits(parameter: Parameter, argument: Argument) -> bool:
        kind = parameter.kind
        try:
            convert(hub, parameter, argument)
        except ScriptError:
            return False
        return not kind.family or registry.knows(kind.family, argument.word() or "")

    single = [p for p in expected if len(bound.get(p.name, ())) == 1 and not p.variadic]
    if wrong not in single:
        return None
    (given,) = bound[wrong.name]
    for other in single:
        (there,) = bound[other.name]
        if other != wrong and not fits(other, there) and fits(wrong, there) and fits(other, given):
            right = f"{wrong.name} {there.text}, {other.name} {given.text}"
            return f"swap {given.text} and {there.text}: {right}"
    family, after = [p.kind.family for p in (*single, *single)][:2]
    word = bound[single[0].name][0].text
    if family and registry.knows(after or "", word):
        return f"{word} is a {after}; a {family} comes first: {', '.join(registry.names(family))}"
    return None


def _misfit(
    parameter: Parameter, argument: Argument, number: int | None, unfit: Unfit
) -> ScriptError:
    which = f"argument {number} '{parameter.name}'" if number else f"'{parameter.name}'"
    family, text, hint = parameter.kind.family, parameter.kind.text, unfit.hint
    if family and NUMBER.fullmatch(argument.text):
        text, hint = f"one of {', '.join(registry.names(family))}", None
    if re.fullmatch(r"0\d\d", argument.text):  # of 1,000
        hint = "commas separate arguments: a million is 1e6 or 1000000"
    message, place = f"{which} must be {text}, not {unfit.got}", unfit.place or argument.place
    return ScriptError(message, place=place, expected=text, hint=hint, code="argument")


def _guilty(
    error: ScriptError, arguments: Sequence[Argument], bound: dict[str, list[Argument]]
) -> Place | None:
    """Find the place of the argument that an error names, or else of the word at fault."""
    if isinstance(error.argument, int) and error.argument < len(arguments):
        plain = [argument for argument in arguments if argument.keyword() is None]
        return (arguments if error.argument >= 0 else plain)[error.argument].place
    if isinstance(error.argument, str) and bound.get(error.argument):
        return bound[error.argument][0].place
    words = (error.name, f'"{error.name}"')
    return next((a.place for a in arguments if a.text in words), None)


def _joined(expected: list[Parameter]) -> str:
    """Write ``a, b[, c[, d]][, e=...]``: arguments as they are written."""
    text, open_brackets = "", 0
    for parameter in expected:
        comma = ", " if text else ""
        shown = comma + parameter.shown + (", ..." if parameter.variadic else "")
        if parameter.keyword:
            text += "]" * open_brackets + (f"[{shown}]" if parameter.optional else shown)
            open_brackets = 0
        elif parameter.optional or parameter.variadic:
            text += f"[{shown}"
            open_brackets += 1
        else:
            text += shown
    return text + "]" * open_brackets


# The commands that name styles of families without a command of their own.
_HOMES = {"transfer": "method", "basis": "method"}


def syntax(target: Callable, name: str) -> str:
    """Write the line that shows how a command or style is called."""
    own = getattr(target, "syntax", None)
    if not isinstance(own, str):
        own = _joined(documented(target))
    family, _, style = name.partition(" ")
    if not style:
        return f"{name}({own})"
    command = _HOMES.get(family, family)
    before = [style]
    if registry.knows("command", command):
        outer = parameters(registry.find("command", command))
        outer = [p for p in outer if not p.variadic and not p.keyword]
        before = [style if p.kind.family == family else p.shown for p in outer]
    if own.startswith("["):
        own = own.replace("[", "[, ", 1)
    elif own:
        own = ", " + own
    return f"{command}({', '.join(before)}{own})"


def documented(target: Callable) -> list[Parameter]:
    """List parameters for help: with the word that chooses a variant of a style."""
    variants = getattr(target, "variants", None)
    if not variants:
        return parameters(target)
    # A method chooses by it the shape of domains, which must have one.
    needed = not is_record(target)
    default = getattr(target, "default_variant", None)
    kind = kind_of(Literal[tuple(variants)])
    variant = Parameter("variant", kind, optional=not needed, default=default)
    return [variant, *parameters(target)] if needed else [*parameters(target), variant]
