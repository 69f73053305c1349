"""Texts about a run: banner, warnings, errors, summary."""

from math import inf
from typing import Any

from karamelo_py.advice import crossing, energy, explain, known_failures
from karamelo_py.advice.facts import SceneFacts
from karamelo_py.advice.step_size import (
    own_step_instead,
    own_step_instead_of,
    stable_step,
    words_of_fraction,
    words_of_limit,
    words_of_own_step,
)
from karamelo_py.kernels.step import DONE
from karamelo_py.kernels.watch import WITHIN
from karamelo_py.points.basis import support
from karamelo_py.run.energy import unknown_work
from karamelo_py.run.listening import Listener, Trouble
from karamelo_py.run.loop import RunLoop
from karamelo_py.run.lower.memory import bytes_per_point
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.tiles import DIRECT_UP_TO
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import words_of_volumes
from karamelo_py.script.errors import render_message


class Narrator(Listener):
    def __init__(self, hub: Hub):
        self.hub = hub

    def begun(self, run: RunLoop, simulation: Simulation, *, resumed: bool = False) -> None:
        hub, halve = self.hub, run.rollback.point.halve
        self.smaller = ""
        if resumed:
            if run.ruined:
                self.smaller = "a smaller time step"  # the state in the file may be bad
            # With halved steps or load steps, the step is not the script's choice.
            if not (run.rollback.point.halvings or simulation.implicit):
                known_failures.warn_about_steps(hub, simulation, halve, again=True)
            self._tell_of_end(run, simulation)
            return
        steps = inf if run.steps is None else run.steps
        duration = min(run.end_time - simulation.time, steps * simulation.steps.later_dt)
        if simulation.implicit:
            known_failures.warn_about_factor(hub)
            known_failures.warn_about_steps_of_1(hub, simulation.time, steps)
            known_failures.warn_about_loads(hub, steps)
            known_failures.warn_about_weightless_water(hub, simulation)
            known_failures.warn_about_laws(hub, simulation, duration)
        else:
            known_failures.warn(hub, simulation, duration, halve)
            known_failures.warn_about_length(hub, simulation, run.end_time)

    def _tell_of_end(self, run: RunLoop, simulation: Simulation) -> None:
        step, time, last_step = simulation.step, simulation.time, run.last_step
        holds = f"{run.resumed_from} holds step {step}, time {time:.6g}"
        hint = "a longer run, or a file from before its end"
        if step > last_step or time > run.end_time:
            end = f"step {last_step}" if step > last_step else f"time {run.end_time:.6g}"
            message = f"{holds}, which is beyond the end of this run, {end}: it takes no step"
            self.hub.warn(message, hint=hint)
        elif step == last_step or time == run.end_time or not run.condition_allows():
            message = f"{holds}, the end of this run: it takes no further step"
            self.hub.console.say(render_message("note", message, hint=hint))

    def ready(self, simulation: Simulation, *, resumed: bool) -> None:
        hub, why = self.hub, unknown_work(self.hub)
        if simulation.steps.too_large:
            self.smaller = self.smaller or own_step_instead(simulation)
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
        chosen = hub.update.chosen
        if chosen:
            facts["chosen"] = chosen.facts
        shown = {
            "method": facts["method"],
            **(chosen.words if chosen else {}),
            "points": facts["points"],
            "volumes": words_of_volumes(hub),
            "nodes": facts["nodes"],
            "nodes per point": facts["nodes_per_point"],
            "bytes per particle": facts["bytes_per_point"],
            "dt": facts["dt"],
        }
        if not simulation.implicit:
            stable = stable_step(simulation, simulation.steps.limit)
            facts["stable_dt"] = shown["stable dt"] = stable
            facts["own_dt"] = dt = own_step_instead_of(simulation)
            shown["own dt"] = words_of_own_step(simulation, dt) if dt else None
            facts["limited_by"] = simulation.ruling_limit
            shown["limited by"] = f"{words_of_limit(simulation)}; {words_of_fraction(simulation)}"
        if why and simulation.moves:
            facts["energy_unwatched"], shown["energy"] = why, f"is {energy.not_watched(why)}"
        hub.record.begin(facts)
        if facts["processes"] > 1:
            alone = f", one has all points: up to {DIRECT_UP_TO} are not distributed"
            shown["processes"] = f"{facts['processes']}{alone * simulation.tiles.direct}"
        shown["gpu"] = hub.settings.card and hub.settings.card.name
        shown |= {name: facts[name] for name in ("threads", "precision")}
        shown["units"] = hub.output.units and str(hub.output.units)
        hub.console.banner(
            f"Run, continued from step {simulation.step}" if resumed else "Run",
            {name: value for name, value in shown.items() if value not in (None, "")},
        )

    def stepped(self, simulation: Simulation) -> None:
        hub, watch = self.hub, simulation.energy_watch
        if not watch.told_of_growth and watch.has_grown():
            gain = energy.words_of_growth(hub, simulation)
            hub.warn(gain.message, hint=gain.fix, code=gain.code, cause=gain.cause)
            watch.told_of_growth = True
        self._tell_of_loss(simulation, WITHIN)
        update = hub.update
        if update.boundary == "reflect" and not update.warned_of_bounces and simulation.bounces:
            update.warned_of_bounces = True
            hub.warn(
                f"by step {simulation.step}, time {simulation.time:.6g}, points were reflected "
                "at the edge of the domain; later reflections are only counted",
                mark=update.boundary_mark,
            )

    def _tell_of_loss(self, simulation: Simulation, within: float) -> None:
        hub, watch = self.hub, simulation.energy_watch
        if watch.told_of_loss or not watch.has_lost(within):
            return
        if loss := energy.words_of_loss(hub, simulation):
            hub.warn(loss.message, hint=loss.fix, code=loss.code, cause=loss.cause)
            watch.told_of_loss = True

    def wrong(self, simulation: Simulation, status: int, too_large: bool) -> Trouble | None:
        if status == DONE:
            return energy.words_of_growth(self.hub, simulation)
        return explain.trouble(self.hub, simulation, status, self.smaller * too_large)

    def ended(self, run: RunLoop, simulation: Simulation, first_step: int, wall: float) -> None:
        self._tell_of_loss(simulation, energy.LOSS)
        if self.hub.domain.thin:
            explain.warn_of_stress_left(self.hub, simulation)
        steps = simulation.step - first_step
        stages = [(name, float(passed)) for name, (passed, _) in run.timings.on.items()]
        stages.append(("rest", max(wall - sum(seconds for _, seconds in stages), 0.0)))
        in_steps, worked = run.timings.on["steps"]
        facts: dict[str, Any] = {
            "wall_s": wall,
            "steps": steps,
            "time": simulation.time,
            "energy_change_percent": simulation.energy_watch.change(),
            "energy_error_percent": simulation.energy_watch.error(),
            "lost_by_contact": self.hub.fields.lost_by_contact(),
            "lost_by_transfer": self.hub.fields.lost_by_transfer(),
            "path_cells": inf if simulation.implicit else float(simulation.control.motion[0].path),
            "point_steps_per_s": steps * simulation.count / in_steps if in_steps > 0 else 0.0,
            "processor_s_in_steps": float(worked),
            "seconds": dict(stages),
            "interrupted": bool(run.interrupted),
        }
        self.hub.record.finish(facts)
        error, path = facts["energy_error_percent"], facts["path_cells"]
        of_energy = {}
        if error is not None:
            of_energy = {
                "energy": energy.words_of_error(
                    self.hub, error, facts["lost_by_transfer"] is not None
                )
            }
            of_energy |= energy.words_of_losses(simulation)
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
                **_counted(simulation),
            },
            [(name, seconds) for name, seconds in stages if seconds > 0],
            title="Run interrupted" if run.interrupted else "Run finished",
        )


def _counted(simulation: Simulation) -> dict[str, int]:
    hub, deleted = simulation.hub, int((~simulation.present).sum())
    if len(hub.waiting) or len(hub.inactive):  # some points enter later, or may be activated later
        return {"points present": simulation.count - deleted}
    if deleted or hub.update.boundary == "delete":
        return {"deleted points": deleted}
    return {"reflections": simulation.bounces} if hub.update.boundary == "reflect" else {}
