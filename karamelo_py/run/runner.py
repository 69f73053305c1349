"""One run command: steps in chunks, outputs when they are due, and an eye on what goes wrong."""

import signal
import time
from math import inf, isfinite, isnan
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.kernels.step import DONE, STOPPED
from karamelo_py.run.advice import known_failures, steps
from karamelo_py.run.advice.report import bytes_per_point, report
from karamelo_py.run.advice.resting import warn_about_length
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.run.checkpoint.rollback import Marks
from karamelo_py.run.diagnosis import energy, explain
from karamelo_py.run.lower.build import check_scene
from karamelo_py.run.mpi.comm import check_same_run, handled_signals
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.timestep import (
    own_step_instead,
    ruling_limit,
    words_of_own_step,
    words_of_share,
)
from karamelo_py.run.timings import Spent
from karamelo_py.scene import boundary
from karamelo_py.scene.blame import blamed
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Pause, Quit, ScriptError, render_message

CHUNK = 100  # steps between two looks at the run, and between two snapshots, at most
HALVINGS = 5  # at most, in a run
RETURNS = 2  # at most, to one state from where energy grows: what two halves do not mend stays
PATIENCE = 0.3  # seconds between two looks, about: for Ctrl-C and the progress bar


class Interrupted(Exception):
    """The user pressed Ctrl-C, or another signal (its number) came; everything is written."""


