"""Kinds of arguments, by annotation."""

import inspect
import math
import os
import re
import sys
from collections.abc import Callable, Container, Hashable
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from karamelo_py.language import registry
from karamelo_py.language.arguments import NULL, NUMBER, Argument
from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import Mark, ScriptError, meant, table
from karamelo_py.script.expressions import Expression, Value
from karamelo_py.script.functions import CONSTANTS, WORDS
from karamelo_py.script.terms import number_text

_LARGEST_INTEGER = 2**53  # above it, floats cannot represent all integers


def _rounding(value: float) -> float:
    """Return the tolerance within which a result such as 0.3/0.1 is an integer."""
    return min(1e-9 * max(abs(value), 1), 1e-3)


@dataclass(frozen=True)
class Keyword:
    """Marks a field given as ``name=value``, by default with the name of the field."""

    name: str = ""


Of = TypeVar("Of")
ByName = Annotated[Of, Keyword()]


@dataclass(frozen=True)
class Constraint:
    text: str
    holds: Callable[[float], bool]


Positive = Constraint("above 0", lambda value: value > 0)
NonNegative = Constraint("of at least 0", lambda value: value >= 0)


def AtLeast(least: float) -> Constraint:
    return Constraint(f"of at least {least:g}", lambda value: value >= least)


def In(lo: float, hi: float, open: bool | Literal["lo", "hi", "both"] = False) -> Constraint:
    """Constrain a number to an interval; `open` names the excluded ends (True: both ends)."""
    above = open in (True, "lo", "both")
    below = open in (True, "hi", "both")

    def holds(value: float) -> bool:
        return (value > lo if above else value >= lo) and (value < hi if below else value <= hi)

    text = f"from {lo:g} to {hi:g}"
    if above and below:
        text = f"between {lo:g} and {hi:g}, both excluded"
    elif above or below:
        text += f", {lo if above else hi:g} excluded"
    return Constraint(text, holds)


class InputFile:
    """Script argument: a file in the current folder or the folder of the script."""

    script_kind = "the name of a file"
    # Lower-case endings that are accepted; None: any.
    endings: Container[str] | None = None

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Path:
        name = _file_name(argument)
        folders = argument._interpreter.folders
        if path := next((f / name for f in folders if (f / name).is_file()), None):
            return path
        here = folders[-1] / name
        files = [p for p in here.parent.glob("*") if p.is_file()]
        if cls.endings is not None:
            files = [p for p in files if p.suffix.lower() in cls.endings]
        problem = "is a folder, not a file" if here.is_dir() else "does not exist"
        if here.exists() and not here.is_dir():
            problem = "is a pipe or a device, not a file"
        expected = "a file in the current folder or the folder of the script"
        words = re.split(r"[\s,;]+", name.strip())
        hint = meant(here.name, [p.name for p in files])
        if all(map(NUMBER.fullmatch, words)):
            hint = f"numbers are separated by commas, without quotes: {', '.join(words)}"
        message = f"the file {name} {problem}"
        mark, code = argument.mark, "no-file"
        raise ScriptError(message, mark=mark, expected=expected, hint=hint, code=code)


class TableFile(InputFile):
    endings = ("", ".csv", ".dat", ".tsv", ".txt", ".h5", ".pvd", ".vtu", ".gz", ".lammps", ".xyz")


class OutputFile:
    """Script argument: a file to write; its folder must exist."""

    script_kind = "the name of a file"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Path:
        name = _file_name(argument)
        path = hub.folder / name
        encoding = sys.getfilesystemencoding()
        try:
            os.fsencode(name)
        except UnicodeEncodeError:
            message = f"{name} cannot be the name of a file here, where these are in {encoding}"
            hint = "the environment variable PYTHONUTF8=1, or another name"
            raise ScriptError(message, mark=argument.mark, hint=hint) from None
        # A run makes the folder given by -out, so it may be missing in `check`.
        made = hub.checking and path.parent == hub.folder
        if not (path.parent.is_dir() or made):
            folder, expected = Path(name).parent, "a file in a folder that exists"
            message, hint = f"the folder {folder} does not exist", f"mkdir {folder}"
            raise ScriptError(message, mark=argument.mark, expected=expected, hint=hint)
        if path.is_dir() or name.endswith(("/", "\\")):
            message, expected = f"{name} is a folder", "the name of a file"
            raise ScriptError(message, mark=argument.mark, expected=expected)
        return Path(name)


def _file_name(argument: Argument) -> str:
    name = argument.words()
    if not name.strip() or "\0" in name or name == NULL:
        message, expected = "a file name is missing", "the name of a file"
        raise ScriptError(message, mark=argument.mark, expected=expected)
    return os.path.expanduser(name)


