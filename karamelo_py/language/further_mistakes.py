"""Further mistakes of a script, independent of the first.

In statements that depend on a wrong statement, only the names of commands and styles are checked.
"""

import re
from collections.abc import Iterable
from itertools import takewhile
from typing import Any

from karamelo_py.language import registry
from karamelo_py.language.unknown import SHAPES, renamed, unknown_call, words_of
from karamelo_py.script.errors import Quit, ScriptError, instead, nearest, plural, table
from karamelo_py.script.functions import FUNCTIONS
from karamelo_py.script.syntax import Assignment, CommandCall, Statement

MOST = 9
MOST_OF_TEXT = 200  # errors in the text: in another program's script, every line is wrong
_ROUND = {"axisymmetric", "cylindrical", "spherical"}
_BASIS = frozenset({"method", "dimension", "create_domain", "include", "quit"} | _ROUND)
# All runs depend on these commands. Other definitions matter only where they are named.
_SCENE = frozenset(
    {"region", "solid", "group", "eos", "strength", "damage", "temperature", "material"}
)
# Statements that add columns to points.
_COLUMNS = _SCENE | {"plane_strain", "plane_stress", "uniaxial_stress", "scheme", "fix"}
# Words that exist only if a solid has pore water.
_OF_WATER = {
    *("pore_pressure", "initial_pore_pressure", "seepage_face", "flux", "saturation", "porosity"),
    *("water_content", "wx", "wy", "wz", "t11", "t22", "t33", "t12", "t13", "t23"),
}
_NAMED = frozenset({"fix", "compute", "dump", "plot", "load_path", "element"})
_PLAIN = {"group", "plot", "load_path", "element"}
# Index of the style among the arguments of a command.
_STYLED = {name: 2 if name == "dump" else 1 for name in (_SCENE | _NAMED) - _PLAIN}
_RUNS = frozenset({"run", "run_time", "run_until", "run_while", "element"})


class Dependents:
    def __init__(self) -> None:
        self.names: set[str] = set()
        # Kinds of parts that an unknown name may have, and kinds of which no part was deleted.
        self.kinds: set[str] = set()
        self.undeleted: set[str] = set()
        self.lacks_columns = False

    def note(self, statement: Statement) -> bool:
        """Record what a statement defines; return False if nothing else can be checked."""
        if isinstance(statement, Assignment):
            self.names.add(statement.name)
        if not isinstance(statement, CommandCall):
            return True
        name = statement.name
        if not registry.knows("command", name):
            name = self._meant(name, statement)
        if name in _BASIS:
            return False
        self.lacks_columns |= name in _COLUMNS
        if name.startswith("delete_"):
            self.undeleted.add(name.removeprefix("delete_"))
        if name in _SCENE or name in ("scheme", "set_dt"):
            self.names |= _RUNS
        if name in ("pore_water", "solid"):
            self.names |= _OF_WATER | _RUNS
        if not _OF_WATER.isdisjoint(word.code.strip() for word in statement.arguments[:2]):
            self.names.add("pore_water")  # it should have preceded
        if name == "scheme":
            self.names.update(table()["implicit"].split())
        if name in _SCENE | _NAMED and statement.arguments:
            self.names.update(re.findall(r"\w+", statement.arguments[0].code))
        return True

    def _meant(self, name: str, statement: CommandCall) -> str:
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
        """Return True if a statement uses a missing name F, as F, F_x or ContactForce_F_x."""
        for word in re.findall(r"\w+", statement.raw.code):
            ID = word.rpartition("_")[0]
            if not self.names.isdisjoint((word, ID, ID.partition("_")[2])):
                return True
        return False


def further_errors(interpreter: Any, first: ScriptError) -> list[ScriptError]:
    """Return mistakes after the `first`; the interpreter's hub cannot be used afterwards."""
    errors = first.others
    seen = {error.message: error for error in (first, *errors)}
    passed_over: list[Statement] = []
    dependents = Dependents()

    def follows(error: ScriptError) -> bool:
        if error.code == "unknown-ID":
            # A repeated ID causes errors about unknown names of its kind.
            twice = {other.kind for other in seen.values() if other.code == "already-used"}
            return error.kind in twice | dependents.kinds
        if error.code == "already-used":
            return error.kind in dependents.undeleted
        return error.code == "unknown-column" and not error.alike and dependents.lacks_columns

    def tell(error: ScriptError) -> None:
        for one in (error, *error.others):
            if one.message not in seen and not follows(one):
                errors.append(one)
            seen[one.message] = one
        error.others = []

    interpreter.by_statement = True
    wrong = interpreter.statement
    while wrong is not None and len(errors) < MOST:
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
            except Exception:  # errors of any kind, as the scene is incomplete
                passed_over += _rest_of(interpreter)
    for statement in passed_over:
        dependents.note(statement)
    for error in misnamed(interpreter, passed_over, dependents.names):
        tell(error)
    return sorted(errors, key=_order)[:MOST]


def errors_of_text(interpreter: Any, first: ScriptError) -> list[ScriptError]:
    errors = sorted([*first.others, *misnamed(interpreter, first.statements)], key=_order)
    more = len(errors) - MOST_OF_TEXT
    besides = [ScriptError(f"and {plural(more, 'more mistake')} after these")] if more > 0 else []
    return [*errors[:MOST_OF_TEXT], *besides]


def misnamed(
    interpreter: Any, statements: Iterable[Statement], wanting: Iterable[str] = ()
) -> list[ScriptError]:
    """Return errors about wrong names of commands and styles.

    Karamelo's forms without a style, material(ID, eos, strength) and solid(ID, box, region, ...),
    are valid even if one of the names in `wanting` has no definition.
    """
    statements = list(statements)
    variables = {s.name for s in statements if isinstance(s, Assignment)} | {*interpreter.variables}
    errors = []
    for statement in statements:
        if not isinstance(statement, CommandCall) or statement.name in variables:
            continue
        try:
            _look_up(interpreter, statement, variables, set(wanting))
        except ScriptError as error:
            error.mark = error.mark or statement.mark
            errors.append(error)
    return errors


def _look_up(
    interpreter: Any, statement: CommandCall, variables: set[str], wanting: set[str]
) -> None:
    name, arguments = statement.name, statement.arguments
    if name not in FUNCTIONS and not registry.knows("command", name):
        raise unknown_call(interpreter, name, statement.mark, statement=True)
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
        ID, *words = words_of(statement)
        try:
            if name in ("fix", "compute"):
                registry.called(name, ID, style, *words[where : where + 1])
            else:
                registry.find(name, style)
        except ScriptError as error:
            index = {"ID": 0, 2: 2}.get(error.argument or "", where)
            error.command, error.mark = name, arguments[index].mark
            error.hint = renamed(name, style, ID, words[where:]) or error.hint
            raise


def _rest_of(interpreter: Any) -> list[Statement]:
    rest = iter(interpreter.next_statement, None)
    return list(takewhile(lambda statement: statement.raw.code.strip() != "quit", rest))


def _order(error: ScriptError) -> tuple:
    mark = error.mark
    return (error.included != [], mark.file, mark.line) if mark else (True, "", 0)
