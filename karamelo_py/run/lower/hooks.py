"""Hooks of fixes, compiled and in Python."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import INTERPRETED, address_of, address_of_python
from karamelo_py.compiler.programs import BLOCK, EVALUATE, ROWS, STACK
from karamelo_py.compiler.threads import Serial
from karamelo_py.kernels import arrays, called
from karamelo_py.kernels.arrays import INITIAL_INTEGRATE, ON_VELOCITY, SUPPLY_HEAT, Setup, Tag
from karamelo_py.kernels.heat import at_heat_nodes, at_heated_points
from karamelo_py.kernels.hook_loop import add_work, at_nodes, at_points
from karamelo_py.kernels.hooks import STAGES, CompiledHook
from karamelo_py.kernels.totals import LIMBS
from karamelo_py.kernels.walls import FRICTION
from karamelo_py.language.faults import as_script_error
from karamelo_py.run.boxes import unique
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, moved
from karamelo_py.scene.views import NodesView, PointsView
from karamelo_py.script.errors import ScriptError, blaming
from karamelo_py.script.expressions import FIRST, POINT_SEEDS, Expression
from karamelo_py.script.formula import evaluate_in_table

NO_PROGRAM = (-1, -1, -1, -1)


def lower_hooks(
    hub: Hub, fixes: list, mode: Tag = None, threads: int = 1
) -> arrays.Hooks | arrays.NoHooks:
    dimension = hub.domain.dimension
    builder = _Builder(hub, sum(s.count for s in hub.solids.values()))
    for fix, name, hook in compiled_hooks(fixes):
        builder.add(fix, name, hook)
    if not builder.rows:
        return arrays.NoHooks()
    solids = hub.solids.values() if builder.uses_first else ()
    copies, values = threads if threads > 1 else 0, len(hub.values.array)
    code, constants = builder.formulas.tables()
    return arrays.Hooks(
        evaluate=address_of(evaluate_in_table, EVALUATE),
        table=np.array(builder.rows, arrays.HOOK).view(np.recarray),
        programs=builder.table_of_programs(),
        members=np.concatenate([np.empty(0, np.int64), *builder.members]),
        code=code,
        constants=constants,
        x0=np.concatenate([np.empty((0, dimension)), *(s.x0 for s in solids)]),
        chosen=np.zeros(BLOCK, np.int64),
        scratch=np.zeros((STACK + ROWS + 1, BLOCK)),
        holders=np.zeros((builder.shared_nodes(), dimension), arrays.HELD).view(np.recarray),
        loads=np.zeros((builder.loaded_nodes, dimension)),
        rigid_fields=builder.rigid_fields,
        torques=hub.values.torques,
        mode=mode or Serial(),
        # Padded, so that threads do not write to the same cache line.
        apart=arrays.Apart(
            chosen=np.zeros((copies, BLOCK), np.int64),
            scratch=np.zeros((copies, STACK + ROWS + 1, BLOCK)),
            values=np.zeros((copies, values + 16)),
            totals=np.zeros((copies, values, LIMBS), np.int64),
            step=np.zeros((copies, 1), arrays.STEP).view(np.recarray),
            heat=np.zeros((copies, 1), arrays.HEAT).view(np.recarray),
        ),
        whole=tuple(builder.whole),
    )


def compiled_hooks(fixes: list) -> list[tuple[Fix, str, CompiledHook]]:
    return [
        (fix, name, hook)
        for fix in fixes
        for name, hook in fix.hooks().items()
        if isinstance(hook, CompiledHook)
    ]


def is_wet(hub: Hub) -> bool:
    return any(solid.material.fluid is not None for solid in hub.solids.values())


class Programs:
    """Concatenated code and constants of all formulas."""

    def __init__(self, hub: Hub):
        self.hub = hub
        self.code: list[np.ndarray] = [np.empty((0, 2), np.int64)]
        self.constants: list[np.ndarray] = [np.empty(0)]

    def add(self, formula: Expression | None) -> tuple:
        if formula is None:
            return NO_PROGRAM
        if formula.is_constant:
            return 0, 0, *_put(self.constants, np.array([formula.constant]))
        program = formula.program(self.hub.values)
        return *_put(self.code, program.code), *_put(self.constants, program.constants)

    def tables(self) -> tuple[np.ndarray, np.ndarray]:
        return np.concatenate(self.code), np.concatenate(self.constants)


class _Builder:
    def __init__(self, hub: Hub, points: int):
        self.hub = hub
        self.points = points
        self.uses_first = False  # whether hooks use initial positions
        self.rows: list[tuple] = []
        self.programs: list[list[tuple]] = []
        self.members: list[np.ndarray] = []
        self.formulas = Programs(hub)
        self.holding: list[Fix] = []
        self.loaded_nodes = 0  # number of nodes, or 0 if hooks add no forces to nodes
        method = hub.update.method
        self.rigid_fields = method.rigid_fields(hub) if method is not None else np.zeros(0, bool)
        self.rigid = any(solid.rigid for solid in hub.solids.values())
        self.whole: list[Tag] = []  # hooks that treat all directions of a point at once
        self.wet = is_wet(hub)

    def add(self, fix: Fix, moment: str, hook: CompiledHook) -> None:
        begin, end = self._members(fix, hook)
        slot = -1
        if hook.publishes and fix.published:
            first = "x" if "x" in fix.published else fix.published[0]
            slot = self.hub.values.slot(f"{fix.id}_{first}")
        if hook.tag is not None:
            address = arrays.WHOLE
            values = (1,) * len(fix.formulas + fix.values_of_time)
            self.whole.append(hook.tag(len(self.rows), values))
        else:
            with as_script_error(f"fix {fix.style}", moment, hook.function, fix.mark):
                address = address_of(hook.function, hook.signature)
        formulas = [f for f in (*fix.formulas, fix.wall_friction) if f is not None]
        holds = hook.holds and (slot >= 0 or not hook.on_nodes)
        turns = bool(self.hub.values.torques.any())
        uses_place = turns or any(f.names & set(POINT_SEEDS) for f in formulas)
        count = len(fix.published) if slot >= 0 and hook.tag is not None else 0
        wet = fix.accelerates and self.wet
        uses = [*map(int, (hook.uses_before, hook.uses_share, holds, uses_place, count, wet))]
        late = STAGES[moment] == arrays.POST_UPDATE_GRID_STATE
        apart = self.hub.update.method.fields_per_solid or moved(self.hub)
        after_contact = late and fix.brakes and apart
        stage = arrays.POST_CONTACT if after_contact else STAGES[moment]
        self.rows.append((address, stage, begin, end, slot, *uses))
        whole = hook.tag is not None  # functions of all directions at once
        formulas_of_hook = (Expression(0.0) if f is None and whole else f for f in fix.formulas)
        programs = list(map(self.formulas.add, formulas_of_hook))
        programs += [NO_PROGRAM] * (FRICTION - len(programs))
        programs += map(self.formulas.add, (fix.wall_friction, *fix.values_of_time))
        self.programs.append(programs)
        self.uses_first |= not hook.on_nodes and any(f.names & FIRST for f in formulas)
        if hook.holds and hook.on_nodes:
            self.holding.append(fix)
        early = STAGES[moment] == arrays.POST_PARTICLES_TO_GRID
        rubs = fix.wall_friction is not None
        if early or (late and (not holds or rubs or self.rigid)):
            self.loaded_nodes = self.hub.fields.node_count

    def table_of_programs(self) -> np.ndarray:
        width = max(map(len, self.programs))
        rows = [[*row, *[NO_PROGRAM] * (width - len(row))] for row in self.programs]
        return np.array(rows, arrays.PROGRAM).view(np.recarray)

    def shared_nodes(self) -> int:
        fixes = self.holding
        if len(fixes) < 2:
            return 0
        if not any(fix.group.all for fix in fixes):
            nodes = np.concatenate([fix.nodes for fix in fixes])
            if len(unique(nodes)) == len(nodes):
                return 0
        return self.hub.fields.node_count

    def _members(self, fix: Fix, hook: CompiledHook) -> tuple[int, int]:
        if fix.group.all:
            return -1, -1
        if hook.on_nodes:
            return _put(self.members, unique(fix.nodes))
        members = fix.group.bits(self.points).view("<i8").astype(np.int64, copy=False)
        return _put(self.members, members)


def _put(pieces: list[np.ndarray], piece: np.ndarray) -> tuple[int, int]:
    begin = sum(map(len, pieces))
    pieces.append(piece)
    return begin, begin + len(piece)


class ActingFixes:
    def __init__(self, simulation: SceneState, fixes: list[Fix]):
        self.simulation, self.fixes = simulation, fixes
        self.functions = [hook.function for _, _, hook in compiled_hooks(fixes)]  # by row
        self.compiled = lower_hooks(simulation.hub, fixes, simulation.mode, simulation.threads)
        self.in_python: dict[int, list[tuple[Fix, Callable]]] = {}  # hooks by stage
        for fix in fixes:
            for name, hook in fix.hooks().items():
                if not isinstance(hook, CompiledHook):
                    self.in_python.setdefault(STAGES[name], []).append((fix, hook))

    @property
    def tag(self) -> "ActingFixes | arrays.Hooks | arrays.NoHooks":
        return self if self.in_python else self.compiled

    def called(self) -> called.CalledHooks | None:
        acting = [fix for fix, _ in self.in_python.get(INITIAL_INTEGRATE, ())]
        elsewhere = len(self.in_python) > 1 or not all(fix.point_by_point for fix in acting)
        if INTERPRETED or not acting or elsewhere or self.simulation.comm.size > 1:
            return None

        def act(stage: int) -> int:
            _on_points(self, self.simulation.setup, stage, 0)
            return 1

        return called.CalledHooks(self.compiled, address_of_python(act, called.CALL))

    def act(self, function: Callable, s: Setup, stage: int, *arguments: object) -> None:
        if stage not in self.in_python:
            return
        if all(fix.point_by_point for fix, _ in self.in_python[stage]):
            function(self, s, stage, *arguments)
        else:
            self.simulation.domain.act(lambda whole: function(self, whole, stage, *arguments), s)


def _call(simulation: SceneState, fix: Fix, hook: Callable, view: PointsView | NodesView) -> None:
    """Call a Python hook.

    If each process calls it for its own points, check that all processes agree.

    Different collective calls would deadlock; published values that differ are partial sums.
    """
    with blaming(fix.mark):
        hook(view)
        if fix.point_by_point:
            _agree(simulation, fix)


def _agree(simulation: SceneState, fix: Fix) -> None:
    values = simulation.hub.values
    names = (f"{fix.id}_{name}" if name else fix.id for name in fix.published)
    published = {name: values.get(name) for name in names if name in values}
    first, *others = simulation.comm.everyone("its end", published)
    for other in others:
        name = next((name for name in first if repr(first[name]) != repr(other[name])), None)
        if name is not None:
            raise ScriptError(
                f"fix {fix.style}: {name} is {first[name]:.6g} on one process and "
                f"{other[name]:.6g} on another",
                hint=f"report this to the author of {fix.style}: with point_by_point each "
                "process has some of the points; points.total(terms) and nodes.total(terms) "
                "sum over all",
            )


def _on_nodes(hooks: ActingFixes, s: Setup, stage: int, target: int) -> None:
    for fix, hook in hooks.in_python[stage]:
        view = NodesView(hooks.simulation, s, fix.group, stage, before_update=target == ON_VELOCITY)
        _call(hooks.simulation, fix, hook, view)


def _on_heat_nodes(hooks: ActingFixes, s: Setup, stage: int, target: int) -> None:
    # In this view, temperature and capacity are stored as velocity and mass.
    nodes = s.heat.nodes._replace(fields=s.nodes.fields)
    _on_nodes(hooks, s._replace(nodes=nodes), stage, target)


def _on_points(hooks: ActingFixes, s: Setup, stage: int, then: int) -> None:
    for fix, hook in hooks.in_python[stage]:
        view = view_of(hooks.simulation, fix, then=bool(then))
        _call(hooks.simulation, fix, hook, view)
        if view.moved and stage == INITIAL_INTEGRATE:
            hooks.simulation.sort()
        elif view.moved:
            hooks.simulation.tiles.unsort(s.control)


@at_nodes.on(ActingFixes)
def _at_nodes_acting_fixes(hooks, stage, target, s):
    at_nodes(hooks.compiled, stage, target, s)
    hooks.act(_on_nodes, s, stage, target)


@add_work.on(ActingFixes)
def _add_work_acting_fixes(hooks, s, again):
    add_work(hooks.compiled, s, again)


@at_points.on(ActingFixes)
def _at_points_acting_fixes(hooks, stage, then, s):
    if stage == INITIAL_INTEGRATE and hooks.simulation.moved_in_step:
        hooks.simulation.moved_in_step = False
        return
    if stage == INITIAL_INTEGRATE:
        hooks.simulation.clear_forces()
    at_points(hooks.compiled, stage, then, s)
    hooks.act(_on_points, s, stage, then)


@at_heat_nodes.on(ActingFixes)
def _at_heat_nodes_acting_fixes(hooks, stage, target, s):
    at_heat_nodes(hooks.compiled, stage, target, s)
    hooks.act(_on_heat_nodes, s, stage, target)


@at_heated_points.on(ActingFixes)
def _at_heated_points_acting_fixes(hooks, s):
    at_heated_points(hooks.compiled, s)
    hooks.act(_on_points, s, SUPPLY_HEAT, 0)


def view_of(simulation: SceneState, fix: Fix, *, then: bool) -> PointsView:
    if fix.point_by_point:
        pieces = list(simulation.points.rows_of(fix.group))
        return PointsView(simulation, then=then, pieces=pieces)
    return PointsView(simulation, simulation.points.members(fix.group), then=then)


def views_of(simulation: SceneState, fix: Fix) -> Iterator[PointsView]:
    if not fix.point_by_point:
        yield view_of(simulation, fix, then=False)
        return
    for piece in simulation.points.rows_of(fix.group):
        yield PointsView(simulation, pieces=[piece], in_steps=False)


def _sets_initial_state(fix: Fix) -> bool:
    hook = fix.hooks().get("initial_integrate")
    return len(fix.hooks()) == 1 and hook is not None and not isinstance(hook, CompiledHook)


class FixesOfRun(NamedTuple):
    once: list[Fix]  # fixes that set the initial state, once
    new: list[Fix]
    first: ActingFixes | None  # fixes of the first step, if some act only in it
    lasting: ActingFixes

    @property
    def acting(self) -> list[Fix]:
        return (self.first or self.lasting).fixes

    @classmethod
    def of(cls, simulation: SceneState) -> "FixesOfRun":
        across = simulation.hub.domain.across
        fixes = [*simulation.hub.fixes.values(), *([] if across is None else [across])]
        fixes.sort(key=lambda fix: fix.order)
        new = [fix for fix in fixes if fix.first_step_only and fix not in simulation.begun]
        once = [fix for fix in new if _sets_initial_state(fix)]
        lasting = ActingFixes(simulation, [fix for fix in fixes if not fix.first_step_only])
        together = [f for f in fixes if not f.first_step_only or (f in new and f not in once)]
        more = len(together) > len(lasting.fixes)
        return cls(once, new, ActingFixes(simulation, together) if more else None, lasting)
