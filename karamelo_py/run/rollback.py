"""Return to the last good state of a run."""

from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from karamelo_py.kernels.step import DONE, STOPPED
from karamelo_py.kernels.watch import WITHIN
from karamelo_py.run.backend import Backend
from karamelo_py.run.checkpoint.parts import OUTPUTS, PartStates, RollbackPoint
from karamelo_py.run.last_good import LastGood, OthersWait
from karamelo_py.run.listening import Trouble, when
from karamelo_py.scene import boundary
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

HALVINGS = 5  # largest number of halvings of the step in a run
CONTINUE, HALVE, STOP = "continue", "halve", "stop"
RETURNS = 2  # returns to a state before an energy gain; two halvings without effect are enough


class Stopped(ScriptError):
    """A run has failed in all processes; its last good state has been written."""


def decide(status: int, *, grown: bool, halves: bool, returns: int) -> str:
    """Return what to do after `status` or an energy gain; `returns` counts earlier returns."""
    if status == DONE:
        return HALVE if grown and halves and returns < RETURNS else CONTINUE
    return HALVE if halves else STOP


class RollBack:
    def __init__(self, hub: Hub, tell: Callable, *, halve: bool):
        self.hub, self.tell = hub, tell
        self.point = RollbackPoint(hub, halve)

    def begin(self, simulation: Backend, first_step: int, ruined: bool, looks: bool) -> None:
        """Begin with the present state, or with the state in a file.

        `ruined`: the step was too large in the run that wrote the file.

        `looks`: the condition of the run may read values of parts after any step.
        """
        self.simulation, self.first_step, self._always = simulation, first_step, looks
        self.too_large = simulation.steps.too_large
        # Points that a fix has deleted cannot be restored by a return to an earlier state.
        deletes = any(fix.every for fix in self.hub.fixes.values())
        lost = ruined or deletes or self.hub.update.boundary == "delete"
        self.begun_at = -1 if lost else simulation.step
        if not self.point.arrays:
            self._keep()

    def before(self) -> None:
        """Store the present state if it is due and good; otherwise note states of parts."""
        if self.point.step == self.begun_at and self.simulation.steps.too_large:
            return  # the first step was too large: later states are not good
        step = self.simulation.step
        # Results depend on these states after a return, so they must not depend on run time.
        often = step % self.simulation.states_every == 0 or step == self.first_step + 1
        often |= not self.simulation.repeats_steps
        if often and step != self.point.step and self.simulation.energy_watch.is_sound():
            self._keep()
        else:
            self.point.note(always=self._always)

    def after(self, status: int) -> bool:
        """Handle steps that ended with `status`; return False after going back to a state."""
        simulation, point = self.simulation, self.point
        if status == STOPPED and boundary.delete_leaving(self.hub, simulation, self._repeat):
            self._keep()
            return False
        watch = simulation.energy_watch
        grown = status == DONE and not watch.told_of_growth and watch.has_grown()
        halves = point.halve and point.halvings < HALVINGS
        halves = halves and not (status == STOPPED and self._points_only_leave())
        choice = decide(status, grown=grown, halves=halves, returns=point.returns)
        if choice == STOP:
            self._stop(status)
        if choice == HALVE:
            self._halve_step(status)
        return choice == CONTINUE

    def act_between_steps(self) -> None:
        step = self.simulation.step
        due = [fix for fix in self.hub.fixes.values() if fix.every and step % fix.every == 0]
        if sum(fix.between_steps() for fix in due):
            self._keep()

    def _keep(self) -> None:
        self.point.keep(self.simulation)
        self.point.returns = 0

    def _halve_step(self, status: int) -> None:
        simulation, point = self.simulation, self.point
        trouble = self._explained(status)
        # The return also removes later rows of log and dumps.
        point.return_to(simulation, cut=True)
        while point.halvings < HALVINGS:
            point.halvings += 1
            simulation.steps.halve(point.halvings)
            if not simulation.steps.above_limit():  # steps below the limit would fail again
                break
        self.hub.warn(
            f"{trouble.message}. Back to {when(simulation)}, "
            f"with 1/{2**point.halvings} of the step",
            code=trouble.code,
            cause=trouble.cause,
        )
        if status == DONE:
            point.returns += 1
            simulation.energy_watch.forget_growth()

    def _explained(self, status: int, too_large: bool = False) -> Trouble:
        answer = self.tell(lambda to: to.wrong(self.simulation, status, too_large))
        return answer or Trouble(
            f"a step failed ({when(self.simulation)})", self.simulation.remedy, "point"
        )

    def _repeat(self) -> None:
        step, present = self.simulation.step, PartStates.of(self.hub, OUTPUTS)
        self.point.return_to(self.simulation)
        self.point.again(self.simulation.advance, step)
        present.give(self.hub)

    def _points_only_leave(self) -> bool:
        """Return True if points leave without an energy gain; smaller steps cannot help."""
        simulation, moves = self.simulation, self.hub.update.method.frame.moves
        watch = simulation.energy_watch
        if not (moves and len(simulation.leaving()) and watch.is_sound()):
            return False
        step, present = simulation.step, PartStates.of(self.hub, OUTPUTS)
        self.point.return_to(simulation)
        before = watch.energy()
        self.point.again(simulation.advance, step)
        kept = watch.growth_since(before) <= WITHIN and not simulation.steps.above_limit()
        simulation.advance(1)  # repeat the failed step for output
        present.give(self.hub)  # outputs have written nothing since
        return kept

    def _stop(self, status: int) -> NoReturn:
        """Return to the last good state, write it to a file, and raise the error for the user.

        After an energy gain, this is the last state before the gain; log and dumps end at the last
        step that succeeded. If the step was too large from the start, it is the initial state.
        """
        simulation = self.simulation
        too_large = self.too_large and simulation.steps.too_large
        trouble = self._explained(status, too_large)
        resume, kind = "", ScriptError
        with suppress(OthersWait):
            last = LastGood(self.hub, simulation, self.point)
            if too_large:
                resume = last.keep_start(status, writes=self.point.step == self.begun_at)
            else:
                resume = last.keep(status, trouble.code)
            kind = Stopped
        error = kind(trouble.message, mark=trouble.mark, hint=trouble.fix)
        error.code, error.cause, error.resume = trouble.code, trouble.cause, resume
        error.complete = trouble.mark is not None
        raise error
