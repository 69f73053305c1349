"""The step size: a policy chosen once per run, applied by the clock of the kernels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import DT, TIME, Control, Tag
from karamelo_py.kernels.clock import STILL, choose_dt
from karamelo_py.kernels.step import measure
from karamelo_py.points.transfers import flip_coefficient
from karamelo_py.run.no_number import endless_speed
from karamelo_py.run.stable_step import (
    common_velocity,
    conserving_fraction,
    courant_number,
    own_step_of_waves,
    own_weight_of_drift,
    stable_conduction,
)
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.schemes.traits import DEFAULT_FRACTION
from karamelo_py.script.errors import ScriptError

NO_STRIDE = 1e9  # path in cells that points never reach
# Largest / smallest stable step in a large vibration. Without losses in the transfer, a step that
# follows the strain in each vibration adds energy; a step that is held adds none.
RELEASE = 1.9


class StepPolicy(NamedTuple):
    still: tuple[float, float]  # stable step / (h/c), and the fraction used, at rest
    moving: tuple[float, float]
    weight: float  # weight of the common velocity in the rate
    fixed_dt: float  # 0 if the step adapts to the fastest point
    heat_factor: float  # fraction of the limit of conduction
    release: float = 0.0  # `release` of the clock

    @classmethod
    def of(cls, hub: Hub) -> StepPolicy:
        update = hub.update
        fixed = update.fixed_dt or float(update.scheme.traits.implicit)  # implicit: 1 by default
        release = RELEASE * update.transfer.traits.lossless
        if update.dt_factor is None and update.fixed_dt is None:
            still, moving = (own_step_of_waves(hub, still=still) for still in (True, False))
            return cls(still, moving, own_weight_of_drift(hub), fixed, DEFAULT_FRACTION, release)
        # Fractions that scripts set refer to h/(c + |v|), even if the points are at rest.
        asked = courant_number(hub, longer=False), update.dt_factor or conserving_fraction(hub)
        release *= not fixed
        return cls(asked, asked, 1.0, fixed, update.dt_factor or DEFAULT_FRACTION, release)

    def numbers(self, path: float, halvings: int) -> dict[str, float]:
        """Return clock fields for points whose longest path so far is `path`, in cells."""
        (courant, fraction), scale = self.still if path <= STILL else self.moving, 1 / 2**halvings
        return {
            "courant": courant,
            "courant_moving": self.moving[0],
            "fixed_dt": self.fixed_dt * scale,
            "heat_factor": self.heat_factor * scale,
            "dt_factor": fraction * scale,
            "dt_factor_moving": self.moving[1] * scale,
            "release": self.release,
        }


Carried = tuple[float, float, float, float, float]


def carried_on(control: Control) -> Carried:
    """Return last dt, contact dt, held limit, path and loss of deleted points for new arrays."""
    step, path, lost = control.step[0], control.motion[0].path, control.energy[0].lost_with_deleted
    times = float(step.last_dt), float(step.last_contact_dt), float(step.held)
    return *times, float(path), float(lost)


def set_up(control: Control, hub: Hub, transfer: Tag, last: Carried | None) -> None:
    """Set the clock of new arrays, continuing after the `last` steps."""
    step, heat = control.step[0], control.heat[0]
    if last is not None:
        step.last_dt, step.last_contact_dt, step.held, control.motion[0].path, lost = last
        control.energy[0].lost_with_deleted = lost
    step.spacing = min(lattice.h for lattice in hub.lattices)
    heat.heat_limit = heat.heat_reference = stable_conduction(hub)
    step.kept = flip_coefficient(transfer)
    step.kept_by_time = step.kept * transfer.traits.per_time


class StepSize:
    """Chooses the steps. No other Python code writes steps to the clock."""

    policy: StepPolicy

    def __init__(self, simulation: SceneState):
        self.simulation, self.control = simulation, simulation.control
        self.step, self.motion = self.control.step[0], self.control.motion[0]
        self.measured = False  # True if motion.rate is measured in the present state

    def begin(self, end_time: float) -> None:
        self.policy = StepPolicy.of(self.simulation.hub)
        self._set_limits(0)
        self.step.end_time = end_time
        self.step.over_limit = 0
        self._choose()

    def choose_first(self) -> None:
        """Choose the first step again, as fixes may have changed the fastest point."""
        simulation, step, motion = self.simulation, self.step, self.motion
        in_hundred_steps = 100 * simulation.fastest() * step.courant * step.dt_factor
        if simulation.step == 0 and in_hundred_steps > STILL * motion.rate:
            motion.path = np.inf
            self._set_limits(0)
        self._choose()
        if not np.isfinite(simulation.dt):
            if not np.isfinite(simulation.fastest()):
                raise endless_speed(simulation)
            raise ScriptError(
                "cannot choose a time step: all material is rigid and at rest",
                hint="set_dt(...), or a velocity from fix initial_velocity_particles",
            )
        if step.first_limit == 0 and np.isfinite(self.limit) and not simulation.hub.update.fixed_dt:
            step.first_limit = self.limit
        self._watch_limit()

    def go_on(self, end_time: float, halvings: int) -> None:
        step, self.policy = self.step, StepPolicy.of(self.simulation.hub)
        other_end, step.end_time = step.end_time != end_time, end_time
        over_limit = step.over_limit
        if self._set_limits(halvings):
            self._choose()
            self._watch_limit()
        elif other_end:
            choose_dt(self.control)
            step.over_limit = over_limit

    def halve(self, times: int) -> None:
        self._set_limits(times)
        choose_dt(self.control)
        self._watch_limit()

    def end_here(self) -> float:
        time = self.step.end_time = float(self.control.values[TIME])
        return time

    def load_step(self, dt: float) -> None:
        self.control.values[DT] = self.step.kick = self.step.last_dt = dt

    def anew(self) -> None:
        self.step.last_dt = 0.0

    @contextmanager
    def altered(self, **fields: float) -> Iterator[None]:
        before = {name: float(self.step[name]) for name in fields}
        for name, value in fields.items():
            self.step[name] = value
        try:
            yield
        finally:
            for name, value in before.items():
                self.step[name] = value

    def _set_limits(self, halvings: int) -> bool:
        simulation, step, motion = self.simulation, self.step, self.motion
        numbers = self.policy.numbers(float(motion.path), halvings)
        numbers["first_kick"] = 0.5 if simulation.hub.update.half_start else 1.0
        before = {name: step[name] for name in numbers}
        for name, number in numbers.items():
            step[name] = number
        stride, motion.stride = motion.stride, NO_STRIDE if simulation.implicit else 1.0
        if self.policy.weight != motion.weight:
            motion.weight, self.measured = self.policy.weight, False
        return numbers != before or motion.stride != stride

    def _choose(self) -> None:
        # A measured rate is reused, so that several runs take the same steps as one long run.
        if not self.measured:
            simulation, motion = self.simulation, self.motion
            self._measure(float(motion.weight))
            motion.wave = motion.speed = 0.0
            if motion.weight != 1:
                motion.wave = motion.rate - simulation.fastest(motion.common[0])
                motion.speed = simulation.fastest() / self.step.spacing
            self.measured = True
        choose_dt(self.control)

    def _measure(self, weight: float) -> None:
        simulation, motion = self.simulation, self.motion
        motion.common[:] = common_velocity(simulation, weight)
        measure(simulation.setup)
        rates = simulation.comm.allreduce_max(np.array([motion.rate, motion.closing]))
        motion.rate, motion.closing = rates

    def rate_with(self, weight: float) -> float:
        motion = self.motion
        before = motion.common.copy(), float(motion.rate), float(motion.closing)
        self._measure(weight)
        other = float(motion.rate)
        motion.common[:], motion.rate, motion.closing = before
        return other

    @property
    def later_dt(self) -> float:
        """Size of later steps; the first one is shorter if cells may close (`motion.closing`)."""
        motion, dt = self.motion, self.simulation.dt
        if self.step.fixed_dt > 0 or not 0 < motion.rate < motion.closing:
            return dt
        return dt * float(motion.closing / motion.rate)

    @property
    def limit(self) -> float:
        return float(self.step.limit)

    @property
    def limit_moving(self) -> float:
        """Stable step of points that cross cells, to which fractions in scripts refer."""
        step, rate = self.step, max(self.motion.rate, self.motion.closing)
        waves = step.courant_moving * step.spacing / rate if rate > 0 else np.inf
        return float(min(waves, self.control.heat[0].heat_limit))

    def above_limit(self) -> bool:
        explicit = not self.simulation.implicit
        return explicit and self.control.values[DT] > self.limit * (1 + 1e-12)

    @property
    def too_large(self) -> bool:
        """True if the step was above the stability limit when it was chosen."""
        return not self.step.watch_limit and not self.simulation.implicit

    def _watch_limit(self) -> None:
        self.step.watch_limit = int(not self.above_limit() and not self.simulation.implicit)
        self.step.over_limit = 0
