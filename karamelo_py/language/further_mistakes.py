"""Further mistakes of a script, behind the first: those that do not follow from it.

The rest of the script is tried, and what a wrong statement would have defined is noted. Statements
that name it are passed over, and what they would define is noted in turn.
"""

import re
from typing import Any

from karamelo_py.language import registry
from karamelo_py.script.errors import Quit, ScriptError, nearest
from karamelo_py.script.other_programs import instead
from karamelo_py.script.syntax import Assignment, Call, Statement

MOST = 9
# Nearly everything depends on these.
_BASIS = frozenset({"method", "dimension", "create_domain", "axisymmetric", "include", "quit"})
# What these define is needed by a run, others by what names them only.
_SCENE = frozenset(
    {"region", "solid", "group", "eos", "strength", "damage", "temperature", "material"}
)
_NAMED = frozenset({"fix", "compute", "dump", "plot"})
_RUNS = frozenset({"run", "run_time", "run_until", "run_while", "element"})


class Dependents:
    """What depends on statements that went wrong."""

    def __init__(self) -> None:
        self._names: set[str] = set()

    def add(self, names: set[str]) -> None:
        """Note names, too."""
        self._names |= names

    def note(self, statement: Statement) -> bool:
        """Note what `statement` would have defined; False where nothing can be said any more."""
        if isinstance(statement, Assignment):
            self._names.add(statement.name)
        if not isinstance(statement, Call):
            return True
        name = statement.name
        if not registry.knows("command", name) and instead("command", name) is None:
            name = nearest(name, registry.names("command")) or name
        if name in _BASIS:
            return False
        if name in _SCENE:
            self._names |= _RUNS
        if name in _SCENE | _NAMED and statement.arguments:
            self._names.add(statement.arguments[0].code.strip())
        return True

    def includes(self, statement: Statement) -> bool:
        """Whether a statement names something of that, such as F or F_x of a fix F."""
        words = re.findall(r"\w+", statement.raw.code)
        return any(w in self._names or w.rpartition("_")[0] in self._names for w in words)


def further_errors(interpreter: Any, first: ScriptError) -> list[ScriptError]:
    """Mistakes in the statements behind the one that failed, in their order.

    Parameters
    ----------
    interpreter
        Behind the statement that failed. Its hub is tried on, and of no use thereafter.
    first
        What was wrong with that statement.
    """
    found: list[ScriptError] = []
    seen = {first.message}
    dependents = Dependents()
    statement = interpreter.statement
    while dependents.note(statement) and len(found) < MOST:
        dependents.add(interpreter.presets.blamed)
        statement = interpreter.next_statement()
        while statement is not None and not dependents.includes(statement):
            try:
                interpreter.execute(statement)
            except ScriptError as error:
                # One name that is not known may stand in many lines.
                if error.message not in seen:
                    found.append(error)
                seen.add(error.message)
                break
            except Quit:
                return found
            except Exception:  # What is left of the scene is not whole.
                return found
            statement = interpreter.next_statement()
        if statement is None:
            break
    return found
