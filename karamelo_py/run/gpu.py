"""Steps of a scene on a GPU: device memory and kernel launches."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from karamelo_py.compiler.fields import field
from karamelo_py.compiler.gpu import Card, Images, KernelLaunch, numbers_of
from karamelo_py.compiler.programs import EVALUATE
from karamelo_py.kernels import arrays, gpu, heat, table
from karamelo_py.kernels import gpu_fixes as fixes
from karamelo_py.kernels.clock import kick, step_size, take_reports
from karamelo_py.kernels.equations.node_updates import WorkAtNodes
from karamelo_py.kernels.hook_loop import ACT, LOADS, LOADS_AGAIN, RUB, moving_points
from karamelo_py.kernels.hooks import HEAT_FUNCTION, NODE_FUNCTION, POINT_FUNCTION
from karamelo_py.kernels.step import DONE, first_rows, rows_of
from karamelo_py.kernels.table import take
from karamelo_py.kernels.totals import CONTACT_LOSS, TRANSFER_LOSS, WORK
from karamelo_py.kernels.walls import FRICTION
from karamelo_py.kernels.watch import LOOK, more_of
from karamelo_py.points.basis import support
from karamelo_py.points.laws import is_rigid
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, of_nodes
from karamelo_py.script.formula import GLOBAL, UNIFORM, evaluate_in_table

POLL = 64  # steps between reads of `outcome`
FAR = 1.0  # distance in cells that points move before they are reordered
PARTS = "begin", "step", "last step", "before", "behind", "order"  # names of launches
Hooks = tuple[arrays.Hooks | arrays.NoHooks, Sequence[Callable]]
NO_HOOKS: Hooks = arrays.NoHooks(), ()


def arrays_in(thing: Any) -> Iterator[np.ndarray]:
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, tuple):
        for item in thing:
            yield from arrays_in(item)


def there(s: arrays.Setup) -> arrays.Setup:
    """Return the setup without tiles and buffers, which GPUs do not use."""
    blocks = tuple(block._replace(tiling=()) for block in s.blocks)
    buffers, conduction = s.buffers._replace(nodes=s.nodes), s.heat
    if isinstance(conduction, heat.Conducting):
        conduction = conduction._replace(buffers=buffers._replace(nodes=conduction.nodes))
    return s._replace(blocks=blocks, buffers=buffers, heat=conduction)


def as_rows(image: np.ndarray) -> np.ndarray:
    """Return a view of point arrays (..., n) as integers (rows, n) of the same size."""
    rows = int(np.prod(image.shape[:-1], dtype=int))
    step = image.strides[-2] if image.ndim > 1 else 0
    whole = {4: np.int32, 8: np.int64}[image.itemsize]
    return as_strided(image.view(whole), (rows, image.shape[-1]), (step, image.itemsize))


def _no_formula(*_): ...


def _no_hook(m, v, star, force, *_):  # the loops refer to it, but never call it
    return v, star, force, force


class StepsOnCard:
    """Steps of a lowered scene on a GPU.

    `program` holds the classes of the scheme and of its passes; `hooks`, the compiled hooks and
    their functions, in the order of the table of hooks.
    """

    def __init__(
        self, card: Any, s: arrays.Setup, program: tuple[Any, type],
        hooks: Hooks = NO_HOOKS,
    ):  # fmt: skip
        self.card, self.s, (self.hooks, self.functions) = card, (s := there(s)), hooks
        self.table = () if isinstance(self.hooks, arrays.NoHooks) else self.hooks.table
        self.images = Images(card)
        self.outcome = np.zeros(5)
        self.nodes = len(s.nodes.sums)
        self.use = np.zeros(self.nodes, np.int8)
        self.copies = np.zeros((card.copies, *s.control.totals.shape), np.int64)
        self.heavy = np.zeros(max(len(self.functions), 1), np.int64)
        self.images.of((self.outcome, self.use, self.copies, self.heavy))
        self.images.send([self.copies, self.heavy])
        self.corners = int(support(s.basis, s.kin)) // gpu.nodes_in_cell(s.basis, s.kin)
        self.visits: dict[int, gpu.Stage] = {}
        first, rows = (list(self.plain(of(*program))) for of in (first_rows, rows_of))
        self.cells = [self._cells(block) for block in s.blocks]
        self.begin: list[KernelLaunch] = []
        self._ahead: list[KernelLaunch] = []
        self.begin = self._launches(first)
        self.step, self.last_step = self._steps(rows)
        self.end = self.launch(gpu.end_step, 1, s)
        self.before, self.behind = self._looks()
        self.order = list(self._order())
        parts = (self.begin, self.step, self.last_step, self.before, self.behind, self.order)
        self._do = dict(zip(PARTS, map(card.together, parts), strict=True))
        self.ordered = -np.inf  # path of the points at the last reordering, in cells

    def _steps(self, rows: list) -> tuple[list[KernelLaunch], list[KernelLaunch]]:
        begin, end = self._clear(*self._slots()), [self.launch(gpu.finish_step, 1, self.s)]
        launches = self._launches(rows)
        last = [launch for launch in launches if launch not in self._ahead]
        return (
            [*begin, *launches, *end, *self._publish(last=False)],
            [*begin, *last, *end, *self._publish(last=True)],
        )

    def _cells(self, block: Any) -> gpu.CellLists:
        nodes, new, points = self.nodes, self.images.new, block.points.mass.size * self.corners
        boxes = min(nodes, points) + 1
        self.levels = [-(-nodes // gpu.CHUNK)]
        while self.levels[-1] > gpu.CHUNK:
            self.levels.append(-(-self.levels[-1] // gpu.CHUNK))
        sums = (sum(self.levels),)
        count, real = np.zeros(nodes, np.int32), self.s.nodes.sums.dtype
        self.images.of(count)
        self.images.send([count])
        visits = self.visits.values()
        most = max((visit.numbers for visit in visits), default=0)
        of_load = (numbers_of(visit.load, (self.s, block), 0) for visit in visits if visit.scatters)
        loads = (max(of_load, default=0), block.points.mass.size)
        return gpu.CellLists(
            count, new((points,), np.int32), new((nodes + 1,), np.int32),
            new((nodes + 1,), np.int32), new((boxes,), np.int32), new((points,), np.int32),
            new(sums, np.int64), new(sums, np.int64), new(loads, real), new((most, boxes), real),
        )  # fmt: skip

    def launch(
        self, function: Callable, count: int, *arguments: Any, called: dict | None = None
    ) -> KernelLaunch:
        """Return a launch of ``function(i, outcome, *arguments)`` in `count` threads per step."""
        function = gpu.while_steps_go_on(function)
        return KernelLaunch(self.images, function, count, self.outcome, *arguments, called=called)

    def of_points(self, function: Callable, block: Any, *rest: Any, **more: Any) -> KernelLaunch:
        return self.launch(function, block.points.mass.size, self.s, block, *rest, **more)

    def _launches(self, rows: list) -> list[KernelLaunch]:
        self._acted: set[int] = set()
        return [one for row in rows for one in take.find((type(row), Card))(row, self)]

    def plain(self, rows: Iterable) -> Iterator:
        for row in table.plain(rows, self.s):
            yield from _on_card(row, self)

    def gathers(self, row: Any) -> Iterator[KernelLaunch]:
        for block, cells in zip(self.s.blocks, self.cells, strict=True):
            yield self.of_points(self.visits[id(row)].gather, block, cells)
        if row.reported:
            yield self.launch(gpu.take_reports(row.reported), 1, self.s)

    def scatters(self, row: Any) -> Iterator[KernelLaunch]:
        s, visit = self.s, self.visits[id(row)]
        pairs = list(zip(s.blocks, self.cells, strict=True))
        if not row.gathers:
            for block, cells in pairs:
                yield self.of_points(visit.load_point, block, cells)
        # If stencils belong to reference positions (total frame), one sort is enough.
        if visit.lists and (s.frame.moves or not self.begin):
            for block, cells in pairs:
                yield self.of_points(visit.count, block, cells)
                yield from self._lists(block, cells)
            yield self.launch(gpu.take_reports(take_reports), 1, s)
            yield self.launch(visit.age(), self.nodes, s, self.use)
            mark = visit.mark()
            for cells in self.cells:
                yield self.launch(mark, cells.cell.size, s, cells, self.use)
        for k, (block, cells) in enumerate(pairs):
            for part in range(visit.parts):
                scatter, sum_up = visit.scatter(part), visit.sum(part, anew=k == part == 0)
                yield self.launch(scatter, cells.cell.size, s, block, cells)
                yield self.launch(sum_up, self.nodes, s, cells, self.use)

    def _lists(self, block: Any, cells: gpu.CellLists) -> Iterator[KernelLaunch]:
        """Sort the points of a block by cell: a counting sort, with prefix sums by chunks."""
        levels = self.levels
        begins = [0, *np.cumsum(levels).tolist()]
        yield self.launch(gpu.sum_counts, levels[0], cells)
        for k in range(len(levels) - 1):
            level = begins[k], levels[k], begins[k + 1]
            yield self.launch(gpu.sum_sums, levels[k + 1], cells, level)
        for k in reversed(range(len(levels))):
            above = begins[k + 1] if k + 1 < len(levels) else -1
            yield self.launch(gpu.sum_before, levels[k], cells, begins[k], above)
        yield self.launch(gpu.place_list, self.nodes, cells)
        yield self.launch(gpu.list_point, cells.number.size, cells)
        yield self.launch(gpu.sort_cell(self.corners), cells.cell.size, block.points.id, cells)

    def _order(self) -> Iterator[KernelLaunch]:
        """Reorder points in memory as threads read them, unless they have corners."""
        if self.corners > 1:
            return
        for block, cells in zip(self.s.blocks, self.cells, strict=True):
            size = block.points.mass.size
            come_from = self.images.new((size,), np.int32)
            yield self.launch(gpu.order_cell, cells.cell.size, cells, come_from)
            tables = [as_rows(self.images.of(array)) for _, array in arrays.arrays_of(block.points)]
            room, most = cells.boxes.reshape(-1), max(rows.nbytes for rows in tables)
            if room.nbytes < most:  # else the memory of cell sums is reused
                room = self.images.new((-(-most // 8),), np.int64)
            for rows in tables:
                target = room.view(np.uint8)[: rows.nbytes].view(rows.dtype).reshape(rows.shape)
                yield self.launch(gpu.take_rows, size, rows, come_from, target)
                yield self.launch(gpu.put_rows, size, rows, target)

    def _hook(self, h: int) -> tuple[fixes.Act, dict]:
        called = dict.fromkeys((NODE_FUNCTION, POINT_FUNCTION, HEAT_FUNCTION), self.functions[h])
        called[EVALUATE] = evaluate_in_table if self._has_formulas(h) else _no_formula
        return fixes.Act(self.hooks, h, self.heavy, self.copies), called

    def _has_formulas(self, h: int) -> bool:
        return any(program.begin < program.end for program in self.hooks.programs[h])

    def _values(self, h: int) -> int:
        """Return how many published values (one step old) threads copy for formulas."""
        if not (self.table[h].uses_before and self._has_formulas(h)):
            return 0
        return 1 + max(self._slots_read(), default=0)

    def _slots_read(self) -> list[int]:
        return [int(slot) for op, slot in self.hooks.code if op % UNIFORM == GLOBAL]

    def hooks_on_nodes(self, row: table.AtNodes) -> Iterator[KernelLaunch]:
        stage, target, at = row
        s, of_heat = at(self.s) if at else self.s, isinstance(row, heat.AtHeatNodes)
        rows = [h for h, hook in enumerate(self.table) if hook.stage == stage]
        yield from self._clear_again(stage, rows)
        if rows and target == arrays.ON_UPDATE and self.hooks.holders.size:
            yield self.launch(fixes.clear_held, self.nodes, self.hooks.holders)
        nodes_of, length = fixes.hooked_nodes(target, of_heat), step_size if of_heat else kick
        for h in rows:
            hook = self.table[h]
            if hook.uses_share:
                yield self.launch(gpu.clear, 1, self.heavy, h)
                yield self._act(fixes.count_node, h, s)
            if hook.address != arrays.WHOLE:
                yield self._act(fixes.on_node(nodes_of, ACT, self._values(h), length), h, s)
            elif target != arrays.ON_VELOCITY:
                act = fixes.on_node(fixes.whole_nodes(target, stage), ACT)
                yield self._act(act, h, s, *self._whole(h))
            yield from self._publish_at_once(h)
        for h in rows:
            if self.hooks.programs[h][FRICTION].begin >= 0:
                yield self._act(fixes.on_node(nodes_of, RUB), h, s)
                yield from self._publish_at_once(h)

    def _whole(self, h: int) -> tuple[arrays.Tag, ...]:
        return tuple(one for one in self.hooks.whole if one.row == h)

    def _act(self, function: Callable, h: int, s: arrays.Setup, *tag: arrays.Tag) -> KernelLaunch:
        row, (about, called) = self.table[h], self._hook(h)
        count = self.nodes if row.begin < 0 else int(row.end - row.begin)
        return self.launch(function, count, s, about, *tag, called=called)

    def hooks_on_points(self, stage: int, then: int) -> Iterator[KernelLaunch]:
        rows = [h for h, row in enumerate(self.table) if row.stage == stage]
        heats = stage == arrays.SUPPLY_HEAT
        points_of = heat.heated if heats else moving_points
        yield from self._clear_again(stage, rows)
        for block in self.s.blocks:
            if stage == arrays.INITIAL_INTEGRATE and len(self.table) and self.hooks.whole:
                yield self.of_points(fixes.clear_force, block)
            for h in rows:
                (about, called), whole = self._hook(h), self._whole(h)
                points = fixes.whole_points(heats) if whole else points_of
                act = fixes.on_point(points, then, self._values(h))
                yield self.of_points(act, block, about, *whole, called=called)
        for h in rows:
            yield from self._publish_at_once(h)

    def work_of_loads(self, target: int) -> Iterator[KernelLaunch]:
        if len(self.table) and self.hooks.loads.size:
            about, called = self._hook(0)
            called[NODE_FUNCTION] = _no_hook
            yield self.launch(fixes.work_of_loads, self.nodes, self.s, about, target, called=called)

    def _rows_of(self, h: int) -> tuple[int, int]:
        row = self.table[h]
        return int(row.slot), int(row.slot) + max(3, int(row.totals))

    def _slots(self) -> tuple[int, int]:
        rows = [self._rows_of(h) for h, row in enumerate(self.table) if row.slot >= 0]
        return (min(rows)[0], max(end for _, end in rows)) if rows else (0, 0)

    def _clear_again(self, stage: int, rows: list[int]) -> Iterator[KernelLaunch]:
        """Clear totals of hooks whose stage is repeated in a step; only the last pass counts."""
        if stage in self._acted:
            for h in rows:
                if self.table[h].slot >= 0:
                    yield from self._clear(*self._rows_of(h))
        self._acted.add(stage)

    def _clear(self, first: int, end: int) -> list[KernelLaunch]:
        sums, count = self.s.control.totals, end - first
        size = count * sums.shape[1]
        if not size:
            return []
        return [
            self.launch(fixes.clear_totals, len(self.copies) * size, self.copies, first, count),
            self.launch(fixes.clear_rows, size, sums, first),
        ]

    def collect(self, first: int, end: int) -> list[KernelLaunch]:
        sums = self.s.control.totals
        size = (end - first) * sums.shape[1]
        return [self.launch(fixes.collect_total, size, self.copies, sums, first)] if size else []

    def _publish(self, last: bool) -> list[KernelLaunch]:
        if not len(self.table):
            return []
        publish = self._publish_some((0, len(self.table)), last)
        return [*self.collect(*self._slots()), *self.collect(WORK, CONTACT_LOSS + 1), publish]

    def _publish_some(self, numbers: tuple[int, int], always: bool) -> KernelLaunch:
        return self.launch(fixes.publish, 1, self.s, self.hooks, (*numbers, always))

    def _publish_at_once(self, h: int) -> list[KernelLaunch]:
        """Publish totals right after their hook, if formulas read values that hooks publish."""
        slots = range(*self._slots())
        if self.table[h].slot < 0 or all(read not in slots for read in self._slots_read()):
            return []
        return [*self.collect(*self._rows_of(h)), self._publish_some((h, h + 1), True)]

    def _looks(self) -> tuple[list[KernelLaunch], list[KernelLaunch]]:
        s, sums = self.s, self.s.control.totals
        copies, solids = self.copies, (len(s.control.values), len(sums))
        of_points = (0, WORK), (TRANSFER_LOSS, TRANSFER_LOSS + 1), solids
        launches = [launch for rows in of_points for launch in self._clear(*rows)]
        for block in s.blocks:
            if not is_rigid(block.laws):
                threads = -(-block.points.mass.size // gpu.CHUNK)
                launches.append(self.launch(fixes.add_energies, threads, s, block, copies))
            if any(more_of(block)):
                launches.append(self.of_points(fixes.add_more, block, copies))
        if field(s.nodes.fields, WorkAtNodes) is not None:
            launches.append(self.launch(fixes.add_work_at_node, self.nodes, s, copies))
        launches += [*self.collect(0, TRANSFER_LOSS + 1), *self.collect(*solids)]
        before, behind = (
            self.launch(function, 1, s) for function in (fixes.look_before, fixes.look_behind)
        )
        return [*launches, before], [*launches, behind]

    def send(self) -> None:
        self.use[:] = 2  # nodes may contain values of earlier steps
        self.images.send([*arrays_in((self.s, self.hooks)), self.use, self.copies])
        self.ordered = -np.inf

    def fetch(self) -> None:
        """Copy the state back, except nodes; clock and published values are always up to date."""
        here = arrays_in(self.s._replace(control=()))
        nodes = set(map(id, self._of_nodes()))
        self.images.fetch([array for array in here if id(array) not in nodes])

    def fetch_nodes(self) -> None:
        """Copy back the nodal output, which steps do not need."""
        self.images.fetch(self._of_nodes())

    def _of_nodes(self) -> list[np.ndarray]:
        kept = {id(array) for _, array in kept_at_nodes(self.s)}
        return [array for _, array in of_nodes(self.s) if id(array) not in kept]

    @property
    def wrong(self) -> int:
        """Return the lowest number of the points that have failed."""
        return int(gpu.BEHIND - self.outcome[gpu.WRONG])

    def advance(self, count: int) -> int:
        """Take up to `count` steps; return DONE, or the status that ended them."""
        control = self.s.control
        records = control.step, control.motion, control.energy, control.heat
        exchanged = [self.outcome, *records, control.values, control.totals]
        self.outcome[: gpu.DRIFT] = 0
        self.images.send(exchanged)
        begun, watched = int(control.values[arrays.TIMESTEP]), control.energy[0].watch_energy
        do = self._do
        do["begin"]()
        if self.begin:
            self._order_if_due()
        for n in range(count):
            do["step" if n + 1 < count else "last step"]()
            looked = (begun + n + 1) % LOOK
            if watched and looked < 2:
                do["behind" if looked else "before"]()
            self.end()
            if (n + 1) % POLL == 0:
                self.images.fetch([self.outcome])
                if self.outcome[gpu.STATUS] > 0:
                    break
                self._order_if_due()
        self.images.fetch(exchanged)
        status = self.outcome[gpu.STATUS]
        return int(status) - 1 if status > 0 else DONE

    def _order_if_due(self) -> None:
        gone = self.outcome[gpu.DRIFT]
        if gone - self.ordered > FAR:
            self.ordered = gone
            self._do["order"]()

    def seconds_of_step(self) -> list[tuple[KernelLaunch, float]]:
        """Return the median time of each launch in a step, measured in a few further steps."""
        for launch in self.begin:
            launch()
        times = [self.card.seconds_of(self.step) for _ in range(5)]
        return list(zip(self.step, map(median, zip(*times, strict=True)), strict=True))


@functools.singledispatch
def _on_card(row: object, steps: StepsOnCard) -> Iterable:
    return (row,)


@_on_card.register
def _repeated(row: table.Repeated, steps: StepsOnCard) -> Iterator:
    for k in range(row.count(steps.s)):
        yield from steps.plain(row.rows(k))


@_on_card.register
def _visited(row: table.Sweep, steps: StepsOnCard) -> Iterable:
    steps.visits[id(row)] = gpu.Stage(row, steps.s)
    return (row,)


@take.on(table.Sweep, Card)
def _sweep(row, steps):
    gathers = list(steps.gathers(row)) if row.gathers else []
    scatters = list(steps.scatters(row)) if steps.visits[id(row)].scatters else []
    if row.only_if_more:
        steps._ahead += scatters
    return gathers + scatters


@take.on(table.NodeTask, Card)
def _node_task(row, steps):
    yield steps.launch(gpu.of_nodes(row), steps.nodes, steps.s, steps.use)


@take.on(table.EachNode, Card)
def _each_node(row, steps):
    act = fixes.each_node(row.function, steps.s)
    yield steps.launch(act, steps.nodes, steps.s, steps.use, steps.copies)


@take.on(table.EachPoint, Card)
def _each_point(row, steps):
    act = fixes.each_point(row.function, steps.s)
    for block in steps.s.blocks:
        if isinstance(block.laws, row.law):
            yield steps.of_points(act, block, steps.copies)


@take.on(table.Once, Card)
def _once(row, steps):
    yield from steps.collect(0, len(steps.s.control.totals))
    yield steps.launch(fixes.once(row.function), 1, steps.s)


@take.on(table.Check, Card)
def _check(row, steps):
    for block in steps.s.blocks:
        yield steps.of_points(fixes.check_point, block)
    yield steps.launch(fixes.take_moves, 1, steps.s)
    yield steps.launch(gpu.take_reports(take_reports), 1, steps.s)


@take.on(table.AtNodes, Card)
def _at_nodes(row, steps):
    return steps.hooks_on_nodes(row)


@take.on(table.AtPoints, Card)
def _at_points(row, steps):
    return steps.hooks_on_points(row.stage, row.then)


@take.on(table.WorkOfLoads, Card)
def _work_of_loads(row, steps):
    return steps.work_of_loads(LOADS_AGAIN if row.again else LOADS)