class Runner:
    """Runs a scene for a number of steps, to a time, or by a condition."""

    remembers = ("halvings", "good", "returns")

    def __init__(
        self,
        hub: Hub,
        *,
        steps: int | None = None,
        end_time: float = inf,
        condition: Any = None,
        until: bool = False,
        halve: bool = False,
    ):
        self.hub = hub
        self.steps = steps
        self.end_time = end_time
        self.condition = condition
        self.until = until
        self.halve = halve
        self.halvings = 0
        self.returns = 0  # to the last good state, since energy grew from there on
        self.marks = Marks(hub)  # of that state and of later ones
        self.memories: restart_file.Memories | None = None  # of that state, from a file
        self.snapshot: dict[str, np.ndarray] = {}  # of the last good state
        self.kept = -1  # its step
        self.begun_at = -1  # the step of the start of this run, where its state is at hand
        self.smaller = ""  # what to write for a step that was above the stable limit there
        self.place = hub.place
        self.spent = Spent(hub)
        self.signal = 0  # that this process has been sent
        self.interrupted = 0  # the signal that all processes end with

    def run(self) -> None:
        """Do it."""
        hub = self.hub
        check_scene(hub)
        self._check_condition()
        if hub.rehearsing:
            span = self.end_time - hub.update.time, inf if self.steps is None else self.steps
            hub.later.append(steps.step_of(hub, self.halve, span))
            hub.in_runs += hub.lasting()
            return
        if hub.pausing:
            raise Pause
        hub.begun = True
        hub.rehearse()
        if hub.checking:
            report(hub, self.end_time)
            known_failures.warn(hub, hub.simulation, self.duration, self.halve)
            warn_about_length(hub, hub.simulation, self.end_time)
            raise Quit
        replay = hub.interpreter.replay
        if replay is not None and not replay.at_end:
            self._pass_over()
            return
        hub.running = self
        try:
            check_same_run(hub)
            with self.spent.telling_of_compilation(), blamed(hub):
                self._run(hub.simulation)
        finally:
            hub.running = None
        hub.runs.append(self._values())

    def _values(self) -> dict[str, float]:
        return {name: self.hub.values.get(name) for name in self.hub.values.names()}

    def _pass_over(self) -> None:
        """A run that was over when the state was written that the script goes on from."""
        after = self.hub.restart.runs[len(self.hub.runs)]
        for name, value in after.items():
            if name in self.hub.values:
                self.hub.values.set(name, value)
        self.hub.runs.append(after)

    @property
    def good(self) -> tuple[int, restart_file.Memories] | None:
        """The last good state, for files that hold its snapshot, too: a run may go back to it."""
        if not (self.halve and self.snapshot):
            return None
        with self.marks.at(self.kept):
            return self.kept, restart_file.memories(self.hub)

    @good.setter
    def good(self, state: tuple[int, restart_file.Memories] | None) -> None:
        if state is not None:
            self.kept, self.memories = state

    def _keep(self, simulation: Simulation) -> None:
        self.snapshot, self.kept = simulation.snapshot(self.snapshot), simulation.step
        self.returns = 0
        self.marks.begin()

    @property
    def duration(self) -> float:
        """How long this run is to be, as far as that is known."""
        simulation = self.hub.simulation
        steps = inf if self.steps is None else self.steps * simulation.dt
        return min(self.end_time - simulation.time, steps)

    def _check_condition(self) -> None:
        names = self.condition.names if self.condition is not None else frozenset()
        per_point = names & {"x", "y", "z", "x0", "y0", "z0"}
        if per_point:
            raise ScriptError(
                f"the condition depends on {min(per_point)}, which differs from point to point",
                argument="condition",
                expected="a formula of time, timestep, dt and values of fixes and computes",
            )

    def _run(self, simulation: Simulation) -> None:
        hub = self.hub
        started = time.perf_counter()
        first_step, first_time = simulation.step, simulation.time
        going_on = hub.restart is not None
        if going_on:
            file = hub.restart.path
            hub.restart.take(hub, outputs=True)
            hub.restart = hub.interpreter.replay = None
            ruined = not simulation.control.clock[0].watch_limit and simulation.step > first_step
            simulation.go_on(self.end_time, self.halvings)
            if not self.halvings:  # else the step is not that of the script
                steps.warn_about_steps(hub, simulation, self.halve, again=True)
            self._tell_of_no_step_left(file, simulation, first_step)
        else:
            ruined = False
            simulation.begin(self.end_time)
            known_failures.warn(hub, simulation, self.duration, self.halve)
            warn_about_length(hub, simulation, self.end_time)
        if not simulation.control.clock[0].watch_limit:
            # Said of the first state: a later one is ruined, and its limit with it.
            self.smaller = "a smaller step" if ruined else own_step_instead(hub)
        simulation.compile()
        began = simulation.step
        # Points that are deleted would not come back.
        self.begun_at = -1 if ruined or hub.update.boundary == "delete" else began
        self._banner(simulation, going_on)
        with handled_signals(self._note):
            with self.spent.counted("output"):
                hub.output.begin(within=going_on)
            hub.console.begin_run(simulation.step, 0.0)
            try:
                self._loop(simulation, first_step, first_time)
                with self.spent.counted("output"):
                    hub.console.end_run()
                    if self.interrupted:
                        # Before the last state of this run is written, which a longer one has not.
                        hub.output.write_last()
                    hub.output.end()
            except BaseException:
                hub.console.end_run()
                hub.output.abort()
                raise
        self._summary(simulation, began, time.perf_counter() - started)
        if self.interrupted:
            raise Interrupted(self.interrupted)

    def _tell_of_no_step_left(self, file: Path, simulation: Simulation, first_step: int) -> None:
        """Say so where a file holds the end of this run already, or what comes behind it."""
        step, time = simulation.step, simulation.time
        last_step = first_step + self.steps if self.steps is not None else inf
        holds = f"{file} holds step {step}, time {time:.6g}"
        hint = "a longer run, or a file from before its end"
        if step > last_step or time > self.end_time:
            end = f"step {last_step}" if step > last_step else f"time {self.end_time:.6g}"
            message = f"{holds}, which is beyond the end of this run, {end}: it takes no step"
            self.hub.warn(message, hint=hint, place=self.place)
        elif (
            step == last_step
            or time == self.end_time
            or (self.condition is not None and not self._goes_on())
        ):
            message = f"{holds}, the end of this run: it takes no further step"
            self.hub.console.say(render_message("note", message, hint=hint))

    def _tell_of_no_first_step(self) -> None:
        """A comparison that was forgotten, or turned round, ends a run at once."""
        holds = "holds" if self.until else "does not hold"
        self.hub.warn(
            f"the condition {holds} before the first step of this run: it takes none",
            hint="run_until ends where its condition is anything but 0, run_while where it is 0; "
            "comparisons are 1 or 0",
            place=self.place,
        )

    def _loop(self, simulation: Simulation, first_step: int, first_time: float) -> None:
        hub, output, spent = self.hub, self.hub.output, self.spent
        last_step = first_step + self.steps if self.steps is not None else inf
        chunk = 1
        if not self.snapshot:
            self._keep(simulation)
        elif self.memories is not None:
            self.marks.begin_from(self.kept, self.memories)
        while simulation.step < last_step and simulation.time < self.end_time:
            if self.condition is not None and not self._goes_on():
                if simulation.step == first_step:
                    self._tell_of_no_first_step()
                break
            self._agree(simulation)
            if self.interrupted:
                break
            step = simulation.step
            # When snapshots are taken must not depend on how fast steps are: runs go back to them.
            look = (step // CHUNK + 1) * CHUNK
            target = min(output.next_step(step), last_step, step + chunk, look)
            if self.condition is not None:
                target = step + 1
            due = step != self.kept and (step % CHUNK == 0 or step == first_step + 1)
            if due and not self._keeps_start(simulation) and energy.grown_little(simulation):
                self._keep(simulation)
            elif not self._keeps_start(simulation):  # whose rows are not gone back to
                self.marks.note(always=self.condition is not None)
            compiled, before = (spent.on[name][0] for name in ("compilation", "steps"))
            with spent.counted("steps"):
                status = simulation.advance(int(target) - step)
            self._agree(simulation)  # what is written shows steps that no process has failed in
            elapsed = spent.on["steps"][0] - before
            if status != DONE:
                if status == STOPPED and boundary.delete_leaving(hub, simulation, self.snapshot):
                    self._keep(simulation)
                elif not self._try_half(simulation, status=status):
                    start = None
                    if self.smaller and not simulation.control.clock[0].watch_limit:
                        start = explain.TooLarge(self.smaller, self.kept == self.begun_at)
                    good = explain.Good(self.snapshot, self.kept, self.marks, start)
                    explain.stop(hub, simulation, status, good, self.place)
                chunk = 1
                continue
            found = None if simulation.told_of_growth else energy.growth(hub, simulation)
            if found is not None:
                if self.returns < RETURNS and self._try_half(simulation, found[0]):
                    self.returns += 1
                    energy.forget_growth(simulation)
                    chunk = 1
                    continue
                hub.warn(found[0], hint=found[1])
                simulation.told_of_growth = True
            boundary.tell_of_bounces(hub, simulation)
            if compiled < spent.on["compilation"][0]:
                # A rate that counts compilation would promise hours.
                hub.console.end_run()
                hub.console.begin_run(
                    simulation.step, self._fraction(simulation, first_step, first_time) or 0.0
                )
            taken = max(simulation.step - step, 1)
            chunk = int(min(CHUNK, max(1, PATIENCE * taken / max(elapsed, 1e-9))))
            chunk = simulation.comm.bcast(chunk)
            with self.spent.counted("output"):
                if simulation.step < last_step and simulation.time < self.end_time:
                    output.write()
                hub.console.progress(
                    simulation.step,
                    simulation.time,
                    self._fraction(simulation, first_step, first_time),
                )

    def _agree(self, simulation: Simulation) -> None:
        """Learn which signal any of the processes has been sent."""
        self.interrupted = int(simulation.comm.allreduce_max(np.array([self.signal]))[0])

    def _keeps_start(self, simulation: Simulation) -> bool:
        """Whether no state but the first is a good one: the step was too large from there on."""
        return self.kept == self.begun_at and not simulation.control.clock[0].watch_limit

    def _try_half(self, simulation: Simulation, message: str = "", status: int = DONE) -> bool:
        """Go back to the last good state with half the step, where the script asks for that."""
        if not self.halve or self.halvings == HALVINGS:
            return False
        if status == STOPPED and explain.only_leave(self.hub, simulation, self.snapshot):
            return False
        message = message or explain.trouble(self.hub, simulation, status)[0]
        self.halvings += 1
        simulation.restore(self.snapshot)
        # Rows of log and dumps that have been written since go with what they show.
        self.marks.give(self.kept, cut=True)
        self.marks.begin()
        simulation.halve_step(self.halvings)
        while simulation.above_limit() and self.halvings < HALVINGS:
            # What is above the limit would only come back.
            self.halvings += 1
            simulation.halve_step(self.halvings)
        self.hub.warn(
            f"{message}. Back to step {simulation.step}, time {simulation.time:.6g}, with "
            f"1/{2**self.halvings} of the step",
            place=self.place,
        )
        return True

    def _goes_on(self) -> bool:
        values = self.hub.values
        if self.condition.names - {"time", "timestep", "dt"}:
            self.hub.refresh_values()
        holds = self.condition.evaluate(values)
        if isnan(holds):
            lost = sorted(name for name in self.condition.names if isnan(values.get(name)))
            raise ScriptError(
                f"step {self.hub.update.step}: nobody can tell whether the condition holds: "
                + (f"{lost[0]} is NaN" if lost else "a part of it is NaN"),
                place=self.place,
                expected="values that are numbers at every step",
            )
        return bool(holds) != self.until

    def _fraction(self, simulation: Simulation, first_step: int, first_time: float) -> float | None:
        if self.steps:
            return (simulation.step - first_step) / self.steps
        if isfinite(self.end_time) and self.end_time > first_time:
            return (simulation.time - first_time) / (self.end_time - first_time)
        return None

    # --- around the loop ----------------------------------------------------------------------

    def _note(self, number: int, _: Any = None) -> None:
        """Ctrl-C ends the run after the present chunk; a second one at once.

        So do the signals of batch systems and of terminals that are closed.
        """
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        if number == getattr(signal, "SIGHUP", None):
            self.hub.console.leave()

    def _banner(self, simulation: Simulation, going_on: bool) -> None:
        hub, why = self.hub, energy.unknown_work(self.hub)
        own = words_of_own_step(hub, simulation)
        hub.console.banner(
            f"Run, continued from step {simulation.step}" if going_on else "Run",
            {
                "method": hub.update.words,
                "points": int(simulation.present.sum()),
                "nodes": hub.fields.node_count,
                "bytes per particle": bytes_per_point(simulation),
                "dt": simulation.dt,
                "stable dt": simulation.limit,
                **({"own dt": own} if own else {}),
                "limited by": f"{ruling_limit(simulation)}; {words_of_share(hub)}",
                **({"energy": energy.not_watched(why)} if why else {}),
                **simulation.processes,
                "threads": simulation.threads,
                "precision": hub.settings.precision,
                **({"units": str(hub.output.units)} if hub.output.units else {}),
            },
        )

    def _summary(self, simulation: Simulation, first_step: int, wall: float) -> None:
        steps = simulation.step - first_step
        stages = [(name, float(passed)) for name, (passed, _) in self.spent.on.items()]
        stages.append(("rest", max(wall - sum(seconds for _, seconds in stages), 0.0)))
        in_steps, worked = self.spent.on["steps"]
        rate = steps * simulation.count / in_steps if in_steps > 0 else 0.0
        self.hub.console.summary(
            {
                "wall time": f"{wall:.3g} s",
                "steps": steps,
                "time": simulation.time,
                **energy.change_of_energy(simulation),
                "particle-steps/s": f"{rate:.3g}",
                "processor time": f"{worked:.3g} s in steps, of all threads",
                **boundary.counted(self.hub, simulation),
            },
            [(name, seconds) for name, seconds in stages if seconds > 0],
            title="Run interrupted" if self.interrupted else "Run finished",
        )
