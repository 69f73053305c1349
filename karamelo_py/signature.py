"""The signature is the syntax: from a script's arguments to a Python call, and to help about it.

Commands are functions and styles are classes; the first parameter is the hub, the others say by
their annotations what a script has to give::

    class Gravity(Fix):
        def __init__(self, hub, group: NodeGroup, g: Annotated[float, Positive] = 9.81):

Annotations that are understood: float, int, bool, str, Literal words, Expression, InputFile,
OutputFile, Argument (left to the callee), any class with a classmethod
``from_script(cls, hub, argument)``, and unions of these, where None is the word NULL. Constraints
are added with Annotated. ``*args`` take any number, keyword-only parameters are given as
``name=value``.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

from karamelo_py import registry
from karamelo_py.script.errors import Place, ScriptError, nearest
from karamelo_py.script.expressions import Expression, Formula, Value, number_text
from karamelo_py.script.functions import WORDS
from karamelo_py.script.parser import parse_expression
from karamelo_py.script.syntax import Raw

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

NULL = "NULL"
_NAME = re.compile(r"[^\W\d]\w*")
_QUOTED = re.compile(r'"([^"]*)"')
# Two words with nothing but blanks between them.
_GAP = re.compile(r'[\w)"]\s+["\w.]')
_KEYWORD = re.compile(r"([^\W\d]\w*)\s*=(?!=)")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


# ---- arguments ----------------------------------------------------------------------------------


class Argument:
    """One argument of a call as the script has it, not evaluated.

    Attributes
    ----------
    text : str
        What is written, without blanks around it.
    place : Place
        Where it stands.
    """

    def __init__(self, raw: Raw, interpreter: Any):
        code = raw.code
        start = raw.start + len(code) - len(code.lstrip())
        self._raw = Raw(raw.source, start, start + len(code.strip()))
        self._interpreter = interpreter
        self.text = code.strip()
        if "\n" in raw.source.text[self._raw.start : self._raw.end]:
            self.text = re.sub(r"\s+", " ", self.text)

    @property
    def place(self) -> Place:
        return self._raw.place

    def __repr__(self) -> str:
        return f"Argument({self.text!r})"

    @property
    def is_null(self) -> bool:
        """Whether it is the word NULL."""
        return self.text == NULL

    def word(self) -> str | None:
        """The word it is: bare, in quotes, or the content of a text variable; None for arithmetic.

        Words such as ``neo-hookean`` or ``dump.*.gz`` count unless a name in them is known, which
        makes them arithmetic.
        """
        quoted = _QUOTED.fullmatch(self.text)
        if quoted:
            return quoted[1]
        if _NAME.fullmatch(self.text):
            variable = self._interpreter.variables.get(self.text)
            return variable if isinstance(variable, str) else self.text
        if not self.text or re.search(r'[\s()",=<>]', self.text) or _NUMBER.fullmatch(self.text):
            return None
        names = _NAME.findall(self.text)
        known = not names or any(self._interpreter.knows(name) for name in names)
        return None if known else self.text

    def words(self, known: Sequence[str] = ()) -> str:
        """The text it stands for where only a word will do, arithmetic or not.

        Raises
        ------
        ScriptError
            If it cannot be meant as a word.
        """
        if self.text in known:
            return self.text
        quoted = _QUOTED.fullmatch(self.text)
        if quoted:
            return quoted[1]
        if '"' in self.text:
            value = self.value(None)
            if isinstance(value, str):
                return value
            raise ScriptError(f"{self.text} is not a text", place=self.place)
        variable = self._interpreter.variables.get(self.text)
        if isinstance(variable, str):
            return variable
        if re.search(r"\s", self.text):
            first, second = self.text.split()[:2]
            raise ScriptError(
                f"'{self.text}' is more than one word",
                place=self.place,
                hint=f'is a comma missing: "{first}, {second}"? A name with blanks needs quotes',
            )
        return self.text

    def value(self, hub: Hub | None) -> Value:
        """The number, text or formula it stands for.

        Raises
        ------
        ScriptError
            With the place of what is wrong inside the argument.
        """
        if self.is_null:
            raise ScriptError(
                "NULL cannot be used here", place=self.place, expected="a number or a formula"
            )
        return self._interpreter.evaluate(parse_expression(self._raw), self._raw)

    def keyword(self) -> tuple[str, Argument] | None:
        """Name and value if it is written ``name = value``."""
        match = _KEYWORD.match(self.text)
        if not match:
            return None
        start = self._raw.source.text.index("=", self._raw.start) + 1
        return match[1], Argument(Raw(self._raw.source, start, self._raw.end), self._interpreter)


# ---- constraints and files ----------------------------------------------------------------------


@dataclass(frozen=True)
class Constraint:
    """What a number has to fulfil: `text` says it, `holds` decides."""

    text: str
    holds: Callable[[float], bool]


Positive = Constraint("above 0", lambda value: value > 0)
NonNegative = Constraint("of at least 0", lambda value: value >= 0)


def AtLeast(least: float) -> Constraint:
    """A number of at least `least`."""
    return Constraint(f"of at least {least:g}", lambda value: value >= least)


def In(lo: float, hi: float, open: bool | Literal["lo", "hi", "both"] = False) -> Constraint:
    """A number between `lo` and `hi`; the ends named by `open` (True: both) are excluded."""
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
    """For signatures: a file to read, looked for in the current folder, then beside the script."""

    script_kind = "the name of a file"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Path:
        """The path of the file."""
        name = _file_name(argument)
        folders = [getattr(hub, "folder", Path()), argument._interpreter.folder]
        for folder in folders:
            path = folder / name
            if path.is_file():
                return path
        here = folders[-1] / name
        siblings = [p.name for p in here.parent.iterdir()] if here.parent.is_dir() else []
        close = nearest(here.name, siblings)
        what = "is a folder, not a file" if here.is_dir() else "does not exist"
        raise ScriptError(
            f"the file {name} {what}",
            place=argument.place,
            expected="a file in the current folder or beside the script",
            hint=f"did you mean {close}?" if close else None,
        )


class OutputFile:
    """For signatures: a file to write; its folder must exist."""

    script_kind = "the name of a file"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Path:
        """The path of the file."""
        name = _file_name(argument)
        path = getattr(hub, "folder", Path()) / name
        if not path.parent.is_dir():
            parent = Path(name).parent
            raise ScriptError(
                f"the folder {parent} does not exist",
                place=argument.place,
                expected="a file in a folder that exists",
                hint=f"mkdir {parent}",
            )
        if path.is_dir() or name.endswith(("/", "\\")):
            raise ScriptError(
                f"{name} is a folder", place=argument.place, expected="the name of a file"
            )
        return Path(name)


def _file_name(argument: Argument) -> str:
    name = argument.words()
    if not name.strip() or "\0" in name or name == NULL:
        raise ScriptError(
            "a file name is missing", place=argument.place, expected="the name of a file"
        )
    return name


# ---- conversion ---------------------------------------------------------------------------------


class _Unfit(Exception):
    """An argument is of another kind; `got` says what it is."""

    def __init__(self, got: str, place: Place | None = None, hint: str | None = None):
        super().__init__(got)
        self.got = got
        self.place = place
        self.hint = hint


@dataclass(frozen=True)
class Kind:
    """What an argument has to be: said in words, and how to make it from an argument."""

    text: str
    convert: Callable[[Any, Argument], Any]
    words: tuple[str, ...] = ()
    nullable: bool = False


def _shown(value: Value) -> str:
    if isinstance(value, str):
        return f"the text '{value}'"
    if isinstance(value, Formula):
        return f"the formula {value.text}"
    return number_text(value)


def _to_number(hub: Any, argument: Argument) -> float:
    if argument.is_null:
        raise _Unfit(NULL)
    if argument.text.lstrip("+-") in WORDS and argument.text not in argument._interpreter.variables:
        raise _Unfit(argument.text)
    value = argument.value(hub)
    if isinstance(value, Formula):
        raise _Unfit(
            f"a formula of {', '.join(sorted(value.names))}",
            hint=f"value({argument.text}) is its present value",
        )
    if isinstance(value, str):
        raise _Unfit(_shown(value))
    if math.isnan(value) and not getattr(hub, "rehearsing", False):
        raise _Unfit("NaN, which is not a number")
    return value


def _to_integer(hub: Any, argument: Argument) -> int:
    value = _to_number(hub, argument)
    if math.isnan(value):
        return 1  # A result that a rehearsal does not have; 1 passes every check.
    if math.isinf(value) or value != math.floor(value):
        raise _Unfit(number_text(value))
    return int(value)


def _to_text(hub: Any, argument: Argument) -> str:
    if argument.is_null:
        raise _Unfit(NULL)
    word = argument.words()
    if word == argument.text:
        if _NUMBER.fullmatch(word):
            raise _Unfit(f"the number {word}")
        if re.search(r"[(),=]", word):
            raise _Unfit(word, hint="a word with such signs needs quotes")
    if not word:
        raise _Unfit("an empty text")
    return word


def _to_expression(hub: Any, argument: Argument) -> Expression:
    if argument.is_null:
        raise _Unfit(NULL)
    value = argument.value(hub)
    if isinstance(value, str):
        raise _Unfit(_shown(value))
    return Expression(value)


def _of_words(words: tuple[str, ...]) -> Callable[[Any, Argument], str]:
    def convert(hub: Any, argument: Argument) -> str:
        word = argument.words(words)
        if word not in words:
            close = nearest(word, words)
            raise _Unfit(
                f"'{word}'" if word != NULL else NULL,
                hint=f"did you mean '{close}'?" if close else None,
            )
        return word

    return convert


_SIMPLE = {
    float: Kind("a number", _to_number),
    int: Kind("a whole number", _to_integer),
    str: Kind("a word", _to_text),
    bool: Kind(
        "true or false",
        lambda hub, argument: _of_words(("true", "false"))(hub, argument) == "true",
        words=("true", "false"),
    ),
    Expression: Kind("a number or a formula", _to_expression),
    Argument: Kind("anything", lambda hub, argument: argument),
    Any: Kind("anything", lambda hub, argument: argument),
    inspect.Parameter.empty: Kind("anything", lambda hub, argument: argument),
}


def kind_of(annotation: Any) -> Kind:
    """What an annotation asks for.

    Raises
    ------
    TypeError
        If the annotation is none of those that are understood.
    """
    if annotation in (None, NoneType):
        return Kind(NULL, lambda hub, argument: None, nullable=True)
    if get_origin(annotation) is Annotated:
        base, *constraints = get_args(annotation)
        return _constrained(kind_of(base), [c for c in constraints if isinstance(c, Constraint)])
    if get_origin(annotation) is Literal:
        words = tuple(str(word) for word in get_args(annotation))
        text = f"the word {words[0]}" if len(words) == 1 else f"one of {', '.join(words)}"
        return Kind(text, _of_words(words), words)
    if get_origin(annotation) in (Union, UnionType):
        return _union([kind_of(member) for member in get_args(annotation)])
    try:
        return _SIMPLE[annotation]
    except (KeyError, TypeError):
        pass
    if hasattr(annotation, "from_script"):
        return Kind(_class_kind(annotation), annotation.from_script)
    raise TypeError(f"a signature cannot have the annotation {annotation!r}")


def _class_kind(cls: type) -> str:
    if hasattr(cls, "script_kind"):
        return cls.script_kind
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__).lower()
    if words in ("any group", "group"):
        words = "group"
    return f"the ID of a {words}" if words != "quantity" else "a quantity"


def _constrained(kind: Kind, constraints: list[Constraint]) -> Kind:
    def convert(hub: Any, argument: Argument) -> Any:
        value = kind.convert(hub, argument)
        number = value.constant if isinstance(value, Expression) and value.is_constant else value
        if isinstance(number, (int, float)) and not math.isnan(number):
            for constraint in constraints:
                if not constraint.holds(number):
                    raise _Unfit(number_text(number))
        return value

    text = " ".join([kind.text, *(constraint.text for constraint in constraints)])
    return Kind(text, convert, kind.words, kind.nullable)


def _union(kinds: list[Kind]) -> Kind:
    nullable = any(kind.nullable for kind in kinds)
    words = tuple(word for kind in kinds for word in kind.words)
    # Words first: a literal word that is known wins over a variable of that name.
    others = [kind for kind in kinds if not kind.words and kind.text != NULL]
    choosers = [kind for kind in kinds if kind.words]

    def convert(hub: Any, argument: Argument) -> Any:
        if nullable and argument.is_null:
            return None
        last: Exception | None = None
        for kind in choosers:
            try:
                return kind.convert(hub, argument)
            except (_Unfit, ScriptError) as error:
                last = error
        for kind in others:
            try:
                return kind.convert(hub, argument)
            except (_Unfit, ScriptError) as error:
                last = error
        raise last or _Unfit(argument.text)

    return Kind(" or ".join(kind.text for kind in kinds), convert, words, nullable)


# ---- signatures ---------------------------------------------------------------------------------


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
        """How it appears in a line of syntax."""
        if len(self.kind.words) == 1:
            return self.kind.words[0]
        if self.kind.words and self.kind.text.startswith("one of "):
            return "|".join(self.kind.words)
        return f"{self.name}={self.name}" if self.keyword else self.name


_signatures: dict[Any, list[Parameter]] = {}


def parameters(target: Callable) -> list[Parameter]:
    """The parameters of a command or style, without the hub.

    Raises
    ------
    TypeError
        If the signature cannot be understood (a fault of whoever wrote it).
    """
    if target not in _signatures:
        function = target.__init__ if inspect.isclass(target) else target
        function = inspect.unwrap(function)
        found = list(inspect.signature(function).parameters.values())
        skipped = 2 if inspect.isclass(target) else 1  # self and hub
        _signatures[target] = [_parameter(p, function) for p in found[skipped:]]
    return _signatures[target]


def _parameter(parameter: inspect.Parameter, function: Any) -> Parameter:
    annotation = parameter.annotation
    if isinstance(annotation, str):
        # One by one: types that are imported for checking only may stand elsewhere.
        try:
            annotation = eval(annotation, function.__globals__)
        except Exception as error:
            raise TypeError(
                f"the annotation {annotation!r} of {parameter.name} cannot be evaluated ({error}); "
                "import it outside of TYPE_CHECKING"
            ) from error
    optional = parameter.default is not parameter.empty
    return Parameter(
        parameter.name,
        kind_of(annotation),
        variadic=parameter.kind is parameter.VAR_POSITIONAL,
        keyword=parameter.kind is parameter.KEYWORD_ONLY,
        optional=optional,
        default=parameter.default if optional else None,
    )


def call(target: Callable, hub: Any, arguments: Sequence[Argument], name: str) -> Any:
    """Call a command or make a style with a script's arguments.

    Parameters
    ----------
    target
        Function or class.
    hub
        Its first argument.
    arguments
        What the script gives.
    name
        What the user calls it: ``run`` or ``fix body_force``.

    Raises
    ------
    ScriptError
        For a wrong count or kind, and whatever the target raises; with a place in the script.
    """
    try:
        expected = parameters(target)
    except TypeError as error:
        raise ScriptError(f"{name} is broken: {error}") from error
    bound: dict[str, list[Argument]] = {}
    try:
        positional, keywords = _bind(target, expected, arguments, name, bound)
        values, named = [], {}
        for number, (parameter, argument) in enumerate(positional, 1):
            values.append(_convert(hub, parameter, argument, number))
        for parameter, argument in keywords:
            named[parameter.name] = _convert(hub, parameter, argument, None)
        try:
            return target(hub, *values, **named)
        except OSError as error:
            what = f"{error.filename}: " if error.filename else ""
            raise ScriptError(f"{what}{error.strerror or error}") from error
        except MemoryError as error:
            raise ScriptError(
                "there is not enough memory for this", hint="use larger cells or fewer points"
            ) from error
    except ScriptError as error:
        error.place = error.place or _guilty(error, arguments, bound)
        error.command = error.command or name
        raise


def _bind(
    target: Callable,
    expected: list[Parameter],
    arguments: Sequence[Argument],
    name: str,
    bound: dict[str, list[Argument]],
) -> tuple[list[tuple[Parameter, Argument]], list[tuple[Parameter, Argument]]]:
    """Pair arguments with parameters by position, and by name where a name is given."""
    by_name = {p.name: p for p in expected if p.keyword}
    slots = [p for p in expected if not p.keyword]
    variadic = next((p for p in slots if p.variadic), None)
    positional: list[tuple[Parameter, Argument]] = []
    keywords: list[tuple[Parameter, Argument]] = []
    given = []
    variadic = next((p for p in slots if p.variadic), None)
    for argument in arguments:
        pair = argument.keyword()
        # Raw arguments are passed on to a style, which knows the names.
        passed_on = variadic is not None and variadic.kind is _SIMPLE[Argument]
        if pair is None or (passed_on and pair[0] not in by_name):
            given.append(argument)
            continue
        word, value = pair
        if word not in by_name:
            if variadic is not None and variadic.kind is _SIMPLE[Argument]:
                # For the style that the command passes its arguments on to.
                given.append(argument)
                continue
            raise _unknown_keyword(word, argument, expected, by_name)
        if word in bound:
            raise ScriptError(f"{word} is given twice", place=argument.place)
        bound[word] = [value]
        keywords.append((by_name[word], value))
    needed = sum(1 for p in slots if not p.optional and not p.variadic)
    missing = [p.name for p in by_name.values() if not p.optional and p.name not in bound]
    if len(given) < needed or missing or (variadic is None and len(given) > len(slots)):
        surplus = given[len(slots)] if len(given) > len(slots) and not variadic else None
        gap = next((argument for argument in given if _GAP.search(argument.text)), None)
        count = f"{len(given)} argument" + ("" if len(given) == 1 else "s")
        raise ScriptError(
            f"expects {_arguments(target) or 'no arguments'}; got {count}",
            place=gap.place if gap else surplus.place if surplus else None,
            expected=syntax(target, name),
            hint=f"is a comma missing in '{gap.text}'?" if gap else None,
        )
    for k, argument in enumerate(given):
        parameter = slots[k] if k < len(slots) and not slots[k].variadic else variadic
        assert parameter is not None
        positional.append((parameter, argument))
        bound.setdefault(parameter.name, []).append(argument)
    return positional, keywords


def _unknown_keyword(
    word: str, argument: Argument, expected: list[Parameter], by_name: dict
) -> ScriptError:
    close = nearest(word, by_name)
    if any(p.name == word for p in expected):
        hint: str | None = f"arguments are given by position: leave out '{word} ='"
    else:
        hint = f"did you mean '{close}'?" if close else f"leave out '{word} ='; == compares"
    known = ", ".join(f"{name}=..." for name in by_name)
    return ScriptError(
        f"there is no argument to be given as '{word} = ...'",
        place=argument.place,
        expected=known or "arguments in their order, without names",
        hint=hint,
    )


def _convert(hub: Any, parameter: Parameter, argument: Argument, number: int | None) -> Any:
    if argument.is_null and not parameter.kind.nullable and parameter.kind.text != "anything":
        raise _misfit(parameter, argument, number, _Unfit(NULL))
    try:
        return parameter.kind.convert(hub, argument)
    except _Unfit as unfit:
        raise _misfit(parameter, argument, number, unfit) from None
    except ScriptError as error:
        error.place = error.place or argument.place
        error.expected = error.expected or f"{parameter.name}: {parameter.kind.text}"
        raise


def _misfit(
    parameter: Parameter, argument: Argument, number: int | None, unfit: _Unfit
) -> ScriptError:
    which = f"argument {number} '{parameter.name}'" if number else f"'{parameter.name}'"
    return ScriptError(
        f"{which} must be {parameter.kind.text}, not {unfit.got}",
        place=unfit.place or argument.place,
        expected=parameter.kind.text,
        hint=unfit.hint,
    )


def _guilty(
    error: ScriptError, arguments: Sequence[Argument], bound: dict[str, list[Argument]]
) -> Place | None:
    """The place of the argument that an error names, or else of the word it quotes."""
    if isinstance(error.argument, int) and 0 <= error.argument < len(arguments):
        return arguments[error.argument].place
    if isinstance(error.argument, str) and bound.get(error.argument):
        return bound[error.argument][0].place
    for word in re.findall(r"'([^']+)'", error.message):
        for argument in arguments:
            if argument.text in (word, f'"{word}"'):
                return argument.place
    return None


# ---- help ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Help:
    """What there is to say about a command or style.

    Attributes
    ----------
    syntax
        How it is called.
    summary, text
        First line and the rest of the docstring's head.
    parameters
        With kinds, defaults and descriptions.
    sections
        The other sections of the docstring: Example, Notes, See Also.
    """

    name: str
    syntax: str
    summary: str
    text: str
    parameters: list[Parameter]
    sections: dict[str, str] = field(default_factory=dict)

    @property
    def example(self) -> str:
        """Lines of script."""
        return self.sections.get("Example", "")


def _syntax_parts(target: Callable) -> list[tuple[str, bool]]:
    """Arguments as they are written, and whether each may be left out."""
    parts = []
    for parameter in parameters(target):
        if parameter.variadic:
            parts.append((f"{parameter.shown}, ...", True))
        else:
            parts.append((parameter.shown, parameter.optional))
    return parts


def _joined(parts: Any) -> str:
    """``a, b[, c[, d]]``."""
    text, open_brackets = "", 0
    for shown, optional in parts:
        comma = ", " if text else ""
        if optional:
            text += f"[{comma}{shown}"
            open_brackets += 1
        else:
            text += f"{comma}{shown}"
    return text + "]" * open_brackets


def _arguments(target: Callable) -> str:
    """The arguments as they are written: the target's own `syntax`, or from its signature."""
    own = getattr(target, "syntax", None)
    return own if isinstance(own, str) else _joined(_syntax_parts(target))