class Unfit(Exception):
    def __init__(self, got: str, mark: Mark | None = None, hint: str | None = None):
        super().__init__(got)
        self.got = got
        self.mark = mark
        self.hint = hint


@dataclass(frozen=True)
class Kind:
    """The description of an argument, and its conversion from text.

    If there are `words`, only these words are accepted. `family` is set if the argument names a
    style of this family. If `with_numbers`, arguments ``name=value`` of the call are numbers in it.
    """

    text: str
    convert: Callable[[Any, Argument], Any]
    words: tuple[str, ...] = ()
    nullable: bool = False
    family: str | None = None
    with_numbers: bool = False


class WithNumbers:
    """Base of formulas that may contain numbers named in the same call."""


def _shown(value: Value) -> str:
    if isinstance(value, str):
        return f"the text '{value}'"
    if isinstance(value, Expression):
        return f"the formula {value.text}"
    return number_text(value)


def _to_number(hub: Scene, argument: Argument) -> float:
    if argument.text.lstrip("+-") in WORDS and argument.text not in argument._interpreter.variables:
        raise Unfit(argument.text)
    try:
        value = argument.value(hub)
    except ScriptError as error:
        _suggest_numbers(argument, error)
        raise
    if isinstance(value, Expression):
        names = ", ".join(sorted(value.names))
        raise Unfit(f"a formula of {names}", hint=f"value({argument.text}) is its present value")
    if isinstance(value, str):
        number = value.strip()
        hint = f"write numbers without quotes: {number}" if NUMBER.fullmatch(number) else None
        raise Unfit(_shown(value), hint=hint)
    if math.isnan(value) and not hub.rehearsing:
        raise Unfit("NaN, which is not a number")
    return value


def _suggest_numbers(argument: Argument, error: ScriptError) -> None:
    name, alike, numbers = error.name or "", error.alike, argument.numbers()
    if error.code != "unknown-name" or alike is None or "value" in argument.text:
        return
    if alike not in (*CONSTANTS, *numbers):
        choices = ", ".join(numbers) or "none so far"
        error.expected = f"a number, or a variable that is one ({choices})"
        error.hint = meant(name, numbers) or f"set it first: {name} = ..."


def _to_integer(hub: Scene, argument: Argument) -> int:
    value = _to_number(hub, argument)
    if math.isnan(value):
        return 1  # in a rehearsal the value is unknown; 1 passes all checks
    if math.isinf(value) or abs(value - round(value)) > _rounding(value):
        raise Unfit(number_text(value))
    if abs(value) > _LARGEST_INTEGER:
        raise Unfit(f"{number_text(value)}, which is too large")
    return round(value)


def _to_text(hub: Scene, argument: Argument) -> str:
    word = argument.words()
    if word == argument.text:
        if NUMBER.fullmatch(word):
            raise Unfit(f"the number {word}", hint=f"begin it with a letter, such as n{word}")
        if re.search(r"[(),=]", word):
            raise Unfit(word, hint="a word with such characters needs quotes")
    if not word:
        raise Unfit("an empty text")
    return word


@dataclass(frozen=True)
class StyleOf:
    """Script argument: a style, whose name takes precedence over a variable."""

    family: str
    script_kind = "a word"

    def from_script(self, hub: Scene, argument: Argument) -> str:
        if registry.knows(self.family, argument.text):
            return argument.text
        joined = "-".join(argument.text.split())
        if registry.knows(self.family, joined):
            raise Unfit(f"'{argument.text}'", hint=f"did you mean '{joined}'?")
        return _to_text(hub, argument)


def _to_expression(hub: Scene, argument: Argument) -> Expression:
    value = argument.value(hub)
    if isinstance(value, str):
        raise Unfit(_shown(value), hint=f"write formulas without quotes: {value}")
    return Expression(value)


def _of_words(words: tuple[str, ...]) -> Callable[[Any, Argument], str]:
    def convert(hub: Scene, argument: Argument) -> str:
        word = argument.words(words)
        if word not in words:
            raise _no_word_of(words, word, argument)
        return word

    return convert


def _no_word_of(words: tuple[str, ...], word: str, argument: Argument) -> Unfit:
    value, got = argument._interpreter.variables.get(word), f"'{word}'"
    literal = bool(NUMBER.fullmatch(word))
    if isinstance(value, float):
        got += f", which is {number_text(value)}"
    elif literal:
        value = float(word)
    other = table()["words"].get(word)
    hint = f"write {other}" if other in words else meant(word, words)
    if words == TRUTH and value in (0, 1):
        truth = TRUTH[not value]
        hint = f"write {truth}" if literal else f'write {word} = "{truth}"'
    return Unfit(got, hint=hint)


