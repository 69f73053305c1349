"""Processes of which the first says what all do, while a run goes on."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import Enum, auto
from functools import wraps
from typing import Any
from zlib import crc32

import numpy as np

from karamelo_py.run.mpi.crew import FAILED, Crew, heeding
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Quit, ScriptError

OVER = "over"


class At(Enum):
    """What the processes are at, as the first sees it."""

    APART = auto()  # each carries out the script, between two runs
    LEADING = auto()  # the others do what it says
    READY = auto()  # and are made ready for steps
    JOINT = auto()  # all do the same, and wait for each other


class Abandoned(Exception):
    """The first process has found a fault in the midst of a step, and tells of it."""


def by_all(method: Callable) -> Callable:
    """A method of each process for its part, where the whole is not there: of all together."""

    @wraps(method)
    def act(self: Leading, *arguments: Any) -> Any:
        if self._at_hand:
            return method(self, *arguments)
        return self._all_do(method.__name__, *arguments)

    return act


class HandedOutAnew(Exception):
    """A fix in Python has moved points at the start of a step: others have them now."""


class Leading(Simulation):
    """A simulation of which each process has something."""

    def __init__(self, hub: Hub, previous: Leading | None = None):
        self.crew: Crew = hub.settings.crew
        self._at = At.APART
        super().__init__(hub, previous)

    @property
    def _leading(self) -> bool:
        """Whether this process says what the others do."""
        return self._at is not At.APART

    def _settle(self) -> None:
        """See that all processes have the state that the run has ended with."""

    def _part_with_whole(self) -> None:
        """From here on no process has what only the first has gathered."""

    @property
    def follows(self) -> bool:
        """Another process says what this one does in a run."""
        return not self.crew.leads

    @contextmanager
    def leading(self) -> Iterator[None]:
        """While a run goes on: the others follow."""
        self._meet()
        self._at, well = At.LEADING, False
        try:
            yield
            well = True
        finally:
            joint, self._at = self._at is At.JOINT, At.APART
            if joint:
                # In the midst of what all do together: the others would wait for ever.
                self.crew.amid = True
            else:
                goes_on = well and self.hub.interpreter.has_more
                if goes_on:
                    self._settle()
                deleted = np.flatnonzero(~self.present)
                self.crew.told((OVER, well, goes_on, deleted, self.hub.values.array))
                if goes_on:
                    self._part_with_whole()

    def _meet(self) -> None:
        """See that all processes are about to do the same run."""
        hub, crew = self.hub, self.crew
        present = [hub.place and (hub.place.file, hub.place.line), len(hub.runs), self.count]
        words = crew.meet(1 + crc32(repr((present, hub.interpreter.presets)).encode()))
        if (words == words[0]).all():
            return
        crew.parted = True
        # One that has failed tells of it.
        if (words == FAILED).any() or crew.rank != int((words > 0).argmax()):
            raise Quit
        raise ScriptError(
            "the processes do not come to the same run",
            place=hub.place,
            expected="the same script, files and variables for all of them",
        )

    def follow(self) -> None:
        """Do what the first process says, until its run is over."""
        with heeding(self._note):
            self._do_what_is_said()
        if self.crew.signal:  # behind the last step
            os.kill(os.getpid(), self.crew.signal)

    def _note(self, number: int, _: Any) -> None:
        """A signal that this process alone may have got: all are told of it with their steps."""
        self.crew.signal = number

    def _do_what_is_said(self) -> None:
        self._meet()
        hub = self.hub
        hub.restart = hub.interpreter.replay = None
        while True:
            what, *arguments = self.crew.told()
            if what == OVER:
                well, goes_on, deleted, values = arguments
                hub.values.array[:] = values
                self.present[deleted] = False
                if not well:
                    raise Quit
                if goes_on:
                    self._part_with_whole()
                return
            with self.crew.joint(), suppress(Abandoned):
                getattr(self, what)(*arguments)

    def _tell(self, what: str, *arguments: Any) -> None:
        self.crew.told((what, *arguments))

    def _together(self, what: str, *arguments: Any, **own: Any) -> Any:
        """Have all call a method with these arguments, this process with its `own` ones, too."""
        before, self._at = self._at, At.JOINT
        self._tell(what, *arguments)
        found = getattr(self, what)(*arguments, **own)
        self._at = before  # not where it failed: then the others wait
        return found
