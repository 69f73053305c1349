"""Time integration of a lowered scene: chunks of compiled steps, controlled from Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numba import config

from karamelo_py.kernels.arrays import DT, TIME, Hooks, NoHooks, Setup
from karamelo_py.kernels.clock import STILL, choose_dt
from karamelo_py.kernels.hooks import POINT_STAGES
from karamelo_py.kernels.step import (
    DONE,
    SORT,
    Fused,
    Staged,
    StepKind,
    advance,
    measure,
    run_steps,
)
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.kernels.watch import COARSE, ROUND_OFF, begin_to_look, measure_heat, sum_energies
from karamelo_py.run import timestep
from karamelo_py.run.energy import unknown_heat, unknown_work
from karamelo_py.run.light_nodes import stable_share
from karamelo_py.run.lower.hooks import PythonHooks, sets_initial_state, views_of
from karamelo_py.run.mpi.whole import PointsMoved, Whole
from karamelo_py.run.no_number import refuse_endless_speeds
from karamelo_py.run.scene_arrays import SceneArrays
from karamelo_py.run.timestep import StepPolicy
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

FAR = 1e9  # cells, further than points ever move


class Simulation(SceneArrays):
    """Take the steps of a scene, or of the part of one process."""

    def __init__(self, hub: Hub, previous: Simulation | None = None):
        super().__init__(hub, previous)
        # Fixes of the first step that have acted: not again when the scene is lowered again.
        self.begun: set[Any] = set(previous.begun) if previous else set()
        self.visits: Staged | Fused = Fused()
        self.hooks: Hooks | NoHooks = NoHooks()
        self._first: PythonHooks | None = None
        self._first_fixes: list = []
        self.beginning: list = []  # fixes of the first step that act in this run

    states_every = 100  # steps between two states that a run can go back to
    between: Callable[[str], bool] | None = None
    taken_up = False  # a step continues with other arrays after its first stage

    @cached_property
    def _whole(self) -> Whole:
        return Whole(self)

    @cached_property
    def light_nodes(self) -> float:
        """Return the stable step over h/c that the nodes of thin and round solids allow."""
        return stable_share(self.hub, self.setup.grids)

    def act(self, function: Callable[[Setup], None], s: Setup) -> None:
        """Call a function on the arrays of the whole scene."""
        if self.subdomain is None:
            function(s)
        else:
            self._whole.act(function)

    def begin(self, end_time: float) -> None:
        """Start a run: choose the first dt; the run ends at `end_time` at the latest."""
        clock, self.policy = self.control.clock[0], StepPolicy.of(self.hub)
        self._ask_for_steps(0)
        clock.end_time = end_time
        clock.over_limit = 0
        # Twice: initial values may be formulas of dt, and dt follows the fastest point.
        self._choose_dt()
        begun_before = len(self.begun)
        self._make_ready()
        in_hundred_steps = 100 * self.fastest() * clock.courant * clock.dt_factor
        if self.step == 0 and in_hundred_steps > STILL * clock.rate:
            clock.path = np.inf
            self._ask_for_steps(0)
        self._choose_dt()
        if not np.isfinite(self.dt):
            refuse_endless_speeds(self.hub, self)
            raise ScriptError(
                "nothing limits the time step: all that there is is rigid and at rest",
                hint="set_dt(...), or a velocity from fix initial_velocity_particles",
            )
        # A body at rest without waves has no first limit for comparison.
        if clock.first_limit == 0 and np.isfinite(self.limit) and not self.hub.update.fixed_dt:
            clock.first_limit = self.limit
        self._watch_limit()
        self._watch_energy(begun_before)

    def go_on(self, end_time: float, halvings: int) -> None:
        """Continue to this end with a state that was put into the arrays, instead of `begin`."""
        clock, self.policy = self.control.clock[0], StepPolicy.of(self.hub)
        self._make_ready()
        other_end, clock.end_time = clock.end_time != end_time, end_time
        over_limit = clock.over_limit
        if self._ask_for_steps(halvings):
            self._choose_dt()
            self._watch_limit()
        elif other_end:
            choose_dt(self.control)
            clock.over_limit = over_limit

    def halve_step(self, times: int) -> None:
        """Halve the initial step `times` times, from now on in this run."""
        self._ask_for_steps(times)
        choose_dt(self.control)
        self._watch_limit()

    def _ask_for_steps(self, halvings: int) -> bool:
        """Set the requested steps in the clock; return whether they have changed."""
        clock = self.control.clock[0]
        numbers = self.policy.numbers(float(clock.path), halvings)
        numbers["first_kick"] = 0.5 if self.hub.update.half_start else 1.0
        numbers["stride"] = FAR if self.implicit else 1.0
        before = {name: clock[name] for name in numbers}
        for name, number in numbers.items():
            clock[name] = number
        if self.policy.weight != clock.weight:
            clock.weight, self.measured = self.policy.weight, False
        return numbers != before

    def _choose_dt(self) -> None:
        if not self.measured:
            # Otherwise the last step has measured, and a run in pieces takes the steps of a whole.
            clock = self.control.clock[0]
            clock.common[:] = timestep.common_velocity(self, float(clock.weight))
            self._measure()
            clock.wave = clock.speed = 0.0
            if clock.weight != 1:
                clock.wave = clock.rate - self.fastest(clock.common[0])
                clock.speed = self.fastest() / clock.spacing
            self.measured = True
        choose_dt(self.control)

    def rate_with(self, weight: float) -> float:
        """Return the rate of the fastest point, if the common drift of all had this weight."""
        clock = self.control.clock[0]
        common, rate = clock.common.copy(), float(clock.rate)
        clock.common[:] = timestep.common_velocity(self, weight)
        self._measure()
        found = float(clock.rate)
        clock.common[:], clock.rate = common, rate
        return found

    def _measure(self) -> None:
        measure(self.setup)
        clock = self.control.clock[0]
        clock.rate = self.comm.allreduce_max(np.array([clock.rate]))[0]

    def fastest(self, common: Sequence[float] = (0.0, 0.0, 0.0)) -> float:
        """Return the largest velocity component of all points, relative to a common velocity."""
        velocities = (block.points.v for block in self.setup.blocks)
        # No copy of them: there may be millions.
        components = ((a, c) for v in velocities if v.size for a, c in zip(v, common, strict=False))
        own = max((max(a.max() - c, c - a.min()) for a, c in components), default=0.0)
        return float(self.comm.allreduce_max(np.array([own], float))[0])

    @property
    def limit(self) -> float:
        """Return the stable step of the present state."""
        return float(self.control.clock[0].limit)

    @property
    def ruling_limit(self) -> str:
        return timestep.ruling_limit(self)

    @property
    def limit_moving(self) -> float:
        """Return the stable step of points that cross cells, the basis of a script's fractions."""
        clock = self.control.clock[0]
        waves = clock.courant_moving * clock.spacing / clock.rate if clock.rate > 0 else np.inf
        return float(min(waves, clock.heat_limit))

    def above_limit(self) -> bool:
        return not self.implicit and self.control.values[DT] > self.limit * (1 + 1e-12)

    @property
    def too_large(self) -> bool:
        """Return True if the step was above the stability limit from the start of the run."""
        return not self.control.clock[0].watch_limit and not self.implicit

    def _watch_limit(self) -> None:
        """Watch the limit, unless the step exceeds it from the start, as the user wants."""
        clock = self.control.clock[0]
        clock.watch_limit = int(not self.above_limit() and not self.implicit)
        clock.over_limit = 0

    def _watch_energy(self, begun_before: int) -> None:
        """Begin to watch the energy balance, or continue if nothing was changed since."""
        clock = self.control.clock[0]
        clock.watch_energy = int(not unknown_work(self.hub) and self.moves)
        set_anew = len(self.begun) > begun_before or bool(self._first_fixes)
        anew = not self.followed or set_anew
        self.followed = self.moves  # load steps are not in the balance
        if anew:
            self.told_of_growth = self.told_of_loss = False
        if clock.watch_energy:
            # Velocities belong to half a step earlier, stresses to the fraction strained before.
            level = 0.25 + 0.5 * self.hub.update.scheme.traits.strained_before
            self._begin_to_look(level, anew)
        clock.watch_heat = int(self.hub.update.thermal and not unknown_heat(self.hub))
        if clock.watch_heat and anew:
            measure_heat(self.setup)
            agree_on_heat(self.control.ranks, self.control)
            clock.coldest, clock.hottest = clock.T_low, clock.T_high

    def _begin_to_look(self, level: float, anew: bool) -> None:
        """Measure the initial energies of all points for the watch."""
        s, clock = self.setup, self.control.clock[0]
        strain = COARSE * float(np.finfo(s.nodes.sums.dtype).eps)
        clock.energy_floor = (
            max(ROUND_OFF, strain**2) * self.points.total("mass") * float(clock.rate) ** 2
        )
        clock.born_with = self.points.total("born with")
        if anew:
            clock.to_and_fro = 2 * self._length() / max(float(clock.wave or clock.rate), 1e-300)
        # Energies are summed by tile.
        if self._outside_tiles():
            self.sort()
            self.mapped = False
        begin_to_look(self.setup, self.mode, level, anew)

    def _length(self) -> float:
        """Find the longest side of the box around all points."""
        d = self.kin.dimension
        ends = np.full(2 * d, -np.inf)
        for block in self.setup.blocks:
            x = block.points.x[self.now][:d]
            own = np.concatenate(
                [x.max(axis=1, initial=-np.inf), (-x).max(axis=1, initial=-np.inf)]
            )
            ends = np.maximum(ends, own)
        ends = self.comm.allreduce_max(ends)
        return float((ends[:d] + ends[d:]).max())

    def _outside_tiles(self) -> int:
        """Count the blocks with points that were not sorted yet."""
        own = 0
        for points, tiling in ((block.points, block.tiling) for block in self.setup.blocks):
            own += tiling.range[: tiling.count[0], 1].max(initial=0) != points.mass.size
        return int(self.comm.allreduce(np.array([own]))[0])

    def energy(self) -> float:
        """Sum kinetic, stored and dissipated energy minus the work; NaN if it is not watched."""
        clock = self.control.clock
        if self._outside_tiles() or not clock[0].watch_energy:
            return np.nan
        present = clock.copy()
        sum_energies(self.setup, self.mode)
        energy = float(clock[0].kinetic + clock[0].stored - clock[0].work)
        clock[:] = present
        return energy

    @property
    def step_kind(self) -> StepKind:
        """The tags that select the code of a step."""
        return StepKind(self.hub.update.scheme, self.visits, self.mode)

    def advance(self, count: int, between: Callable[[str], bool] | None = None) -> int:
        """Take up to `count` steps (to the end time at most); DONE, or why it stopped.

        Load steps call `between` with words of how far one is; if it returns True, they end.
        """
        self.between = between
        self.control.clock[0].wrong = 0  # from earlier steps that were not undone
        with self.comm.joint():
            if self.subdomain is None:
                return self._advance_to(self.step + count)
            from_python = bool(self.python.by_stage or self._first is not None)
            self.subdomain.begin(self.hooks, from_python=from_python)
            status = self._advance_to(self.step + count)
            self.subdomain.end()
            return status

    def _advance_to(self, target: int) -> int:
        control = self.control
        while True:
            self.sort_if_due()  # not after the last step, whose nodes are output
            try:
                status = self._advance(target - self.step)
            except PointsMoved:
                self.taken_up = True
                continue
            self.mapped = True
            if status != SORT:
                return status
            if self.step >= target or control.values[TIME] >= control.clock[0].end_time:
                return DONE

    def _advance(self, count: int) -> int:
        """Take compiled steps; row by row where Python acts between these; or load steps."""
        scheme, first = self.hub.update.scheme, self._first
        hooks = first or self._acting
        count = count if first is None else 1
        if self.implicit:
            status = self.load_steps.advance(hooks, count)
        elif isinstance(hooks, PythonHooks):
            status = run_steps(StepKind(scheme, Staged(), self.mode), self.setup, hooks, count)
        else:
            status = advance(self.step_kind, self.setup, hooks, count)
        if first is None or status not in (DONE, SORT):
            return status
        self.begun |= set(self._first_fixes)
        self._first = None
        self.clear_forces()  # later steps may have no hook that does it
        return SORT  # not finished, unless all steps are done

    @property
    def _acting(self) -> Any:
        """Return the tag for a step: compiled hooks, or Python between its rows."""
        return self._called or (self.python if self.python.by_stage else self.hooks)

    @property
    def acting(self) -> list:
        """Return the fixes that act in the next step."""
        return (self._first or self.python).fixes

    @property
    def begins(self) -> bool:
        """Return True if fixes of the first step are still to act."""
        return self._first is not None

    @property
    def implicit(self) -> bool:
        """Return True if the scheme solves equations."""
        return self.hub.update.scheme.traits.implicit

    @property
    def moves(self) -> bool:
        """Return True if there is inertia; without it the energy is not watched."""
        return self.hub.update.scheme.traits.inertia

    @cached_property
    def load_steps(self) -> Any:
        """Take the steps of an implicit scheme."""
        from karamelo_py.run.implicit.load_steps import LoadSteps

        return LoadSteps(self)

    def refuse(self) -> None:
        """Refuse a scene that cannot run here: none."""

    def compile(self) -> None:
        """Compile the loop over the steps now, rather than in the middle of a log."""
        hooks = self._acting
        if config.DISABLE_JIT or isinstance(hooks, PythonHooks) or self.implicit:
            return
        self.comm.in_turn(lambda: advance.compile(self.step_kind, self.setup, hooks, 1))

    def _make_ready(self) -> None:
        """Prepare the hooks of the fixes, and contact, for a run."""
        # Fixes act once before the first step, in it, or in every step.
        fixes = sorted(self.hub.fixes.values(), key=lambda fix: fix.order)
        lasting = [fix for fix in fixes if not fix.first_step_only]
        new = [fix for fix in fixes if fix.first_step_only and fix not in self.begun]
        self.python = PythonHooks(self, lasting)
        self.hooks = self.python.compiled
        self._called = None if self.implicit else self.python.called()
        staged = self.python.by_stage or any(
            name in POINT_STAGES for fix in lasting for name in fix.hooks()
        )
        self.visits = Staged() if staged else Fused()
        at_once = [fix for fix in new if sets_initial_state(fix)]
        for fix in at_once:
            # Nothing precedes this hook in a step: the output shows its state from the start.
            self._set_initial(fix)
        self.begun |= set(at_once)
        self.beginning = new
        self._first_fixes = [fix for fix in new if fix not in at_once]
        self._first = None
        if self._first_fixes:
            together = [fix for fix in fixes if fix in lasting or fix in self._first_fixes]
            self._first = PythonHooks(self, together)
        self.hub.update.method.begin(self.hub, self.setup.contact)

    def _set_initial(self, fix: Any) -> None:
        """Let a fix set the initial state of a run."""

        def act(_: Setup) -> None:
            for view in views_of(self, fix):
                fix.hooks()["initial_integrate"](view)
                if view.moved:
                    self.control.clock[0].drift = np.inf

        if fix.point_by_point:
            act(self.setup)
        else:
            self.sort_if_due()  # tiles are read, too
            self.act(act, self.setup)
        self.changed()
