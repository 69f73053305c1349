"""How far each output had come, state by state, since the last one that a run may go back to.

A file to go on from may hold an earlier state than the last that was written to log, dumps and
plots: where energy has grown. What goes on from it has to find them as they were then, so that no
row is there twice.
"""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from karamelo_py.run.memory import remembered
from karamelo_py.scene.hub import Hub

BEFORE = -1  # the step of what has written nothing yet


class Marks:
    """What outputs remembered when they had written a state.

    What grows (a list) is marked by its length.
    """

    def __init__(self) -> None:
        self._of: dict[int, tuple[Any, list[tuple[int, dict]]]] = {}

    def note(self, hub: Hub) -> None:
        """Mark what has been written by now."""
        for part in _outputs(hub):
            step = BEFORE if part.last_step is None else part.last_step
            _, marks = self._of.setdefault(id(part), (part, []))
            if not marks or marks[-1][0] != step:
                marks.append((step, _seen(part)))

    def forget_before(self, step: int) -> None:
        """Nobody will go back to a state before this one."""
        for _, marks in self._of.values():
            while len(marks) > 1 and marks[1][0] <= step:
                del marks[0]

    def forget_after(self, step: int) -> None:
        """Steps from this one on are taken anew."""
        for _, marks in self._of.values():
            while len(marks) > 1 and marks[-1][0] > step:
                del marks[-1]

    @contextmanager
    def at(self, step: int) -> Iterator[None]:
        """Within this, outputs remember what they did at a step."""
        now = [(part, _values(part)) for part, _ in self._of.values()]
        for part, marks in self._of.values():
            earlier = [seen for marked, seen in marks if marked <= step]
            _give(part, earlier[-1] if earlier else marks[0][1])
        try:
            yield
        finally:
            for part, values in now:
                _set(part, values)


def _outputs(hub: Hub) -> list[Any]:
    output = hub.output
    return [output.log, *hub.dumps.values(), *output.plots, *output.last]


def _seen(part: Any) -> dict[str, Any]:
    found = {}
    for name in remembered(part):
        value = getattr(part, name)
        if remembered(value):
            found[name] = _seen(value)
        else:
            found[name] = len(value) if isinstance(value, list) else copy.deepcopy(value)
    return found


def _give(part: Any, seen: dict[str, Any]) -> None:
    for name, value in seen.items():
        there = getattr(part, name)
        if remembered(there):
            _give(there, value)
        else:
            setattr(part, name, there[:value] if isinstance(there, list) else value)


def _values(part: Any) -> dict[str, Any]:
    """What a part remembers, itself and not a copy."""
    names = ((name, getattr(part, name)) for name in remembered(part))
    return {name: _values(there) if remembered(there) else there for name, there in names}


def _set(part: Any, values: dict[str, Any]) -> None:
    for name, value in values.items():
        there = getattr(part, name)
        if remembered(there):
            _set(there, value)
        else:
            setattr(part, name, value)
