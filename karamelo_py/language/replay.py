"""Repeat a script up to a stored state."""

import re
from dataclasses import dataclass, field
from math import nan

from karamelo_py.script.errors import Mark, ScriptError

_RUNS = frozenset({"run", "run_time", "run_until", "run_while"})


@dataclass
class Record:
    """Executed statements, except commands in `registry.may_differ`.

    `values` has the results of value(...) by statement number.
    """

    statements: list[str] = field(default_factory=list)
    values: dict[int, list[float]] = field(default_factory=dict)

    def note(self, value: float) -> None:
        self.values.setdefault(len(self.statements) - 1, []).append(value)

    def forget_from(self, number: int) -> None:
        del self.statements[number:]
        self.values = {k: numbers for k, numbers in self.values.items() if k < number}


class Replay:
    """Compares a script with the record in a restart `file`.

    `within`: the file was written during a run.
    """

    def __init__(self, record: Record, within: bool, file: str):
        self.record = record
        self.within = within
        self.file = file
        self.number = -1  # number of the present statement in the record
        self._values: list[float] = []

    @property
    def at_end(self) -> bool:
        return self.number == len(self.record.statements) - 1

    def next(self, text: str, mark: Mark | None) -> None:
        """Compare the next statement with the record."""
        self.number += 1
        self._values = list(self.record.values.get(self.number, ()))
        before = self.record.statements[self.number]
        # An unfinished run may have another length.
        if text != before and not (self.at_end and self.within):
            if text.partition("(")[0] == before.partition("(")[0] in _RUNS:
                raise self._was_over(before, mark)
            error = self.other_script(f"that script has {before} here", mark)
            error.hint = self._longer_by(before, text) or error.hint
            raise error

    def _was_over(self, run: str, mark: Mark | None) -> ScriptError:
        behind = "" if self.within else f", another run command after {self.record.statements[-1]}"
        message, expected = f"{self.file} was written after this run, by {run}", f"{run} as it was"
        hint = self._state_alone()
        return ScriptError(message, mark=mark, expected=f"{expected}{behind}", hint=hint)

    def _longer_by(self, before: str, text: str) -> str | None:
        run = self.record.statements[-1]
        name, assigns, value = text.partition("=")
        if not (assigns and name.isidentifier() and before.startswith(f"{name}=") and self.within):
            return None
        longer = re.sub(rf"\b{name}\b", lambda _: value, run)
        hint = f"leave {before} as it was here, and write {longer} instead of {run}"
        return None if longer == run else hint

    def value(self) -> float:
        return self._values.pop(0) if self._values else nan

    def other_script(self, message: str, mark: Mark | None = None) -> ScriptError:
        message = f"{self.file} was written by another script: {message}"
        expected = "the script that wrote it; settings of steps and output, and the length of "
        expected += "the last run, may change"
        return ScriptError(message, mark=mark, expected=expected, hint=self._state_alone())

    def _state_alone(self) -> str:
        return f"read_restart({self.file}) in a separate script takes only the state"
