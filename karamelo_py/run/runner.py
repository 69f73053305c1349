"""One run command: steps in chunks, outputs when they are due, and an eye on what goes wrong."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import InitVar, dataclass
from functools import partial
from math import inf, isfinite, isnan
from typing import Any

import numpy as np

from karamelo_py.compiler import cache
from karamelo_py.compiler.loops import compilation
from karamelo_py.points.basis import support
from karamelo_py.run import crossing
from karamelo_py.run.advice import known_failures
from karamelo_py.run.advice.facts import SceneFacts
from karamelo_py.run.advice.report import report
from karamelo_py.run.diagnosis import energy
from karamelo_py.run.lower.build import check_scene
from karamelo_py.run.lower.card import refuse, take_card
from karamelo_py.run.lower.memory import bytes_per_point
from karamelo_py.run.mpi.comm import check_same_run, handled_signals
from karamelo_py.run.recovery import RollBack, Stopped
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.tiles import DIRECT_UP_TO
from karamelo_py.run.timestep import (
    own_step_instead_of,
    ruling_limit,
    stable_step,
    words_of_own_step,
    words_of_share,
)
from karamelo_py.scene import boundary
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import attributed
from karamelo_py.scene.solid import words_of_volumes
from karamelo_py.script.errors import Pause, Quit, ScriptError, render_message

PATIENCE = 0.3  # seconds between two looks, about: for Ctrl-C and the progress bar
COMPILING = "Compiling the loops of this kind of scene, once (the next run starts at once) ..."
ANOTHER_FOLDER = "the environment variable KARAMELO_PY_CACHE names another folder"


def _clocks() -> np.ndarray:
    """Read the seconds that have passed, and that all threads have worked."""
    return np.array([time.perf_counter(), time.process_time()])


class Timings:
    """Seconds that a run spends: (2,) those that have passed, and those of all threads."""

    def __init__(self, hub: Hub):
        self.hub = hub
        self.on = {name: np.zeros(2) for name in ("compilation", "steps", "output")}
        self._depth = 0  # of compilation in the midst of compilation
        self._begun = np.zeros(2)

    def passed(self, name: str) -> float:
        return float(self.on[name][0])

    @contextmanager
    def counted(self, name: str) -> Iterator[None]:
        """Count what is done meanwhile, without compilation."""
        begun = _clocks() - self.on["compilation"]
        yield
        self.on[name] += _clocks() - self.on["compilation"] - begun

    @contextmanager
    def telling_of_compilation(self) -> Iterator[None]:
        """Say so when kernels are compiled, and count the time."""
        self._told = False
        telling = cache.telling(partial(self.hub.warn, hint=ANOTHER_FOLDER))
        with compilation.told_to(self), telling:
            yield

    def on_start(self, _: str) -> None:
        """Note that a kernel is compiled, or another process does, and this one waits for it."""
        self._depth += 1
        if self._depth == 1:
            self._begun = _clocks()
            if not self._told:
                self.hub.console.say(COMPILING)
                self._told = True

    def on_end(self) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.on["compilation"] += _clocks() - self._begun


class Interrupted(Exception):
    """The user pressed Ctrl-C, or another signal (its number) came; everything is written."""


def carry_out(hub: Hub, **length: Any) -> None:
    """Carry out a run command of a `length` (see `Runner`), or what stands for it now.

    A rehearsal takes note of it, a program stops in front of it, and ``check`` reports in its
    place; a run that was over in the file that a script goes on from is passed over.
    """
    runner = Runner(hub, **length)
    check_scene(hub)
    if hub.rehearsing:
        hub.begun += 1
        if hub.settings.card:
            refuse(hub)
        span = runner.end_time - hub.update.time, inf if runner.steps is None else runner.steps
        if not hub.update.scheme.traits.implicit:
            hub.later.append(known_failures.step_of(hub, runner.rollback.halve, span))
        hub.in_runs += hub.lasting()
        return
    if hub.pausing:
        raise Pause
    hub.begun += 1
    hub.rehearse()
    if hub.checking:
        report(hub, runner.end_time)
        runner.warn(hub.simulation)
        hub.simulation.refuse()
        if hub.simulation.implicit:
            hub.simulation.load_steps.refuse_all_loose()
        raise Quit
    take_card(hub)
    replay = hub.interpreter.replay
    if replay is None or replay.at_end:
        runner.run()
        return
    after = hub.restart.content["runs"][len(hub.runs)]
    for name, value in after.items():
        if name in hub.values:
            hub.values.set(name, value)
    hub.runs.append(after)


@dataclass(eq=False)
class Runner:
    """Runs a scene for a number of steps, to a time, or by a condition.

    It ends where the condition holds (`until`), else where it does not. With `halve` it goes back
    and halves the step where that goes wrong.
    """

    hub: Hub
    steps: int | None = None
    end_time: float = inf
    condition: Any = None
    until: bool = False
    halve: InitVar[bool] = False

    signal = 0  # that this process has been sent
    interrupted = 0  # the signal that all processes end with

    def __post_init__(self, halve: bool) -> None:
        self.rollback = RollBack(self.hub, halve=halve)
        self.place = self.hub.place
        self.timings = Timings(self.hub)

    def run(self) -> None:
        hub = self.hub
        hub.running = self
        try:
            check_same_run(hub)
            with self.timings.telling_of_compilation(), attributed(hub):
                self._run(hub.simulation)
        finally:
            hub.running = None
        hub.runs.append({name: hub.values.get(name) for name in hub.values.names()})

    def warn(self, simulation: Simulation) -> None:
        """Warn of what is known to go wrong in this run, and of one that is very long."""
        steps = inf if self.steps is None else self.steps * simulation.dt
        duration = min(self.end_time - simulation.time, steps)
        if simulation.implicit:
            known_failures.warn_about_factor(self.hub)
            known_failures.warn_about_loads(self.hub, inf if self.steps is None else self.steps)
            known_failures.warn_about_laws(self.hub, simulation, duration)
            return
        known_failures.warn(self.hub, simulation, duration, self.rollback.halve)
        known_failures.warn_about_length(self.hub, simulation, self.end_time)

    def _run(self, simulation: Simulation) -> None:
        hub = self.hub
        started = time.perf_counter()
        self.first_step, self.first_time = simulation.step, simulation.time
        self.last_step = inf if self.steps is None else self.first_step + self.steps
        ruined, going_on = False, hub.restart is not None
        if going_on:
            ruined = self._take_up(simulation)
        else:
            simulation.begin(self.end_time)
            self.warn(simulation)
        simulation.compile()
        began = simulation.step
        self._banner(simulation, going_on)
        with handled_signals(self._note):
            with self.timings.counted("output"):
                hub.output.begin(within=going_on)
            hub.console.begin_run(simulation.step, 0.0)
            try:
                looks = self.condition is not None
                self.rollback.begin(simulation, self.first_step, ruined=ruined, looks_always=looks)
                self._loop(simulation)
                with self.timings.counted("output"):
                    hub.console.end_run()
                    if self.interrupted:
                        # Before the last state of this run is written, which a longer one has not.
                        hub.output.write_last()
                    hub.output.end()
                self._agree(simulation)  # a signal may have come meanwhile: no further run begins
            except BaseException as error:
                hub.console.end_run()
                hub.output.abort()
                if isinstance(error, Stopped):
                    simulation.comm.end_together()
                raise
        self.rollback.tell_of_loss(energy.LOSS)
        self._summary(simulation, began, time.perf_counter() - started)
        if self.interrupted:
            simulation.comm.end_together()
            raise Interrupted(self.interrupted)

    def _take_up(self, simulation: Simulation) -> bool:
        """Take the state of a file; say whether a step above the limit has spoilt it."""
        hub, file = self.hub, self.hub.restart.path
        hub.restart.take(hub, outputs=True)
        hub.restart = hub.interpreter.replay = None
        watched = simulation.control.clock[0].watch_limit
        simulation.go_on(self.end_time, self.rollback.halvings)
        if not (self.rollback.halvings or simulation.implicit):  # else it is not the script's
            known_failures.warn_about_steps(hub, simulation, self.rollback.halve, again=True)
        # It may hold the end of this run already, or later states.
        step, time, last_step = simulation.step, simulation.time, self.last_step
        holds = f"{file} holds step {step}, time {time:.6g}"
        hint = "a longer run, or a file from before its end"
        if step > last_step or time > self.end_time:
            end = f"step {last_step}" if step > last_step else f"time {self.end_time:.6g}"
            message = f"{holds}, which is beyond the end of this run, {end}: it takes no step"
            self.hub.warn(message, hint=hint, place=self.place)
        elif step == last_step or time == self.end_time or not self._condition_allows():
            message = f"{holds}, the end of this run: it takes no further step"
            self.hub.console.say(render_message("note", message, hint=hint))
        return not watched and step > self.first_step

    def _loop(self, simulation: Simulation) -> None:
        hub, rollback, timings = self.hub, self.rollback, self.timings
        self._rhythms = {fix.every for fix in hub.fixes.values() if fix.every}
        most = simulation.states_every
        length, longest = 1, most if self.condition is None else 1
        while self._goes_on(simulation):
            rollback.before()
            step, before = simulation.step, {name: timings.passed(name) for name in timings.on}
            kept = (step // most + 1) * most  # where a state may be kept
            end = min(hub.output.next_step(step), self.last_step, step + length, kept)
            end = min([end, *((step // every + 1) * every for every in self._rhythms)])
            with timings.counted("steps"):
                status = simulation.advance(int(end) - step)
            self._agree(simulation)  # what is written shows steps that no process has failed in
            if not rollback.after(status):
                length = 1
                continue
            boundary.tell_of_bounces(hub, simulation)
            rollback.act_between_steps()
            elapsed = simulation.comm.bcast(timings.passed("steps") - before["steps"])
            in_time = PATIENCE * max(simulation.step - step, 1) / max(elapsed, 1e-9)
            length = int(min(longest, max(1, in_time)))
            with timings.counted("output"):
                if self._steps_left(simulation):
                    hub.output.write()
                anew = timings.passed("compilation") > before["compilation"]
                self.show_progress(simulation, anew=anew)

    def _goes_on(self, simulation: Simulation) -> bool:
        if not self._steps_left(simulation):
            return False
        if self._condition_allows():
            self._agree(simulation)
            return not self.interrupted
        if simulation.step == self.first_step:
            # A comparison that was forgotten, or turned round, ends a run at once.
            holds = "holds" if self.until else "does not hold"
            self.hub.warn(
                f"the condition {holds} before the first step of this run: it takes none",
                hint="run_until ends where its condition is anything but 0, run_while where it is "
                "0; comparisons are 1 or 0",
                place=self.place,
            )
        return False

    def _agree(self, simulation: Simulation) -> None:
        """Learn which signal any of the processes has been sent."""
        self.interrupted = int(simulation.comm.allreduce_max(np.array([self.signal]))[0])

    def _steps_left(self, simulation: Simulation) -> bool:
        # A limit load ends a run, too: it moves the end to the time that was reached.
        end_time = simulation.control.clock[0].end_time
        return simulation.step < self.last_step and simulation.time < end_time

    def _condition_allows(self) -> bool:
        if self.condition is None:
            return True
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

    def show_progress(
        self, simulation: Simulation, within: str = "", *, anew: bool = False
    ) -> None:
        """Show how far the run is, and a step; `anew` where a rate would count compilation."""
        console, fraction = self.hub.console, None
        if self.steps:
            fraction = (simulation.step - self.first_step) / self.steps
        elif isfinite(self.end_time) and self.end_time > self.first_time:
            fraction = (simulation.time - self.first_time) / (self.end_time - self.first_time)
        if anew:
            console.end_run()
            console.begin_run(simulation.step, fraction or 0.0)
        console.progress(simulation.step, simulation.time, fraction, within)

    def _note(self, number: int, _: Any = None) -> None:
        """Note a signal: it ends the run after the present chunk; a second one at once."""
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        if number == getattr(signal, "SIGHUP", None):
            self.hub.console.leave()

    def _banner(self, simulation: Simulation, going_on: bool) -> None:
        """Begin the record of this run, and print it."""
        hub, why = self.hub, energy.unknown_work(self.hub)
        facts: dict[str, Any] = {
            "method": hub.update.words,
            "points": int(simulation.present.sum()),
            "nodes": hub.fields.node_count,
            "nodes_per_point": support(simulation.setup.basis, simulation.setup.kin),
            "bytes_per_point": bytes_per_point(simulation),
            "dt": simulation.dt,
            "first_step": simulation.step,
            "first_time": simulation.time,
            "processes": simulation.comm.size,
            "threads": simulation.threads,
            "precision": hub.settings.precision,
        }
        if not simulation.implicit:
            facts["stable_dt"] = stable_step(hub, simulation, simulation.limit)
            facts["own_dt"] = own_step_instead_of(hub, simulation)
            facts["limited_by"] = ruling_limit(simulation)
        if why and simulation.moves:
            facts["energy_unwatched"] = why
        hub.record.begin(facts)
        own = words_of_own_step(hub, simulation)
        alone = f", one has all points: up to {DIRECT_UP_TO} are not shared out"
        shown = {
            "method": facts["method"],
            "points": facts["points"],
            "volumes": words_of_volumes(hub),
            "nodes": facts["nodes"],
            "nodes per point": facts["nodes_per_point"],
            "bytes per particle": facts["bytes_per_point"],
            "dt": facts["dt"],
            "stable dt": facts.get("stable_dt"),
            "own dt": None if simulation.implicit else own,
            "limited by": "limited_by" in facts and f"{facts['limited_by']}; {words_of_share(hub)}",
            "energy": "energy_unwatched" in facts and energy.not_watched(why),
            "processes": facts["processes"] > 1
            and f"{facts['processes']}{alone if simulation.tiles.direct else ''}",
            "gpu": hub.settings.card and hub.settings.card.name,
            "threads": facts["threads"],
            "precision": facts["precision"],
            "units": hub.output.units and str(hub.output.units),
        }
        hub.console.banner(
            f"Run, continued from step {simulation.step}" if going_on else "Run",
            {name: of for name, of in shown.items() if of or (of == 0 and of is not False)},
        )

    def _summary(self, simulation: Simulation, first_step: int, wall: float) -> None:
        steps = simulation.step - first_step
        stages = [(name, float(passed)) for name, (passed, _) in self.timings.on.items()]
        stages.append(("rest", max(wall - sum(seconds for _, seconds in stages), 0.0)))
        in_steps, worked = self.timings.on["steps"]
        facts: dict[str, Any] = {
            "wall_s": wall,
            "steps": steps,
            "time": simulation.time,
            "energy_change_percent": energy.change_of_energy(simulation),
            "path_cells": inf if simulation.implicit else float(simulation.control.clock[0].path),
            "point_steps_per_s": steps * simulation.count / in_steps if in_steps > 0 else 0.0,
            "processor_s_in_steps": float(worked),
            "seconds": dict(stages),
            "interrupted": bool(self.interrupted),
        }
        self.hub.record.finish(facts)
        change, path = facts["energy_change_percent"], facts["path_cells"]
        of_energy = {} if change is None else {"energy": energy.words_of_change(self.hub, change)}
        self.hub.console.summary(
            {
                "wall time": f"{wall:.3g} s",
                "steps": steps,
                "time": simulation.time,
                **of_energy,
                **crossing.words_at_end(SceneFacts(self.hub, simulation, simulation.time)),
                **({"path": f"{path:.3g} cells at most"} if path < inf else {}),
                "particle-steps/s": f"{facts['point_steps_per_s']:.3g}",
                "processor time": f"{worked:.3g} s in steps, of all threads",
                **boundary.counted(self.hub, simulation),
            },
            [(name, seconds) for name, seconds in stages if seconds > 0],
            title="Run interrupted" if self.interrupted else "Run finished",
        )
