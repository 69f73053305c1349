"""One run: steps in chunks, outputs when due, events for listeners.

`output.schedule` writes log and dumps, `run.rollback` checks steps and stops a run, and
`run.step_size` chooses the step.
"""

import signal
import time
from collections.abc import Callable
from dataclasses import InitVar, dataclass, field
from math import inf, isfinite
from pathlib import Path
from types import FrameType

import numpy as np

from karamelo_py.run.backend import Backend
from karamelo_py.run.condition import RunCondition
from karamelo_py.run.listening import Listener, Trouble
from karamelo_py.run.mpi.comm import check_same_run
from karamelo_py.run.rollback import RollBack, Stopped
from karamelo_py.run.timings import Timings
from karamelo_py.scene.comm import handled_signals
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import attributed

SECONDS_PER_CHUNK = 0.3  # short enough for Ctrl-C and the progress bar


class Interrupted(Exception):
    """A signal has ended the run; outputs are complete."""


@dataclass(eq=False)
class RunLoop:
    """Runs a scene for a number of steps, to a time, or until or while a condition holds.

    With `halve`, the run returns to its last good state after a failure, and halves the step.
    """

    hub: Hub
    steps: int | None = None
    end_time: float = inf
    condition: RunCondition | None = None
    halve: InitVar[bool] = False
    advice: Listener = field(default_factory=Listener)

    signalled = 0  # number of a signal to this process
    resumed_from: Path | None = None
    interrupted = 0  # number of a signal that ends all processes
    first_step: int = field(init=False)
    first_time: float = field(init=False)
    last_step: float = field(init=False)
    ruined: bool = field(init=False)  # True if the step was too large in an earlier run

    def __post_init__(self, halve: bool) -> None:
        self.rollback = RollBack(self.hub, self.tell, halve=halve)
        self.timings = Timings(self.hub)

    def tell(self, event: Callable[[Listener], Trouble | None]) -> Trouble | None:
        answers = [event(listener) for listener in (*self.hub.listeners, self.advice)]
        return next((answer for answer in answers if answer is not None), None)

    def run(self) -> None:
        hub = self.hub
        hub.in_run = hub.begun
        try:
            if hub.settings.comm.size > 1:
                check_same_run(hub)
            with self.timings.telling_of_compilation(), attributed(hub):
                self._run(hub.simulation)
        finally:
            hub.in_run = 0
        hub.runs.append({name: hub.values.get(name) for name in hub.values.names()})

    def _run(self, simulation: Backend) -> None:
        hub, counted = self.hub, self.timings.counted
        started, simulation.rollback = time.perf_counter(), self.rollback.point
        self.first_step, self.first_time = simulation.step, simulation.time
        self.last_step = inf if self.steps is None else self.first_step + self.steps
        self.ruined, resumed = False, hub.restart is not None
        if resumed:
            self._take_up(simulation)
        else:
            simulation.begin(self.end_time)
            self.tell(lambda to: to.begun(self, simulation))
        simulation.compile()
        began = simulation.step
        self.tell(lambda to: to.ready(simulation, resumed=resumed))
        with handled_signals(self._note):
            with counted("output"):
                hub.output.begin(within=resumed)
            hub.console.begin_run(simulation.step, 0.0)
            try:
                looks = self.condition is not None
                self.rollback.begin(simulation, self.first_step, self.ruined, looks)
                self._loop(simulation)
                with counted("output"):
                    hub.console.end_run()
                    if self.interrupted:
                        # Restart files come first: a longer run has no final output here.
                        hub.output.write_last()
                    hub.output.end()
                self._agree(simulation)  # no further run starts after a signal
            except BaseException as error:
                hub.console.end_run()
                hub.output.abort()
                if isinstance(error, Stopped):
                    simulation.comm.end_together()
                raise
        self.tell(lambda to: to.ended(self, simulation, began, time.perf_counter() - started))
        if self.interrupted:
            simulation.comm.end_together()
            raise Interrupted(self.interrupted)

    def _take_up(self, simulation: Backend) -> None:
        hub, self.resumed_from = self.hub, self.hub.restart.path
        hub.restart.take(hub, self.rollback.point, outputs=True)
        hub.restart = hub.interpreter.replay = None
        watched = simulation.control.step[0].watch_limit
        self.ruined = not watched and simulation.step > self.first_step
        simulation.go_on(self.end_time, self.rollback.point.halvings)
        self.tell(lambda to: to.begun(self, simulation, resumed=True))

    def _loop(self, simulation: Backend) -> None:
        hub, rollback, timings = self.hub, self.rollback, self.timings
        rhythms = {fix.every for fix in hub.fixes.values() if fix.every}
        most = simulation.states_every
        length, longest = 1, most if self.condition is None else 1

        def between(words: str) -> bool:
            self._show_progress(simulation, words)
            return bool(self.signalled)

        while self._goes_on(simulation):
            rollback.before()
            step, begun = simulation.step, timings.on["steps"][0]
            kept = (step // most + 1) * most  # next step at which a state may be stored
            end = min(hub.output.next_step(step), self.last_step, step + length, kept)
            end = min([end, *((step // every + 1) * every for every in rhythms)])
            with timings.counted("steps"):
                status = simulation.advance(int(end) - step, between)
            self._agree(simulation)  # outputs show only steps that succeeded in all processes
            if not rollback.after(status):
                length = 1
                continue
            self.tell(lambda to: to.stepped(simulation))
            rollback.act_between_steps()
            elapsed = simulation.comm.bcast(timings.on["steps"][0] - begun)
            in_time = SECONDS_PER_CHUNK * max(simulation.step - step, 1) / max(elapsed, 1e-9)
            length = int(min(longest, max(1, in_time)))
            with timings.counted("output"):
                if self._steps_left(simulation):
                    hub.output.write()
                self._show_progress(simulation)

    def _goes_on(self, simulation: Backend) -> bool:
        if not self._steps_left(simulation):
            return False
        if self.condition_allows():
            self._agree(simulation)
            return not self.interrupted
        if self.condition and simulation.step == self.first_step:
            self.condition.warn_of_no_step(self.hub)
        return False

    def condition_allows(self) -> bool:
        return self.condition is None or self.condition.allows(self.hub)

    def _agree(self, simulation: Backend) -> None:
        self.interrupted = int(simulation.comm.allreduce_max(np.array([self.signalled]))[0])

    def _steps_left(self, simulation: Backend) -> bool:
        end_time = simulation.control.step[0].end_time
        return simulation.step < self.last_step and simulation.time < end_time

    def _show_progress(self, simulation: Backend, within: str = "") -> None:
        console, fraction = self.hub.console, None
        if self.steps:
            fraction = (simulation.step - self.first_step) / self.steps
        elif isfinite(self.end_time) and self.end_time > self.first_time:
            fraction = (simulation.time - self.first_time) / (self.end_time - self.first_time)
        console.progress(simulation.step, simulation.time, fraction, within)

    def _note(self, number: int, _: FrameType | None = None) -> None:
        if self.signalled:
            raise KeyboardInterrupt
        self.signalled = number
        self.tell(lambda to: to.signalled(number))
        if signal.Signals(number).name == "SIGHUP":
            self.hub.console.leave()
