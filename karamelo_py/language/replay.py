"""A script gone through once more, up to the place where an earlier run of it left off."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import nan

from karamelo_py.script.errors import Place, ScriptError
from karamelo_py.script.syntax import Statement

_RUNS = frozenset({"run", "run_time", "run_until", "run_while"})
_BLANKS = re.compile(r'"[^"\n]*"|\s+')


def spelled(statement: Statement, without: Iterable[str] = ()) -> str:
    """Write the text of a statement without what means nothing: blanks, comments, line ends.

    Nor has it the keywords `without` which it is read.
    """
    text = _BLANKS.sub(lambda m: m[0] if m[0][0] == '"' else "", statement.raw.code)
    for word in without:
        text = re.sub(rf",{word}=[^,()]*", "", text)
    return text


@dataclass
class Record:
    """The statements that a script has done so far, in the order in which they were begun.

    Commands that only say how a run continues or what it writes (``may_differ``) are not in it. By
    the number of a statement it has the `values` that its calls of value(...) gave.
    """

    statements: list[str] = field(default_factory=list)
    values: dict[int, list[float]] = field(default_factory=dict)

    def note(self, value: float) -> None:
        """Note that a call of value(...) in the last statement gave `value`."""
        self.values.setdefault(len(self.statements) - 1, []).append(value)

    def forget_from(self, number: int) -> None:
        """Forget the statements from `number` on, which have not been done, and their values."""
        del self.statements[number:]
        self.values = {k: given for k, given in self.values.items() if k < number}


class Replay:
    """Compares a script that is gone through once more with the record of the first time.

    The record is of what was done up to the state that is gone on from, its last statement perhaps
    `within`, in progress then: a run. Messages name the `file` that it comes from.
    """

    def __init__(self, record: Record, within: bool, file: str):
        self.record = record
        self.within = within
        self.file = file
        self.number = -1  # of the present statement
        self._values: list[float] = []

    @property
    def at_end(self) -> bool:
        """Tell if the present statement is the last of the record."""
        return self.number == len(self.record.statements) - 1

    def next(self, text: str, place: Place | None) -> None:
        """Take the next statement, `text`; refuse another one than the first time."""
        self.number += 1
        self._values = list(self.record.values.get(self.number, ()))
        before = self.record.statements[self.number]
        # A run that was in progress may become longer or shorter.
        if text != before and not (self.at_end and self.within):
            if text.partition("(")[0] == before.partition("(")[0] in _RUNS:
                raise self._was_over(before, place)
            error = self.other_script(f"there this statement was {before}", place)
            error.hint = self._longer_by(before, text) or error.hint
            raise error

    def _was_over(self, run: str, place: Place | None) -> ScriptError:
        """Make the error for another length of a run that the state of the file lies behind."""
        behind = "" if self.within else f", a further run behind {self.record.statements[-1]}"
        return ScriptError(
            f"{self.file} was written when this run was over, by {run}",
            place=place,
            expected=f"{run} as it was{behind}",
            hint=self._state_alone(),
        )

    def _longer_by(self, before: str, text: str) -> str | None:
        """Give a run that was in progress the length that a variable of it now has."""
        run = self.record.statements[-1]
        name, assigns, value = text.partition("=")
        if not (assigns and name.isidentifier() and before.startswith(f"{name}=") and self.within):
            return None
        longer = re.sub(rf"\b{name}\b", lambda _: value, run)
        return (
            None
            if longer == run
            else f"leave {before} as it was here, and write {longer} in the place of {run}"
        )

    def value(self) -> float:
        """Look up the number that the next value(...) of the present statement gave."""
        return self._values.pop(0) if self._values else nan

    def other_script(self, message: str, place: Place | None = None) -> ScriptError:
        """Make the error for a script that is not the one that wrote the file."""
        return ScriptError(
            f"{self.file} was written by another script: {message}",
            place=place,
            expected="the script that wrote it; what it says about steps and output, and how long "
            "the last run is, may change",
            hint=self._state_alone(),
        )

    def _state_alone(self) -> str:
        return f"read_restart({self.file}) in a script of its own takes the state alone"
