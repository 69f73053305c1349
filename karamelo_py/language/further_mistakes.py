"""Further mistakes of a script, behind the first: those that do not follow from it.

The rest of the script is tried, and what a wrong statement would have defined is noted. Statements
that name it are passed over, and what they would define is noted in turn; the names of commands and
styles in them are looked up, since these depend on nothing.
"""

import re
from collections.abc import Iterable
from itertools import takewhile
from typing import Any

from karamelo_py.language import registry
from karamelo_py.language.unknown import SHAPES, renamed, unknown_call, words_of
from karamelo_py.script.errors import Quit, ScriptError, instead, nearest, plural
from karamelo_py.script.functions import FUNCTIONS
from karamelo_py.script.syntax import Assignment, CommandCall, Statement

MOST = 9
MOST_OF_TEXT = 200  # a script of another program is wrong in every line
# Nearly everything depends on these.
_BASIS = frozenset({"method", "dimension", "create_domain", "axisymmetric", "include", "quit"})
# What these define is needed by a run, others by what names them only.
_SCENE = frozenset(
    {"region", "solid", "group", "eos", "strength", "damage", "temperature", "material"}
)
_NAMED = frozenset({"fix", "compute", "dump", "plot", "load_path", "element"})
_PLAIN = {"group", "plot", "load_path", "element"}  # have no style
# Where the style stands among the arguments.
_STYLED = {name: 2 if name == "dump" else 1 for name in (_SCENE | _NAMED) - _PLAIN}
_RUNS = frozenset({"run", "run_time", "run_until", "run_while", "element"})


class Dependents:
    """Names and kinds that depend on statements that went wrong."""

    def __init__(self) -> None:
        self.names: set[str] = set()
        # Of what kinds something may be missing, under a name that nobody knows.
        self.kinds: set[str] = set()

    def note(self, statement: Statement) -> bool:
        """Note what `statement` would have defined; False where nothing can be said any more."""
        if isinstance(statement, Assignment):
            self.names.add(statement.name)
        if not isinstance(statement, CommandCall):
            return True
        name = statement.name
        if not registry.knows("command", name):
            name = self._meant(name, statement)
        if name in _BASIS:
            return False
        if name in _SCENE:
            self.names |= _RUNS
        if name == "scheme":
            self.names |= _RUNS | {
                value
                for style in registry.names("scheme")
                for value in getattr(registry.find("scheme", style), "published", ())
            }
        if name in _SCENE | _NAMED and statement.arguments:
            self.names.update(re.findall(r"\w+", statement.arguments[0].code))
        return True

    def _meant(self, name: str, statement: CommandCall) -> str:
        """Guess the command that an unknown one stands for; else note what it may have made."""
        other = instead("command", name)
        if other is None and (close := nearest(name, registry.names("command"))):
            return close
        ID = statement.arguments[0].code.strip() if statement.arguments else ""
        self.kinds |= set(re.findall(r"\b(\w+)\(", other or "")) & (_SCENE | _NAMED)
        if other is None and ID.isidentifier():
            self.names |= {ID, *_RUNS}
        elif self.kinds & _SCENE:
            self.names |= _RUNS
        return name

    def includes(self, statement: Statement) -> bool:
        """Tell if a statement names something of that, such as F or F_x of a fix F."""
        words = re.findall(r"\w+", statement.raw.code)
        return any(w in self.names or w.rpartition("_")[0] in self.names for w in words)


