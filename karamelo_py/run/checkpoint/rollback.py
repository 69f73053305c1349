"""What all parts of a scene remembered, state by state, since the one that a run may go back to.

Steps from there on can be taken once more: where a step went wrong, to write a file to go on from.
Files of log, dumps and plots stay as they are then; and whoever goes on from an earlier state than
the last that they show has to find all parts as they were in it, so that no row is there twice and
no sum over time holds what comes later.
"""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from karamelo_py.kernels.step import DONE
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.run.checkpoint.memory import remembered
from karamelo_py.scene.hub import Hub

CLOCK = ("time", "timestep", "dt")  # values that belong to the state itself


class Grown(NamedTuple):
    """A list that is only ever added to, and how long it was: nothing of it is copied."""

    items: list
    length: int


class Mark(NamedTuple):
    """What parts remembered at a state, and the values that were published."""

    parts: list[tuple[Any, dict[str, Any]]]
    values: dict[str, float]

    @classmethod
    def of(cls, hub: Hub) -> "Mark":
        """Those of now."""
        parts = [
            (part, _seen(part, key[0] in restart_file.OUTPUTS))
            for key, part in restart_file.parts(hub)
            if part is not hub.running
        ]
        names = (name for name in hub.values.names() if name not in CLOCK)
        return cls(parts, {name: hub.values.get(name) for name in names})

    @classmethod
    def of_outputs(cls, hub: Hub) -> "Mark":
        """What outputs alone remember now."""
        return cls([(part, _seen(part, True)) for part in _outputs(hub)], {})

    def give(self, hub: Hub, *, cut: bool = False) -> None:
        """Let all parts remember that; with `cut` outputs go on from there in their files."""
        for name, value in self.values.items():
            hub.values.set(name, value)
        for part, seen in self.parts:
            _give(part, seen)
            if cut:
                restart_file.resume(hub, part)


class Marks:
    """Marks of the state that a run may go back to, and of those that parts looked at since."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self._of: dict[int, Mark] = {}

    def begin(self) -> None:
        """Nobody will go back to a state before this one, or has gone back to it."""
        self._of = {self.hub.update.step: Mark.of(self.hub)}

    def begin_from(self, step: int, memories: restart_file.Memories) -> None:
        """As `begin`, of an earlier state that a file holds; its values are in the state."""
        now = Mark.of(self.hub)
        restart_file.give_back(self.hub, memories)
        self._of = {step: Mark.of(self.hub)._replace(values={})}
        now.give(self.hub)

    def note(self, *, always: bool) -> None:
        """Mark the present state, `always` or if something has been written of it."""
        step = self.hub.update.step
        if always or any(part.last_step == step for part in _outputs(self.hub)):
            self._of[step] = Mark.of(self.hub)

    def give(self, step: int, *, cut: bool = False) -> None:
        """Let all parts remember what they did at a step that is marked."""
        self._of[step].give(self.hub, cut=cut)

    @contextmanager
    def at(self, step: int) -> Iterator[None]:
        """Within this, parts remember what they did at a step that is marked."""
        now = Mark.of(self.hub)
        self.give(step)
        try:
            yield
        finally:
            now.give(self.hub)

    def again(self, advance: Callable[[int], int], end: int) -> int:
        """Take the steps up to `end` once more; parts remember on the way what they did there.

        Returns how the last of them ended.
        """
        update = self.hub.update
        while update.step < end:
            marked = min((step for step in self._of if update.step < step < end), default=end)
            status = advance(marked - update.step)
            if status != DONE:
                return status
            if update.step in self._of:
                self.give(update.step)
        return DONE


def _outputs(hub: Hub) -> Iterator[Any]:
    return (part for key, part in restart_file.parts(hub) if key[0] in restart_file.OUTPUTS)


def _seen(part: Any, grows: bool) -> dict[str, Any]:
    found = {}
    for name in remembered(part):
        value = getattr(part, name)
        if remembered(value):
            found[name] = _seen(value, grows)
        elif grows and type(value) is list:
            found[name] = Grown(value, len(value))
        else:
            found[name] = _copied(value)
    return found


def _copied(value: Any) -> Any:
    if value is None or type(value) in (bool, int, float, str, bytes):
        return value  # soon: this is done for all parts at every output
    try:
        return copy.deepcopy(value)
    except Exception:  # what a function in Python keeps: no file takes it, which is told there
        return value


def _give(part: Any, seen: dict[str, Any]) -> None:
    for name, value in seen.items():
        if isinstance(value, dict) and remembered(there := getattr(part, name)):
            _give(there, value)
        elif isinstance(value, Grown):
            setattr(part, name, value.items[: value.length])
        else:
            setattr(part, name, _copied(value))
