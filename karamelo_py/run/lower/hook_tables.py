"""Compiled hooks of the fixes of a scene, as the tables that kernels read."""

from typing import Any

import numpy as np

from karamelo_py.compiler.formula import BLOCK, EVALUATE, ROWS, STACK, evaluate_in_table
from karamelo_py.compiler.loops import address_of
from karamelo_py.compiler.threads import Serial
from karamelo_py.kernels import arrays
from karamelo_py.kernels.hooks import STAGES, CompiledHook
from karamelo_py.kernels.totals import LIMBS
from karamelo_py.kernels.walls import FRICTION
from karamelo_py.language.faults import as_script_error
from karamelo_py.run.tiles.unique import unique
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import FIRST, POINT_SEEDS

NO_PROGRAM = (-1, -1, -1, -1)


def lower_hooks(
    hub: Hub, fixes: list, mode: Any = None, threads: int = 1
) -> arrays.Hooks | arrays.NoHooks:
    """Make the tables of the compiled hooks of fixes, in their order; by one thread, or several."""
    dimension = hub.domain.dimension
    count = sum(s.count for s in hub.solids.values())
    builder = _Builder(hub, count)
    for fix in fixes:
        for name, hook in fix.hooks().items():
            if isinstance(hook, CompiledHook):
                builder.add(fix, name, hook)
    if not builder.rows:
        return arrays.NoHooks()
    solids = hub.solids.values() if builder.uses_first else ()
    return arrays.Hooks(
        evaluate=address_of(evaluate_in_table, EVALUATE),
        table=np.array(builder.rows, arrays.HOOK).view(np.recarray),
        programs=np.array(builder.programs, arrays.PROGRAM).view(np.recarray),
        members=np.concatenate([np.empty(0, np.int64), *builder.members]),
        code=np.concatenate([np.empty((0, 2), np.int64), *builder.code]),
        constants=np.concatenate([np.empty(0), *builder.constants]),
        x0=np.concatenate([np.empty((0, dimension)), *(s.x0 for s in solids)]),
        chosen=np.zeros(BLOCK, np.int64),
        scratch=np.zeros((STACK + ROWS, BLOCK)),
        held=np.zeros((builder.shared_nodes(), dimension), arrays.HELD).view(np.recarray),
        loads=np.zeros((builder.loaded_nodes, dimension)),
        mode=mode or Serial(),
        apart=_apart(threads if threads > 1 else 0, len(hub.values.array)),
    )


def _apart(threads: int, values: int) -> arrays.Apart:
    """Make room for what threads have of their own, with space between the values of two."""
    return arrays.Apart(
        chosen=np.zeros((threads, BLOCK), np.int64),
        scratch=np.zeros((threads, STACK + ROWS, BLOCK)),
        values=np.zeros((threads, values + 16)),
        totals=np.zeros((threads, values, LIMBS), np.int64),
        clock=np.zeros((threads, 1), arrays.CLOCK).view(np.recarray),
    )


class _Builder:
    """Collects rows, members and programs."""

    def __init__(self, hub: Hub, points: int):
        self.hub = hub
        self.points = points
        self.uses_first = False  # places of points before the first step
        self.rows: list[tuple] = []
        self.programs: list[list[tuple]] = []
        self.members: list[np.ndarray] = []
        self.code: list[np.ndarray] = []
        self.constants: list[np.ndarray] = []
        self.holding: list[Any] = []
        self.loaded_nodes = 0  # the number of nodes, where hooks bring forces

    def add(self, fix: Any, moment: str, hook: CompiledHook) -> None:
        """Add one compiled hook of a fix, which acts at `moment` of a step."""
        begin, end = self._members(fix, hook)
        slot = -1
        if hook.publishes and fix.published:
            # Components lie one after another, from x on; a total without direction stands alone.
            first = "x" if "x" in fix.published else fix.published[0]
            slot = self.hub.values.slot(f"{fix.id}_{first}")
        with as_script_error(f"fix {fix.style}", moment, hook.function, fix.place):
            address = address_of(hook.function, hook.signature)
        uses = (
            int(hook.uses_before),
            int(hook.uses_share),
            int(hook.holds and (slot >= 0 or not hook.on_nodes)),
        )
        formulas = [f for f in (*fix.formulas, fix.wall_friction) if f is not None]
        uses_place = any(f.names & set(POINT_SEEDS) for f in formulas)
        row = (address, STAGES[moment], begin, end, slot, *uses, int(uses_place))
        self.rows.append(row)
        programs = [self._program(formula) for formula in fix.formulas]
        programs += [NO_PROGRAM] * (FRICTION - len(programs))
        self.programs.append([*programs, self._program(fix.wall_friction)])
        self.uses_first |= not hook.on_nodes and any(f.names & FIRST for f in formulas)
        if hook.holds and hook.on_nodes:
            self.holding.append(fix)
        if STAGES[moment] == arrays.POST_PARTICLES_TO_GRID:
            self.loaded_nodes = fix.group.total()

    def shared_nodes(self) -> int:
        """Count the nodes, where hooks hold some of them in common; else 0."""
        fixes = self.holding
        if len(fixes) < 2:
            return 0
        if not any(fix.group.all for fix in fixes):
            nodes = np.concatenate([fix.nodes for fix in fixes])
            if len(unique(nodes)) == len(nodes):
                return 0
        return fixes[0].group.total()

    def _members(self, fix: Any, hook: CompiledHook) -> tuple[int, int]:
        if fix.group.all:
            return -1, -1
        if hook.on_nodes:
            members = unique(fix.nodes)
        else:
            members = fix.group.bits(self.points).view("<i8").astype(np.int64, copy=False)
        begin = sum(len(m) for m in self.members)
        self.members.append(members)
        return begin, begin + len(members)

    def _program(self, formula: Any) -> tuple:
        if formula is None:
            return NO_PROGRAM
        if formula.is_constant:  # without code: the number
            first = sum(len(p) for p in self.constants)
            self.constants.append(np.array([formula.constant]))
            return 0, 0, first, first + 1
        program = formula.program(self.hub.values)
        ranges = []
        for pieces, piece in ((self.code, program.code), (self.constants, program.constants)):
            begin = sum(len(p) for p in pieces)
            pieces.append(piece)
            ranges += [begin, begin + len(piece)]
        return tuple(ranges)
