"""Steps above the stable limit, of this run and of later ones, told before they are taken."""

from math import fsum, inf, isfinite
from typing import Any, NamedTuple

from karamelo_py.kernels.watch import BORNE
from karamelo_py.run.advice.resting import UNITS, mixed_units
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.timestep import own_step_instead, what_follows
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

MIXED = 300  # times the stable step, from where on units are likelier wrong than a guess


class Step(NamedTuple):
    """The step that a run has, where the script asks for it, and what its stable limit depends on.

    `span` says how long the run is, in time or in steps; infinite where a condition ends it.
    """

    place: Any
    fixed_dt: float | None
    dt_factor: float | None
    halves: bool
    scene: tuple
    span: tuple[float, float] = (inf, inf)

    @property
    def command(self) -> str:
        """What the script asks for it by."""
        return "set_dt" if self.fixed_dt else "dt_factor"

    @property
    def name(self) -> str:
        """By what is known that it has been told."""
        return f"{self.command} {self.fixed_dt or self.dt_factor}"


def step_of(hub: Hub, halves: bool, span: tuple[float, float] = (inf, inf)) -> Step:
    """The step that a run asks for here, which goes back and halves it in trouble or not."""
    update = hub.update
    method, scheme, transfer = update.method, update.scheme, update.transfer
    scene = (
        *(hub.domain.h, *hub.solids.values(), method, update.thermal),
        *(type(scheme), scheme, type(transfer), transfer),
    )
    return Step(update.dt_place, update.fixed_dt, update.dt_factor, halves, scene, span)


def step_was_told(hub: Hub) -> bool:
    """Whether a warning has said that the step is above the stable limit, and what to write."""
    return step_of(hub, False).name in hub.update.foreseen


def warn_about_steps(
    hub: Hub, simulation: Simulation, halves: bool, *, again: bool = False
) -> None:
    """Say so, once, where the step of this run or of a later one is above the stable limit.

    Who goes on from a file is told `again`.

    Raises
    ------
    ScriptError
        See `foresight.warn`.
    """
    present = step_of(hub, halves)
    _warn_about_step(hub, simulation, present, again=again)
    for step in hub.later[len(hub.runs) :]:
        if step.scene == present.scene:
            _warn_about_step(hub, simulation, step, later=True)
    hub.later.clear()


def duration_of_later(hub: Hub, simulation: Simulation) -> float:
    """How long the runs behind the next one are that have the same scene, as far as is known."""
    present = step_of(hub, False).scene
    later = [step for step in hub.later[len(hub.runs) :] if step.scene == present]
    spans = [min(s.span[0], s.span[1] * (s.fixed_dt or simulation.dt)) for s in later]
    return fsum(span for span in spans if isfinite(span))


def _warn_about_step(
    hub: Hub, simulation: Simulation, step: Step, *, later: bool = False, again: bool = False
) -> None:
    limit = simulation.limit_moving
    asked = step.fixed_dt or (step.dt_factor or 0) * limit
    if not asked > limit * (1 + 1e-12):
        return
    of_heat = float(simulation.control.clock[0].heat_limit)
    words = f"the step {asked:.4g} of {step.command} is "
    hint = own_step_instead(hub, step.command)
    if asked > BORNE * of_heat and not step.halves:
        words += (
            f"{asked / of_heat:.3g} times the stable one of conduction: temperatures would swing"
        )
        if not later:
            raise ScriptError(words, place=step.place, hint=hint)
    else:
        words += f"above the stable limit {limit:.4g}"
        words += (
            f" of conduction; beyond {BORNE:g} times that temperatures swing"
            if limit == of_heat
            else what_follows(hub, simulation, asked)
        )
        if step.fixed_dt and asked > MIXED * limit and limit != of_heat:
            words += f"; {mixed_units(hub, simulation)}"
            hint = f"{UNITS}. If they are as they should be, {hint}"
    told = hub.update.foreseen
    if again or step.name not in told:
        told += [step.name] * (step.name not in told)
        hub.warn(words, place=step.place, hint=hint)
