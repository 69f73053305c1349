"""Time integration of a lowered scene by chunks of compiled steps, controlled from Python."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numba import config

from karamelo_py.kernels.arrays import (
    Hooks,
    NoHooks,
    Points,
    Setup,
    Tag,
    arrays_of,
    joined_points,
)
from karamelo_py.kernels.hooks import POINT_STAGES
from karamelo_py.kernels.step import DONE, SORT, Fused, Staged, StepKind, advance, run_steps
from karamelo_py.kernels.totals import WORK, add_to
from karamelo_py.run.energy import EnergyWatch
from karamelo_py.run.light_nodes import stable_courant
from karamelo_py.run.lower.bodies import check_bodies
from karamelo_py.run.lower.build import points_at_rest
from karamelo_py.run.lower.hooks import ActingFixes, FixesOfRun, views_of
from karamelo_py.run.lower.walls import mark_sides
from karamelo_py.run.mpi.whole import PointsMoved
from karamelo_py.run.scene_arrays import SceneArrays
from karamelo_py.run.stable_step import ruling_limit
from karamelo_py.run.step_size import StepSize
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.views import set_columns

TAKEN_ALONG = ("mass", "kinetic", "stored", "dissipated")  # quantities summed over deleted points


class Simulation(SceneArrays):
    """A scene, or the subdomain of one process, with its steps on the CPU.

    Subclasses take steps on a GPU (`run.on_card`) or by Newton's method
    (`run.implicit.load_steps`).
    """

    states_every = 100  # steps between stored states
    remedy = "a smaller time step (set_dt, dt_factor)"
    repeats_steps = True  # whether steps from a stored state are repeated; load steps take too long
    implicit = False
    failure = ""  # reason why a load step found no equilibrium
    notes_temperatures = True
    between: Callable[[str], bool] | None = None
    _called: Tag = None  # Python hooks of the last steps

    def __init__(self, hub: Hub, previous: Simulation | None = None):
        super().__init__(hub, previous)
        self.steps, self.energy_watch = StepSize(self), EnergyWatch(self)
        # Fixes of the first step must not act again after the scene is lowered again.
        self.begun: set[Fix] = set(previous.begun) if previous else set()
        self.visits: Staged | Fused = Fused()
        self.fixes = FixesOfRun([], [], None, ActingFixes(self, []))
        self.moved_in_step = False
        for solid in hub.solids.values():
            if solid.initial and (previous is None or solid.first_id >= previous.count):
                ids = np.arange(solid.first_id, solid.first_id + solid.count)
                set_columns(self, solid.initial, ids, solid.mark)

    @cached_property
    def light_nodes(self) -> float:
        return stable_courant(self.hub, self.setup.grids)

    @property
    def ruling_limit(self) -> str:
        return ruling_limit(self)

    @property
    def flags(self) -> tuple[bool, ...]:
        watch = self.energy_watch
        reported = watch.told_of_growth, watch.told_of_loss
        return self.steps.measured, self.mapped, watch.followed, *reported

    @flags.setter
    def flags(self, flags: tuple[bool, ...]) -> None:
        watch = self.energy_watch
        self.steps.measured, self.mapped, watch.followed, *reported = flags
        watch.told_of_growth, watch.told_of_loss = reported

    @property
    def moves(self) -> bool:
        return self.hub.update.scheme.traits.inertia

    def begin(self, end_time: float) -> None:
        self.steps.begin(end_time)
        begun_before = len(self.begun)
        self._make_ready()
        self.steps.choose_first()
        self.energy_watch.begin(set_anew=len(self.begun) > begun_before or self.begins)

    def go_on(self, end_time: float, halvings: int) -> None:
        self._make_ready()
        self.steps.go_on(end_time, halvings)

    def changed(self) -> None:
        super().changed()
        self.steps.measured = self.energy_watch.followed = False

    def remove(self, ids: np.ndarray) -> tuple[float, float]:
        """Delete points (ascending ids), without renumbering; return their mass and energy.

        The energy balance counts this energy as negative work.
        """
        group = ParticleGroup(self.hub)
        group.take([ids])
        mass, kinetic, *inner = (self.points.total(name, group) for name in TAKEN_ALONG)
        stored = sum(inner)
        if self.comm.leads:
            add_to(self.control.totals, WORK, -(kinetic + stored))
        self.energy_watch.without(stored)
        self.control.energy[0].lost_with_deleted += self.points.total("transfer loss", group)
        self.present[ids] = False
        self.keep_present()
        self.tiles.unsort(self.control)
        # Energy balance and rate belong to the last step, even if a run begins here.
        super().changed()
        self.steps.measured = True
        return mass, kinetic + stored

    def insert(self, ids: np.ndarray, prepare: Callable[[Points], None] | None = None) -> float:
        """Add absent points (ascending ids) in their initial state; return their energy.

        `prepare` may change velocities and positions of the points in a block. The energy balance
        counts the returned energy as work of loads.
        """
        if self.comm.leads:  # the next sort sends the points to their processes
            blocks = []
            made = points_at_rest(self.hub, self.setup, ids)
            for block, points in zip(self.setup.blocks, made, strict=True):
                if prepare is not None:
                    prepare(points)
                parts = [[array for _, array in arrays_of(of)] for of in (block.points, points)]
                blocks.append(block._replace(points=joined_points(block.points, parts)))
            self.setup = self.setup._replace(blocks=tuple(blocks))
        self.present[ids] = True
        self.tiles.unsort(self.control)
        super().changed()
        group = ParticleGroup(self.hub)
        group.take([ids])
        kinetic, *inner = (self.points.total(name, group) for name in TAKEN_ALONG[1:])
        if self.comm.leads:
            add_to(self.control.totals, WORK, kinetic + sum(inner))
        self.energy_watch.without(-sum(inner))
        return kinetic + sum(inner)

    @property
    def step_kind(self) -> StepKind:
        return StepKind(self.scheme, self.visits, self.mode)

    @property
    def scheme(self) -> Tag:
        return self.hub.scheme_of_steps

    def advance(self, count: int, between: Callable[[str], bool] | None = None) -> int:
        """Take up to `count` steps, not beyond the end time; return DONE or another status.

        Load steps call `between` with a progress message, and end if it returns True.
        """
        self.between = between
        self.control.motion[0].wrong = 0  # an earlier call may have set it
        with self.comm.joint():
            from_python = bool(self.fixes.lasting.in_python) or self.begins
            self.domain.begin(self.hooks, from_python=from_python)
            status = self._advance_to(self.step + count)
            self.domain.end()
        return status

    def _advance_to(self, target: int) -> int:
        while True:
            self.sort_if_due()  # not after the last step: output may read the present nodes
            try:
                status = self._advance(target - self.step)
            except PointsMoved:
                self.moved_in_step = True
                continue
            self.mapped = True
            if status != SORT:
                return status
            if self.step >= target or self.time >= self.control.step[0].end_time:
                return DONE

    def _advance(self, count: int) -> int:
        first = self.fixes.first
        if first is None:
            return self._take(self._acting, count)
        status = self._take(first, 1)
        if status not in (DONE, SORT):
            return status
        self.begun |= set(first.fixes) & set(self.fixes.new)
        self.fixes = self.fixes._replace(first=None)
        self.clear_forces()  # later steps may have no hook that sets forces
        return SORT

    def _take(self, hooks: Tag, count: int) -> int:
        if isinstance(hooks, ActingFixes):
            return run_steps(self.step_kind._replace(visits=Staged()), self.setup, hooks, count)
        return advance(self.step_kind, self.setup, hooks, count)

    @property
    def _acting(self) -> Tag:
        return self._called or self.fixes.lasting.tag

    @property
    def hooks(self) -> Hooks | NoHooks:
        return self.fixes.lasting.compiled

    @property
    def begins(self) -> bool:
        return self.fixes.first is not None

    def refuse(self) -> None:
        """Raise ScriptError if the back end does not support the scene; the CPU supports all."""

    def compile(self) -> None:
        hooks = self._acting
        if config.DISABLE_JIT or isinstance(hooks, ActingFixes):
            return
        self.comm.in_turn(lambda: advance.compile(self.step_kind, self.setup, hooks, 1))

    def _make_ready(self) -> None:
        self.fixes = FixesOfRun.of(self)
        lasting = self.fixes.lasting
        self._called = None if self.implicit else lasting.called()
        names = {name for fix in lasting.fixes for name in fix.hooks()}
        self.visits = Staged() if lasting.in_python or names & set(POINT_STAGES) else Fused()
        for fix in self.fixes.once:
            # initial_integrate is a step's first stage: the fix may act before the first output.
            self._set_initial(fix)
        self.begun |= set(self.fixes.once)
        rigid = any(solid.rigid for solid in self.hub.solids.values())
        if rigid and self.comm.size == 1 and self.hub.settings.engine == "processor":
            check_bodies(self.hub, self.setup.blocks, self.now)
        self.hub.update.method.begin(self.hub, self.setup.contact)
        if self.hub.update.method.corrected:
            mark_sides(self.hub, self.setup)

    def _set_initial(self, fix: Fix) -> None:
        def act(_: Setup) -> None:
            for view in views_of(self, fix):
                fix.hooks()["initial_integrate"](view)
                if view.moved:
                    self.tiles.unsort(self.control)

        if fix.point_by_point:
            act(self.setup)
        else:
            self.sort_if_due()  # the fixes may use tiles
            self.domain.act(act, self.setup)
        self.changed()