TRUTH = ("true", "false")

_RAW = Kind("anything", lambda hub, argument: argument)
_SIMPLE = {
    float: Kind("a number", _to_number),
    int: Kind("a whole number", _to_integer),
    str: Kind("a word", _to_text),
    bool: Kind(
        "true or false",
        lambda hub, argument: _of_words(TRUTH)(hub, argument) == "true",
        words=TRUTH,
    ),
    Expression: Kind("a number or a formula", _to_expression),
    Argument: _RAW,
    **dict.fromkeys((Any, inspect.Parameter.empty), Kind("anything", _RAW.convert)),
}


def kind_of(annotation: Any) -> Kind:
    """Return the kind of an annotation; raises TypeError if it is not supported."""
    if annotation in (None, NoneType):
        return Kind(NULL, lambda hub, argument: None, nullable=True)
    if get_origin(annotation) is Annotated:
        base, *details = get_args(annotation)
        named = (d for d in details if hasattr(d, "from_script") or get_origin(d) is Literal)
        by = next(named, base)
        constraints = [detail for detail in details if isinstance(detail, Constraint)]
        return _constrained(kind_of(by), constraints) if constraints else kind_of(by)
    if get_origin(annotation) is Literal:
        words = tuple(str(word) for word in get_args(annotation))
        text = f"the word {words[0]}" if len(words) == 1 else f"one of {', '.join(words)}"
        return Kind(text, _of_words(words), words)
    if get_origin(annotation) in (Union, UnionType):
        return _union([kind_of(member) for member in get_args(annotation)])
    if isinstance(annotation, Hashable) and annotation in _SIMPLE:
        return _SIMPLE[annotation]
    if hasattr(annotation, "from_script"):
        text = getattr(annotation, "script_kind", "")
        if not text:
            name = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", annotation.__name__).lower()
            text = f"the ID of a {name}"
        family = annotation.family if isinstance(annotation, StyleOf) else None
        numbers = isinstance(annotation, type) and issubclass(annotation, WithNumbers)
        return Kind(text, annotation.from_script, family=family, with_numbers=numbers)
    raise TypeError(f"a signature cannot have the annotation {annotation!r}")


def is_raw(kind: Kind) -> bool:
    return kind is _RAW


def _constrained(kind: Kind, constraints: list[Constraint]) -> Kind:
    def convert(hub: Scene, argument: Argument) -> Any:
        value = kind.convert(hub, argument)
        number = value.constant if isinstance(value, Expression) and value.is_constant else value
        if isinstance(number, (int, float)) and not math.isnan(number):
            for constraint in constraints:
                if not constraint.holds(number):
                    raise Unfit(number_text(number))
        return value

    text = " ".join([kind.text, *(constraint.text for constraint in constraints)])
    return Kind(text, convert, kind.words, kind.nullable)


def _union(kinds: list[Kind]) -> Kind:
    nullable = any(kind.nullable for kind in kinds)
    words = tuple(word for kind in kinds for word in kind.words)
    # Words are tried first, as they take precedence over variables.
    tried = sorted((kind for kind in kinds if kind.text != NULL), key=lambda kind: not kind.words)

    def convert(hub: Scene, argument: Argument) -> Any:
        if nullable and argument.is_null:
            return None
        last: Exception | None = None
        for kind in tried:
            try:
                return kind.convert(hub, argument)
            except (Unfit, ScriptError) as error:
                last = error
        if isinstance(last, ScriptError) and last.code == "unknown-name":
            last.hint = meant(last.name or "", words) or last.hint
        raise last or Unfit(argument.text)

    return Kind(" or ".join(kind.text for kind in kinds), convert, words, nullable)


@dataclass(frozen=True)
class Parameter:
    name: str
    kind: Kind
    variadic: bool = False
    keyword: bool = False
    optional: bool = False
    default: Any = None
    description: str = ""
    field: str = ""

    @property
    def text(self) -> str:
        by_default = self.optional and self.default is None
        return self.kind.text.removesuffix(" or NULL") if by_default else self.kind.text

    @property
    def shown(self) -> str:
        if self.keyword:
            return f"{self.name}={'|'.join(self.kind.words) or self.name}"
        if len(self.kind.words) == 1:
            alone = self.kind.text.startswith("the word ")
            return self.kind.words[0] if alone else f"{self.name}|{self.kind.words[0]}"
        if self.kind.words and self.kind.text.startswith("one of "):
            return "|".join(self.kind.words)
        return self.name