def further_errors(interpreter: Any, first: ScriptError) -> list[ScriptError]:
    """Find mistakes in the statements behind the one that failed, in their order.

    The interpreter is behind that statement, of which `first` says what was wrong. Its hub is tried
    on, and of no use thereafter.
    """
    found = first.others
    seen = {error.message: error for error in (first, *found)}
    passed_over: list[Statement] = []
    dependents = Dependents()

    def tell(error: ScriptError) -> None:
        # One name that is not known may stand in many lines. It follows where an ID was given
        # twice: the second of the two was meant to have another, which nobody knows. So it does
        # behind a command of another program that says by other names what one here makes.
        for one in (error, *error.others):
            twice = {other.kind for other in seen.values() if other.code == "already-used"}
            follows = one.code == "unknown-ID" and one.kind in twice | dependents.kinds
            if one.message not in seen and not follows:
                found.append(one)
            seen[one.message] = one
        error.others = []

    wrong = interpreter.statement
    while wrong is not None and len(found) < MOST:
        if not dependents.note(wrong):
            passed_over += _rest_of(interpreter)
            break
        dependents.names |= interpreter.presets.blamed
        wrong = None
        while wrong is None and (statement := interpreter.next_statement()) is not None:
            if dependents.includes(statement):
                passed_over.append(statement)
                wrong = statement
                continue
            try:
                interpreter.execute(statement)
            except ScriptError as error:
                tell(error)
                wrong = statement
            except Quit:
                break
            except Exception:  # What is left of the scene is not whole.
                passed_over += _rest_of(interpreter)
    for statement in passed_over:
        dependents.note(statement)
    for error in misnamed(interpreter, passed_over, dependents.names):
        tell(error)
    return sorted(found, key=_order)[:MOST]


def errors_of_text(interpreter: Any, first: ScriptError) -> list[ScriptError]:
    """Find further mistakes in a script whose text is wrong somewhere: in its text and in names.

    Where there are too many to be read, the last one says how many there are besides.
    """
    found = sorted([*first.others, *misnamed(interpreter, first.statements)], key=_order)
    more = len(found) - MOST_OF_TEXT
    besides = [ScriptError(f"and {plural(more, 'more mistake')} behind these")] if more > 0 else []
    return [*found[:MOST_OF_TEXT], *besides]


def misnamed(
    interpreter: Any, statements: Iterable[Statement], wanting: Iterable[str] = ()
) -> list[ScriptError]:
    """Find wrong names of commands and styles in statements.

    Karamelo's forms without a style, material(ID, eos, strength) and solid(ID, box, region, ...),
    are right, also where what would have one of the `wanting` names went wrong.
    """
    statements = list(statements)
    variables = {s.name for s in statements if isinstance(s, Assignment)} | {*interpreter.variables}
    found = []
    for statement in statements:
        if not isinstance(statement, CommandCall) or statement.name in variables:
            continue
        try:
            _look_up(interpreter, statement, variables, set(wanting))
        except ScriptError as error:
            error.place = error.place or statement.place
            found.append(error)
    return found


def _look_up(
    interpreter: Any, statement: CommandCall, variables: set[str], wanting: set[str]
) -> None:
    name, arguments = statement.name, statement.arguments
    if name not in FUNCTIONS and not registry.knows("command", name):
        raise unknown_call(interpreter, name, statement.place, statement=True)
    where = _STYLED.get(name, len(arguments))
    if where >= len(arguments):
        return
    style = arguments[where].code.strip()
    hub, behind = interpreter.hub, [argument.code.strip() for argument in arguments[where + 1 :]]
    filled = wanting | {*hub.regions}
    if not registry.knows(name, style) and (
        (name == "material" and style in wanting | {*hub.parts["eos"]})
        or (
            name == "solid"
            and (style in filled or (style in SHAPES and filled.intersection(behind[:1])))
        )
    ):
        return
    if style not in variables and re.fullmatch(r"[a-zA-Z][\w/-]*", style):
        try:
            registry.find(name, style)
        except ScriptError as error:
            error.command, error.place = name, arguments[where].place
            ID, *words = words_of(statement)
            error.hint = renamed(name, style, ID, words[where:]) or error.hint
            raise


def _rest_of(interpreter: Any) -> list[Statement]:
    """List the statements that are left, up to where the script ends."""
    rest = iter(interpreter.next_statement, None)
    return list(takewhile(lambda statement: statement.raw.code.strip() != "quit", rest))


def _order(error: ScriptError) -> tuple:
    place = error.place
    return (error.included != [], place.file, place.line) if place else (True, "", 0)
