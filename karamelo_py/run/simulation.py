"""A lowered scene and the way it runs: in chunks of compiled steps, watched from Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.threads import Serial, Threaded, new_team
from karamelo_py.kernels.arrays import (
    DT,
    INITIAL_INTEGRATE,
    MASS,
    ON_VELOCITY,
    SUPPLY_HEAT,
    TIME,
    TIMESTEP,
    Hooks,
    NoHooks,
    Setup,
)
from karamelo_py.kernels.clock import STILL, choose_dt, step_size
from karamelo_py.kernels.export import impose_stress
from karamelo_py.kernels.heat import at_heat_nodes, at_heated_points, show_heat
from karamelo_py.kernels.hooks import POINT_STAGES, STAGES, CompiledHook
from karamelo_py.kernels.laws import elastic_law
from karamelo_py.kernels.moments import at_nodes, at_points
from karamelo_py.kernels.nodes import SumsToVelocity
from karamelo_py.kernels.p2g import Force
from karamelo_py.kernels.passes import sweep
from karamelo_py.kernels.rows import SUMS
from karamelo_py.kernels.step import DONE, SORT, Fused, Staged, advance, measure, run_steps
from karamelo_py.kernels.sweep import Visit, sweep_nodes
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.kernels.watch import COARSE, ROUND_OFF, begin_to_look, measure_heat
from karamelo_py.output.fields import PIECE
from karamelo_py.points.laws import can, law_kind, with_stress
from karamelo_py.points.laws.plastic_rate import without_rate
from karamelo_py.run.by_id import ById
from karamelo_py.run.hooks import lower_hooks
from karamelo_py.run.lowering import (
    State,
    chosen,
    lower,
    thread_count,
    warms_by_friction,
)
from karamelo_py.run.motion import Motion, motions
from karamelo_py.run.stable import moves_already, ruling_limit, share_of_heat, step_of_waves
from karamelo_py.run.state import changing, go_back
from karamelo_py.run.tiles import Tiles, in_tiles
from karamelo_py.run.trial import try_parts
from karamelo_py.run.watch import unknown_heat, unknown_work
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import NodesView, PieceView, PointsView
from karamelo_py.script.errors import ScriptError


def scene_key(hub: Hub) -> tuple:
    """What the arrays of a simulation depend on: while it stays the same, so do they."""
    update = hub.update
    return (
        hub.domain,
        hub.domain.h if hub.domain else None,
        tuple(hub.solids.values()),
        update.method,
        type(update.scheme),
        update.scheme,
        update.transfer,
        type(update.transfer),
        update.thermal,
        update.anti_locking,
        update.boundary,
        fields.declared(hub.fixes.values(), "point_fields"),
        fields.declared(hub.fixes.values(), "node_fields"),
        hub.fields.rate_is_asked_for(),
        update.method is not None and warms_by_friction(hub),
        hub.settings.precision,
        hub.settings.threads,
    )


def _sets_initial_state(fix: Any) -> bool:
    """Whether all a fix does is a hook in Python before the first step."""
    hooks = fix.hooks()
    return set(hooks) == {"initial_integrate"} and not isinstance(
        hooks["initial_integrate"], CompiledHook
    )


class PythonHooks:
    """Hooks of a step when some fixes act from Python: theirs, and the compiled ones."""

    def __init__(self, simulation: Simulation, fixes: list):
        self.simulation = simulation
        self.compiled = lower_hooks(simulation.hub, fixes)
        self.by_stage: dict[int, list[tuple[Any, Callable]]] = {}
        for fix in fixes:
            for name, hook in fix.hooks().items():
                if not isinstance(hook, CompiledHook):
                    self.by_stage.setdefault(STAGES[name], []).append((fix, hook))

    def act(self, function: Callable, s: Setup, *arguments: Any) -> None:
        """Call what acts from Python on a setup."""
        self.simulation.act(lambda whole: function(self, whole, *arguments), s)


def _on_nodes(hooks: PythonHooks, s: Setup, stage: int, target: int) -> None:
    for fix, hook in hooks.by_stage[stage]:
        hook(NodesView(s, fix.group, stage, before_update=target == ON_VELOCITY))


def _on_heat_nodes(hooks: PythonHooks, s: Setup, stage: int, target: int) -> None:
    # A temperature is to a capacity what a velocity is to a mass: the same view shows it.
    _on_nodes(hooks, s._replace(nodes=s.heat.nodes), stage, target)


def _on_points(hooks: PythonHooks, s: Setup, stage: int, then: int) -> None:
    for fix, hook in hooks.by_stage[stage]:
        view = PointsView(hooks.simulation, fix.group, bool(then))
        hook(view)
        if view.moved and stage == INITIAL_INTEGRATE:
            hooks.simulation.sort()
        elif view.moved:
            s.control.clock[0].drift = np.inf


@at_nodes.on(PythonHooks)
def _(hooks, stage, target, s):
    at_nodes(hooks.compiled, stage, target, s)
    if stage in hooks.by_stage:
        hooks.act(_on_nodes, s, stage, target)


@at_points.on(PythonHooks)
def _(hooks, stage, then, s):
    if stage == INITIAL_INTEGRATE and hooks.simulation.taken_up:
        hooks.simulation.taken_up = False
        return
    at_points(hooks.compiled, stage, then, s)
    if stage == INITIAL_INTEGRATE:
        hooks.simulation.clear_forces()
    if stage in hooks.by_stage:
        hooks.act(_on_points, s, stage, then)


@at_heat_nodes.on(PythonHooks)
def _(hooks, stage, target, s):
    at_heat_nodes(hooks.compiled, stage, target, s)
    if stage in hooks.by_stage:
        hooks.act(_on_heat_nodes, s, stage, target)


@at_heated_points.on(PythonHooks)
def _(hooks, s):
    at_heated_points(hooks.compiled, s)
    if SUPPLY_HEAT in hooks.by_stage:
        hooks.act(_on_points, s, SUPPLY_HEAT, 0)


class Simulation(ById):
    """The arrays of a scene, and how they go forward in time."""

    def __init__(self, hub: Hub, previous: Simulation | None = None):
        self.hub = hub
        self.key = scene_key(hub)
        state = previous.state() if previous else None
        self.setup, self.tiles = self._lowered(state)
        self.control = self.setup.control
        try_parts(hub, self.setup)
        self.count = sum(s.count for s in hub.solids.values())
        self.present = np.ones(self.count, np.bool_)  # by id, False for points that were deleted
        if state is not None:
            self.present[: state.count] = state.present
        self.threads = thread_count(hub, self.count)
        self._team = new_team(self.threads)
        self.mode = Threaded(self._team.ctypes.data) if self.threads > 1 else Serial()
        self.version = 0  # grows when fields change without a step
        self._measured = -1  # the version whose fastest point is known
        # Fixes of the first step that have acted: not again when the scene is lowered anew.
        self._begun: set[Any] = set(previous._begun) if previous else set()
        self.staged = False
        self.hooks: Hooks | NoHooks = NoHooks()
        self._first: PythonHooks | None = None
        self._first_fixes: list = []
        self.beginning: list = []  # fixes of the first step that act in this run
        self._watched = -1  # the version whose balance of energy is followed
        self.told_of_growth = False  # since it is followed
        self.mapped = False  # whether the nodes show a state of this simulation

    processes: ClassVar[dict[str, str]] = {}  # what a banner says of those that share the scene
    taken_up = False  # a step goes on whose first moment has been, with other arrays
    follows = False  # another process says what this one does in a run

    @contextmanager
    def leading(self) -> Iterator[None]:
        """While a run goes on: other processes, if there are any, follow this one."""
        yield

    def act(self, function: Callable[[Setup], None], s: Setup) -> None:
        """Call what acts from Python on the arrays of the whole scene."""
        function(s)

    @property
    def contact(self) -> Any:
        """How solids touch."""
        return self.setup.contact

    def _lowered(self, state: State | None) -> tuple[Setup, Tiles]:
        """The arrays of the whole scene, with the state of points that exist."""
        return lower(self.hub, state)

    def fits(self, hub: Hub) -> bool:
        """Whether the arrays are still those of the scene."""
        return self.key == scene_key(hub)

    # --- fields by id -------------------------------------------------------------------------

    @property
    def point_fields(self) -> tuple[type, ...]:
        """The declared fields of the points, of all blocks."""
        return tuple(
            dict.fromkeys(type(one) for block in self.setup.blocks for one in block.points.fields)
        )

    def state(self) -> State:
        """All that a new lowering takes over."""
        laws = {}
        for block in self.setup.blocks:
            state = block.points.state
            rows = np.zeros((len(state), self.count), state.dtype)
            rows[:, block.points.id] = state
            laws[without_rate(law_kind(block.laws))] = rows
        kept = [kind for kind in self.point_fields if fields.is_kept(kind)]
        return State(
            self.count,
            self.present,
            self.by_id(lambda points: points.x[self.now]),
            self.by_id(lambda points: points.v),
            laws,
            {kind: self.declared(kind).T for kind in kept},
            self.setup.contact,
            float(self.control.clock[0].last_dt),
            float(self.control.clock[0].path),
        )

    def set_stress(self, ids: np.ndarray, given: dict[str, np.ndarray]) -> None:
        """Set components of the Cauchy stress (by name, "11" ...) of the points `ids`."""
        s = self.setup
        names = s.kin.symmetric_names
        chosen = np.zeros(self.count, np.bool_)
        chosen[ids] = True
        stress = np.zeros((self.count, len(names)), s.nodes.sums.dtype)
        for k, name in enumerate(names):
            if name in given:
                stress[ids, k] = given[name]
        flags = np.array([name in given for name in names])
        for block in s.blocks:
            if can(elastic_law(block.laws), with_stress):
                rows = stress[block.points.id]
                part = chosen[block.points.id]
                like = s.nodes.sums[0, MASS]
                impose_stress(s.kin, like, block.points, block.laws, part, flags, rows)
        self.version += 1

    def remove(self, ids: np.ndarray) -> None:
        """Take points out of the run; the ids of the others stay."""
        self.present[ids] = False
        blocks = tuple(
            chosen(block, np.flatnonzero(self.present[block.points.id]))
            for block in self.setup.blocks
        )
        self.setup = self.setup._replace(blocks=blocks)
        self.control.clock[0].drift = np.inf
        self.version += 1
        # The rate of the last step stays: the same whether or not a run begins here.
        self._measured = self.version

    @property
    def measured(self) -> bool:
        """Whether the rate of the fastest point is that of the present state."""
        return self._measured == self.version

    @measured.setter
    def measured(self, known: bool) -> None:
        self.version += 1
        self._measured = self.version if known else -1

    @property
    def followed(self) -> bool:
        """Whether the clock tells how the balance of energy has gone up to the present state."""
        return self._watched == self.version

    @followed.setter
    def followed(self, known: bool) -> None:
        self._watched = self.version if known else -1

    @property
    def begun(self) -> list[str]:
        """IDs of the fixes of the first step that have acted."""
        return [ID for ID, fix in self.hub.fixes.items() if fix in self._begun]

    @begun.setter
    def begun(self, IDs: list[str]) -> None:
        self._begun = {self.hub.fixes[ID] for ID in IDs if ID in self.hub.fixes}

    @property
    def acting_from_python(self) -> list[str]:
        """Words for the fixes that act from Python in each step."""
        acting = (fix for pairs in self._python.by_stage.values() for fix, _ in pairs)
        return [f"fix {fix.style} '{fix.id}'" for fix in dict.fromkeys(acting)]

    @property
    def bounces(self) -> int:
        """How often points were reflected at the edge of the domain."""
        return int(self.total("bounces"))

    def clear_forces(self) -> None:
        """Points bear no force of fixes, until these say so anew."""
        for block in self.stepped.blocks:
            force = field(block.points.fields, Force)
            if force is not None:
                force[:] = 0

    # --- stepping -----------------------------------------------------------------------------

    def begin(self, end_time: float) -> None:
        """Start of a run: choose the first dt; the run ends at `end_time` at the latest."""
        import numba

        if self.threads > 1:
            numba.set_num_threads(self.threads)
        update = self.hub.update
        clock = self.control.clock[0]
        self._ask_for_steps(0)
        clock.end_time = end_time
        clock.over_limit = 0
        # Twice: initial values may be formulas of dt, and dt follows the fastest point.
        self._choose_dt()
        begun_before = len(self._begun)
        self._prepare_hooks()
        update.method.begin(self.hub, self.contact)
        if self.step == 0 and moves_already(self):
            clock.path = np.inf
            self._ask_for_steps(0)
        self._choose_dt()
        if not np.isfinite(self.dt):
            raise ScriptError(
                "nothing limits the time step: all that there is is rigid and at rest",
                hint="set_dt(...), or a velocity from fix initial_velocity_particles",
            )
        # A body at rest that has no waves has no first limit to compare with.
        if clock.first_limit == 0 and np.isfinite(self.limit) and not update.fixed_dt:
            clock.first_limit = self.limit
        self._watch_limit()
        self._watch_energy(begun_before)

    def halve_step(self, times: int) -> None:
        """From here on in this run the step is that of its start, halved so many `times`."""
        self._ask_for_steps(times)
        choose_dt(self.control)
        self._watch_limit()

    def _ask_for_steps(self, halvings: int) -> bool:
        """Tell the clock which steps are asked for; whether these are others than before."""
        clock = self.control.clock[0]
        names = "fixed_dt", "heat_factor", "dt_factor", "dt_factor_moving"
        courants = "courant", "courant_moving"
        before = [clock[name] for name in (*courants, *names)]
        now, moving = (step_of_waves(self.hub, still=s) for s in (clock.path <= STILL, False))
        asked = self.hub.update.fixed_dt or 0.0, share_of_heat(self.hub), now[1], moving[1]
        numbers = [now[0], moving[0], *(number / 2**halvings for number in asked)]
        for name, number in zip((*courants, *names), numbers, strict=True):
            clock[name] = number
        return numbers != before

    def _watch_limit(self) -> None:
        """A step that is above its limit from the start is what the user wants."""
        clock = self.control.clock[0]
        clock.watch_limit = int(not self.above_limit())
        clock.over_limit = 0

    def _watch_energy(self, begun_before: int) -> None:
        """Begin to watch the balance of energy, or go on where nothing was set since."""
        clock = self.control.clock[0]
        clock.watch_energy = int(not unknown_work(self.hub))
        set_anew = len(self._begun) > begun_before or bool(self._first_fixes)
        anew = not self.followed or set_anew
        self.followed = True
        if anew:
            self.told_of_growth = False
        if clock.watch_energy:
            # Velocities belong to half a step before, stresses to the share strained before.
            level = 0.5 + getattr(self.hub.update.scheme, "strained_before", 0.0)
            if anew:
                centres = (0.5 * one.mass * one.velocity @ one.velocity for one in self.motions())
                clock.of_drift = sum(centres)
            self.begin_to_look(level, anew)
        clock.watch_heat = int(self.hub.update.thermal and not unknown_heat(self.hub))
        if clock.watch_heat and anew:
            self.measure_heat()
            clock.coldest, clock.hottest = clock.T_low, clock.T_high

    def begin_to_look(self, level: float, anew: bool) -> None:
        """Measure the energies of all points, which the watch over them starts from."""
        s = self.stepped
        clock = s.control.clock[0]
        strain = COARSE * float(np.finfo(s.nodes.sums.dtype).eps)
        clock.energy_floor = max(ROUND_OFF, strain**2) * self.total("mass") * float(clock.rate) ** 2
        clock.born_with = self.total("born with")
        # Energies are summed by tile.
        if any(in_tiles(block.tiling) != block.points.mass.size for block in s.blocks):
            self.sort()
            self.mapped = False
        begin_to_look(s, level, anew)

    def measure_heat(self) -> None:
        """Measure the lowest and highest temperatures of all points."""
        s = self.stepped
        measure_heat(s)
        agree_on_heat(s.control.ranks, s.control)

    def go_on(self, end_time: float, halvings: int) -> None:
        """In place of `begin`: go on with a run whose state was put into the arrays.

        Steps, and the end of the run, may be others than in the run that wrote the state.
        """
        import numba

        if self.threads > 1:
            numba.set_num_threads(self.threads)
        update, clock = self.hub.update, self.control.clock[0]
        self._prepare_hooks()
        update.method.begin(self.hub, self.contact)
        other_end, clock.end_time = clock.end_time != end_time, end_time
        over_limit = clock.over_limit
        if self._ask_for_steps(halvings):
            choose_dt(self.control)
            self._watch_limit()
        elif other_end:
            choose_dt(self.control)
            clock.over_limit = over_limit

    def _choose_dt(self) -> None:
        if self._measured != self.version:
            # Otherwise the last step has measured, and a run in pieces takes the steps of a whole.
            self.measure()
            self._measured = self.version
        choose_dt(self.control)

    def measure(self) -> None:
        """Measure the rate of the fastest point."""
        measure(self.stepped)
        clock = self.control.clock[0]
        clock.rate = self.most(np.array([clock.rate]))[0]

    def fastest(self) -> float:
        """The largest component of the velocities of all points."""
        velocities = (block.points.v for block in self.stepped.blocks)
        # No copy of them: there may be millions.
        own = max((max(v.max(initial=0), -v.min(initial=0)) for v in velocities), default=0.0)
        return float(self.most(np.array([own], float))[0])

    def motions(self) -> list[Motion]:
        """How the solids lie and move."""
        return motions(self)

    def sort(self) -> None:
        """Sort the points by tile."""
        self.tiles.sort(self.stepped)

    def sort_if_due(self) -> None:
        """Sort the points when one may have left its tile's surroundings, or none is sorted yet."""
        clock = self.control.clock[0]
        if clock.drift > clock.drift_limit:
            self.sort()

    @property
    def limit(self) -> float:
        """The stable step of the present state."""
        return float(self.control.clock[0].limit)

    @property
    def ruling_limit(self) -> str:
        """The name of what limits the step now."""
        return ruling_limit(self)

    @property
    def limit_moving(self) -> float:
        """The stable step of points that go from cell to cell: steps of a script are its shares."""
        clock = self.control.clock[0]
        waves = clock.courant_moving * clock.spacing / clock.rate if clock.rate > 0 else np.inf
        return float(min(waves, clock.heat_limit))

    def above_limit(self) -> bool:
        """Whether the step is above the stable limit."""
        return self.control.values[DT] > self.limit * (1 + 1e-12)

    @property
    def dt(self) -> float:
        """The next step."""
        return float(self.control.values[DT])

    @property
    def time(self) -> float:
        """Present time."""
        return float(self.control.values[TIME])

    @property
    def step(self) -> int:
        """Number of steps taken in the whole script."""
        return int(self.control.values[TIMESTEP])

    def advance(self, count: int) -> int:
        """Take up to `count` steps (to the end time at most); DONE, or why it stopped.

        Points that are due to be sorted are sorted before the next step, so that the nodes keep
        showing the last one.
        """
        target = self.step + count
        control = self.control
        while True:
            self.sort_if_due()
            status = self._advance(target - self.step)
            self.mapped = True
            ended = self.step >= target or control.values[TIME] >= control.clock[0].end_time
            if status != SORT:
                return status
            if ended:
                return DONE

    def waits(self) -> np.ndarray:
        """Seconds that each process has waited for others in steps so far."""
        return np.zeros(1)

    def compile(self) -> None:
        """Have the loop over the steps compiled now: nobody waits for it in the midst of a log."""
        import numba

        if numba.config.DISABLE_JIT or self._python.by_stage:
            return
        visits = Staged() if self.staged else Fused()
        advance.compile(self.hub.update.scheme, visits, self.mode, self.stepped, self.hooks, 1)

    def _advance(self, count: int) -> int:
        scheme = self.hub.update.scheme
        if self._first is not None:
            status = run_steps(scheme, Staged(), self.mode, self.stepped, self._first, 1)
            if status in (DONE, SORT):
                self._begun |= set(self._first_fixes)
                self._first = None
                self.clear_forces()  # the steps to come may have no hook that does it
                return SORT  # there is more to do, unless that was all
            return status
        if self._python.by_stage:
            return run_steps(scheme, Staged(), self.mode, self.stepped, self._python, count)
        visits = Staged() if self.staged else Fused()
        return advance(scheme, visits, self.mode, self.stepped, self.hooks, count)

    def _prepare_hooks(self) -> None:
        """Sort the fixes by how they act: once before the first step, in it, in every step."""
        fixes = sorted(self.hub.fixes.values(), key=lambda fix: fix.acts_last)
        lasting = [fix for fix in fixes if not fix.first_step_only]
        new = [fix for fix in fixes if fix.first_step_only and fix not in self._begun]
        self._python = PythonHooks(self, lasting)
        self.hooks = self._python.compiled
        self.staged = bool(self._python.by_stage) or any(
            name in POINT_STAGES for fix in lasting for name in fix.hooks()
        )
        at_once = [fix for fix in new if _sets_initial_state(fix)]
        for fix in at_once:
            # Nothing happens in a step before this hook: the state shows it from the start.
            self.set_initial(fix.id)
        self._begun |= set(at_once)
        self.beginning = new
        self._first_fixes = [fix for fix in new if fix not in at_once]
        self._first = None
        if self._first_fixes:
            together = [fix for fix in fixes if fix in lasting or fix in self._first_fixes]
            self._first = PythonHooks(self, together)

    def set_initial(self, ID: str) -> None:
        """Let the fix `ID` set the state that a run begins with."""
        fix = self.hub.fixes[ID]
        for view in self._views(fix):
            fix.hooks()["initial_integrate"](view)
            if view.moved:
                self.control.clock[0].drift = np.inf
        self.version += 1

    def _views(self, fix: Any) -> Iterator[PointsView]:
        """The points of a fix, in pieces where it looks at each on its own."""
        if not fix.point_by_point:
            yield PointsView(self, fix.group, then=False)
            return
        chosen = None if fix.group.all else np.zeros(self.count, np.bool_)
        if chosen is not None:
            chosen[fix.group.ids] = True
        for block in self.stepped.blocks:
            ids = block.points.id
            for first in range(0, len(ids), PIECE):
                rows = np.arange(first, min(first + PIECE, len(ids)))
                if chosen is not None:
                    rows = rows[chosen[ids[rows]]]
                if len(rows):
                    yield PieceView(self, block, rows)

    def show_on_nodes(self) -> None:
        """See that the nodes show the present state when no step has been taken yet."""
        if not self.mapped:
            s = self.setup
            self.sort_if_due()
            dt = step_size(s)
            visit = Visit((), SUMS.quantities, SUMS.weights)
            sweep(s, self.mode, visit, dt, False, True, False)
            sweep_nodes(self.mode, SumsToVelocity(), s.kin, s.nodes, s.spans, dt)
            show_heat(s.heat, s, self.mode)
            self.mapped = True

    # --- state that can be returned to --------------------------------------------------------

    def snapshot(self, before: Mapping[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
        """Copies of every array that a step changes, and of the published values.

        The copies of the snapshot `before`, which is lost, are used again where they fit.
        """
        found = {}
        for name, array in (*changing(self), ("values", self.control.values)):
            copy = (before or {}).get(name)
            if copy is None or copy.shape != array.shape or copy.dtype != array.dtype:
                copy = np.empty_like(array)
            copy[...] = array
            found[name] = copy
        return found

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a snapshot."""
        go_back(self, snapshot)
        self.version += 1

    def wrong_points(self) -> Iterator[tuple[Any, int]]:
        """Block and index of the points that the last sweep found wrong, one a tile at most."""
        for block in self.setup.blocks:
            tiling = block.tiling
            for t in range(max(int(tiling.count[0]), 1)):
                if tiling.report[t, 2] > 0:
                    yield block, int(tiling.report[t, 2]) - 1
