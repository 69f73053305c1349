"""Convert script arguments to a Python call, and provide help.

The first parameter of a command (function) or style (class) is the hub; the annotations of the
other parameters define the arguments::

    class Gravity(Fix):
        def __init__(self, hub, group: NodeGroup, g: Annotated[float, Positive] = 9.81):

Annotations: float, int, bool, str, Literal words, Expression, InputFile, TableFile, OutputFile,
Argument (left to the callee), classes with a classmethod ``from_script(cls, hub, argument)``, and
unions of these, with None for the word NULL. Annotated adds constraints. ``*args`` take any number
of arguments; ``**numbers`` are numbers for formulas, by name. Other arguments may be given as
``name=value``; keyword-only ones must be.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from itertools import chain, repeat
from typing import Any, Literal, get_args, get_type_hints

from karamelo_py.language import explain, faults, registry
from karamelo_py.language.arguments import NULL, Argument, with_gap
from karamelo_py.language.kinds import (
    AtLeast,
    ByName,
    Constraint,
    In,
    InputFile,
    Keyword,
    NonNegative,
    OutputFile,
    Parameter,
    Positive,
    TableFile,
    Unfit,
    is_raw,
    kind_of,
)
from karamelo_py.language.scene import Scene
from karamelo_py.language.unknown import check_name, renamed
from karamelo_py.script.errors import FAILURES, ScriptError, blaming, table

__all__ = [
    "Argument", "AtLeast", "ByName", "Constraint", "In", "InputFile", "Keyword", "NonNegative",
    "OutputFile", "Parameter", "Positive", "TableFile",
]  # fmt: skip
# Other forms of a command, by its first argument.
FORMS: dict[Callable, dict[str | None, Callable]] = {}


EMPTY, KEYWORD = inspect.Parameter.empty, inspect.Parameter.KEYWORD_ONLY


@cache
def parameters(target: Any) -> list[Parameter]:
    """Return the parameters without the hub; raises TypeError for unsupported annotations."""
    record = is_record(target)
    try:
        if record and not hasattr(target, "given"):
            hints = get_type_hints(target, include_extras=True)
            defaults = target._field_defaults
            return [_of_field(n, hints[n], defaults.get(n, EMPTY)) for n in target._fields]
        function = target.given if record else target
        listed = [*inspect.signature(function, eval_str=True).parameters.values()]
    except TypeError:
        raise
    except Exception as error:
        raise TypeError(f"an annotation cannot be evaluated ({error})") from error
    return [_parameter(p.name, p.annotation, p.default, p.kind) for p in listed[not record :]]


def is_record(target: Any) -> bool:
    """Return True for a NamedTuple, which needs no hub.

    The arguments of a NamedTuple are the fields, or the parameters of a classmethod ``given``. A
    method ``checked`` may return a replacement.
    """
    return inspect.isclass(target) and issubclass(target, tuple)


def _of_field(field: str, annotation: Any, default: Any) -> Parameter:
    named = next((one for one in get_args(annotation) if isinstance(one, Keyword)), None)
    if named is None:
        return _parameter(field, annotation, default)
    return replace(_parameter(named.name or field, annotation, default, KEYWORD), field=field)


def _parameter(name: str, annotation: Any, default: Any, kind: Any = None) -> Parameter:
    optional = default is not EMPTY
    return Parameter(
        name,
        kind_of(annotation),
        variadic=kind is inspect.Parameter.VAR_POSITIONAL,
        keyword=kind is KEYWORD,
        optional=optional,
        default=default if optional else None,
    )


def call(
    target: Callable, hub: Scene, arguments: Sequence[Argument], name: str, converted: Any = None
) -> Any:
    """Call a command or make a style; store the arguments in `converted`.

    `name` is for messages, such as ``run`` or ``fix body_force``. Raises ScriptError with a mark.
    """
    if arguments and target in FORMS:
        # The word of a form takes precedence over a variable.
        words = arguments[0].text, arguments[0].word()
        target = next((FORMS[target][word] for word in words if word in FORMS[target]), target)
    try:
        expected = parameters(target)
    except TypeError as error:
        raise ScriptError(f"{name} is broken: {error}") from error
    bound: dict[str, list[Argument]] = {}
    try:
        _bind(target, expected, arguments, name, bound)
        values: list[Any] = []
        named: dict[str, Any] = {}
        in_order = True
        for parameter in expected:
            in_order &= parameter.name in bound and not parameter.keyword
            for argument in bound.get(parameter.name, ()):
                number = len(values) + 1 if in_order else None
                try:
                    value = convert(hub, parameter, argument, number)
                except ScriptError as error:
                    error.hint = explain.swapped(hub, expected, bound, parameter) or error.hint
                    error.hint = error.hint or table()["misfits"].get(name)
                    raise
                if in_order:
                    values.append(value)
                else:
                    named[parameter.field or parameter.name] = value
                if converted is not None:
                    before = converted.get(parameter.name, ())
                    converted[parameter.name] = (*before, value) if parameter.variadic else value
        try:
            return make(target, hub, name, *values, **named)
        except OSError as error:
            file = f"{error.filename}: " if error.filename else ""
            raise ScriptError(f"{file}{error.strerror or error}", code="file") from error
        except OverflowError as error:
            message = "a number is too large for this calculation"
            raise ScriptError(message, expected="numbers of compatible magnitude") from error
        except MemoryError as error:
            message = "there is not enough memory for this"
            raise ScriptError(message, hint="use larger cells or fewer points") from error
    except ScriptError as error:
        for wrong in () if error.complete else (error, *error.others):
            if not wrong.code.startswith("unknown-"):
                wrong.hint = explain.comma_in_number(arguments, wrong.surplus) or wrong.hint
            if wrong.code == "argument":
                wrong.hint = explain.decimal_of_name(arguments, wrong) or wrong.hint
            if wrong.surplus:
                wrong.hint = explain.in_parentheses(arguments) or wrong.hint
            if wrong.code == "arguments" and wrong.hint is None and (gap := with_gap(arguments)):
                wrong.mark, wrong.hint = gap.mark, f"is a comma missing in '{gap.text}'?"
            wrong.mark = wrong.mark or explain.guilty(wrong, arguments, bound)
            if wrong.code == "by-position" and not wrong.command:
                which = wrong.name if any(p.name == wrong.name for p in expected) else "arguments"
                wrong.message = f"{which} of {name}: given by position, without a name"
                wrong.expected, wrong.code = syntax(target, name), "arguments"
            wrong.command = wrong.command or name
        raise


def style_of(
    hub: Scene,
    family: str,
    ID: str,
    style: str,
    arguments: Sequence[Argument],
    *,
    values: dict | None = None,
) -> Any:
    with in_new_words(family, ID, style, arguments):
        target = registry.called(family, ID, style)
        return call(target, hub, arguments, f"{family} {style}", values)


def remade(
    hub: Scene, family: str, style: str, values: dict, arguments: Sequence[Argument]
) -> tuple[Any, dict]:
    target, name = registry.find(family, style), f"{family} {style}"
    expected = {p.name: p for p in parameters(target)}
    bound: dict[str, list[Argument]] = {}
    try:
        for argument in arguments:
            word, value = argument.keyword() or ("", argument)
            if not word:
                choices = ", ".join(f"{n}=..." for n in expected)
                message = f"'{argument.text}' has no name"
                raise ScriptError(message, mark=argument.mark, expected=choices)
            if word not in expected:
                form = syntax(target, name)
                raise explain.unknown_keyword(word, argument, [*expected.values()], name, form)
            bound[word] = [value]
            values = values | {word: convert(hub, expected[word], value)}
        several = next((p.name for p in expected.values() if p.variadic), None)
        if several is None:
            fields = {expected[n].field or n: value for n, value in values.items()}
            return make(target, hub, name, **fields), values
        names = [*expected]
        first = [values[n] for n in names[: names.index(several)]]
        last = {n: values[n] for n in names[names.index(several) + 1 :] if n in values}
        return make(target, hub, name, *first, *values.get(several, ()), **last), values
    except ScriptError as error:
        error.mark = error.mark or explain.guilty(error, arguments, bound)
        error.command = error.command or name
        raise


@contextmanager
def in_new_words(family: str, ID: str, style: str, arguments: Sequence[Argument]) -> Iterator[None]:
    try:
        yield
    except ScriptError as error:
        if not arguments or not registry.knows(family, style):
            words = [argument.text for argument in arguments]
            right = next((word for word in words if registry.knows(family, word)), None)
            first = ", ".join(filter(None, (ID, right, style)))
            swapped = f"{family}({first}, ...)" if right else None
            error.hint = renamed(family, style, ID, words) or swapped or error.hint
        raise


def make(target: Callable, hub: Scene, name: str, *values: Any, **named: Any) -> Any:
    """Make a style from values. Errors other than ScriptError are faults of the style."""
    is_class = inspect.isclass(target)
    try:
        if not is_record(target):
            return target(hub, *values, **named)
        made = (
            target.given(*values, **named) if hasattr(target, "given") else target(*values, **named)
        )
        return made.checked() if hasattr(made, "checked") else made
    except faults.KNOWN:
        raise
    except FAILURES as error:
        if not is_class and not registry.is_foreign(target):
            raise
        where = "__init__" if is_class else "it"
        raise faults.of_style(error, name, where, target, hub.mark) from error


def _bind(
    target: Callable,
    expected: list[Parameter],
    arguments: Sequence[Argument],
    name: str,
    bound: dict[str, list[Argument]],
) -> None:
    slots = [p for p in expected if not p.keyword]
    variadic = next((p for p in slots if p.variadic), None)
    formula = next((p.name for p in expected if p.kind.with_numbers), None)
    numbers: dict[str, Argument] = {}
    positional: list[Argument] = []
    # The style itself checks names of raw arguments.
    passed_on = variadic is not None and is_raw(variadic.kind)
    by_name = {p.name for p in expected if p.keyword or not (p.variadic or passed_on)}
    for argument in arguments:
        word, value = argument.keyword() or ("", argument)
        if not word or (passed_on and word not in by_name):
            if before := next((p.name for p in slots if p.name in bound), None):
                message = f"{argument.text} has no name, and follows {before}=..."
                hint = "arguments by position come first, then those by name"
                raise ScriptError(message, mark=argument.mark, hint=hint, code="arguments")
            positional.append(argument)
        elif word in bound or word in numbers:
            raise ScriptError(f"{word} is given twice", mark=argument.mark)
        elif word in (p.name for p in slots[: len(positional)]):
            message = f"{word} is given twice: by position and as {word}="
            raise ScriptError(message, mark=argument.mark)
        elif word in by_name:
            bound[word] = [value]
        elif formula:
            with blaming(argument.mark):
                check_name(word)
            numbers[word] = value
        else:
            raise explain.unknown_keyword(word, argument, expected, name, syntax(target, name))
    slots = [p for p in slots if p.name not in bound]
    needed = sum(not (p.optional or p.variadic) for p in slots)
    missing = [p.name for p in expected if p.keyword and not p.optional and p.name not in bound]
    if len(positional) < needed or missing or (variadic is None and len(positional) > len(slots)):
        rest = [p for p in expected if p.keyword or p in slots]
        raise explain.wrong_count(syntax(target, name), name, rest, positional, missing)
    for argument, parameter in zip(positional, chain(slots, repeat(variadic)), strict=False):
        if parameter is not None:
            bound.setdefault(parameter.name, []).append(argument)
    if formula and numbers:
        for word in bound[formula][0].take(numbers):
            wrong = next(one for one in arguments if (one.keyword() or ("",))[0] == word)
            raise explain.unknown_keyword(word, wrong, expected, name, syntax(target, name))


def convert(hub: Scene, parameter: Parameter, argument: Argument, number: int | None = None) -> Any:
    if argument.is_null and not parameter.kind.nullable and not is_raw(parameter.kind):
        raise explain.misfit(parameter, argument, number, Unfit(NULL))
    try:
        return parameter.kind.convert(hub, argument)
    except Unfit as unfit:
        raise explain.misfit(parameter, argument, number, unfit) from None
    except ScriptError as error:
        error.mark = error.mark or argument.mark
        error.expected = error.expected or f"{parameter.name}: {parameter.text}"
        raise


def _joined(expected: list[Parameter]) -> str:
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
    numbers = "[, number=...]" if any(p.kind.with_numbers for p in expected) else ""
    return text + "]" * open_brackets + numbers


# For families without a command: the command that names their styles.
_HOMES = {"transfer": "method", "basis": "method"}


def syntax(target: Callable, name: str) -> str:
    form = getattr(target, "syntax", None)
    if not isinstance(form, str):
        form = _joined(documented(target))
    family, _, style = name.partition(" ")
    if not style:
        return f"{name}({form})"
    command = _HOMES.get(family, family)
    before = [style]
    if registry.knows("command", command):
        outer = parameters(registry.find("command", command))
        outer = [p for p in outer if not p.variadic and not p.keyword]
        before = [style if p.kind.family == family else p.shown for p in outer]
    if form.startswith("["):
        form = form.replace("[", "[, ", 1)
    elif form:
        form = ", " + form
    return f"{command}({', '.join(before)}{form})"


def variants_of(style: Any) -> Mapping[str, Any]:
    return getattr(style, "variants", {})


def default_variant(style: Any) -> str | None:
    return getattr(style, "default_variant", None)


def documented(target: Callable) -> list[Parameter]:
    """Return the parameters for help, with the word that selects a variant."""
    variants = variants_of(target)
    if not variants:
        return parameters(target)
    # In a method, the word selects the shape of the domains, and is required.
    needed = not is_record(target)
    kind = kind_of(Literal[tuple(variants)])
    variant = Parameter("variant", kind, optional=not needed, default=default_variant(target))
    return [variant, *parameters(target)] if needed else [*parameters(target), variant]