def syntax(target: Callable, name: str) -> str:
    """The line that shows how a command or style is called."""
    own = _arguments(target)
    family, _, style = name.partition(" ")
    if not style:
        return f"{name}({own})"
    before = []
    if registry.knows("command", family):
        outer = [p for p in parameters(registry.find("command", family)) if not p.variadic]
        # The last of the command's own arguments is the one that names the style.
        before = [p.shown for p in outer[:-1] if not p.keyword]
    if own.startswith("["):
        own = own.replace("[", "[, ", 1)
    elif own:
        own = ", " + own
    return f"{family}({', '.join([*before, style])}{own})"


def describe(target: Callable, name: str) -> Help:
    """Help about a command or style, from its signature and its docstring."""
    doc = inspect.cleandoc(target.__doc__ or "")
    if inspect.isclass(target) and "Parameters\n---" not in doc and target.__init__.__doc__:
        doc = doc + "\n\n" + inspect.cleandoc(target.__init__.__doc__)
    head, sections = _sections(doc)
    summary, _, text = head.partition("\n\n")
    descriptions = _descriptions(sections.pop("Parameters", ""))
    described = [
        Parameter(**{**vars(p), "description": descriptions.get(p.name, "")})
        for p in parameters(target)
    ]
    return Help(
        name, syntax(target, name), " ".join(summary.split()), text.strip(), described, sections
    )


def _sections(doc: str) -> tuple[str, dict[str, str]]:
    """The head of a docstring, and its sections by title."""
    pieces = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}$", doc, flags=re.MULTILINE)
    titles = [title.replace("Examples", "Example") for title in pieces[1::2]]
    texts = (text.strip("\n") for text in pieces[2::2])
    return pieces[0].strip(), dict(zip(titles, texts, strict=True))


def _descriptions(section: str) -> dict[str, str]:
    """Descriptions by name, from a section in NumPy's form."""
    found: dict[str, str] = {}
    for block in re.split(r"\n(?=\S)", section):
        head, _, text = block.partition("\n")
        for name in head.partition(":")[0].split(","):
            found[name.strip().lstrip("*")] = inspect.cleandoc(text)
    return found
