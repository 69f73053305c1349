"""Steps of a scene on a GPU: its arrays there, and the launches that a step consists of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from karamelo_py.compiler.choices import INTERPRETED
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.formula import EVALUATE, GLOBAL, UNIFORM, evaluate_in_table
from karamelo_py.compiler.gpu import Images, KernelLaunch, numbers_of
from karamelo_py.kernels import arrays, gpu, heat, table
from karamelo_py.kernels import gpu_fixes as fixes
from karamelo_py.kernels.clock import kick, step_size, take_reports
from karamelo_py.kernels.equations.internal_force import WorkOfForces
from karamelo_py.kernels.hook_loop import ACT, RUB, add_work, moving_points
from karamelo_py.kernels.hooks import HEAT_FUNCTION, NODE_FUNCTION, POINT_FUNCTION
from karamelo_py.kernels.step import DONE, first_rows, rows_of
from karamelo_py.kernels.totals import WORK
from karamelo_py.kernels.walls import FRICTION
from karamelo_py.kernels.watch import LOOK
from karamelo_py.points.basis import support
from karamelo_py.points.laws import moves_as_told
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, of_nodes

POLL = 64  # steps between two looks at how far a run is
REGISTERS = {4: 200, 8: 130}  # words that a thread of a cell sums up, by the size of numbers
FAR = 1.0  # cells that points go before they are ordered anew in memory
PARTS = "begin", "step", "last step", "before", "behind", "order"  # of launches
_NONE = arrays.NoHooks()


def arrays_in(thing: Any) -> Iterator[np.ndarray]:
    """Yield the arrays in nested tuples."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, tuple):
        for item in thing:
            yield from arrays_in(item)


def there(s: arrays.Setup) -> arrays.Setup:
    """Leave out of a setup what no card needs: tiles, and the boxes of their nodes."""
    blocks = tuple(block._replace(tiling=()) for block in s.blocks)
    buffers, own = s.buffers._replace(nodes=s.nodes), s.heat
    if isinstance(own, heat.Conducting):
        own = own._replace(buffers=buffers._replace(nodes=own.nodes))
    return s._replace(blocks=blocks, buffers=buffers, heat=own)


def as_rows(image: np.ndarray) -> np.ndarray:
    """See the numbers of points, (..., n), as whole numbers (rows, n) of as many bytes."""
    rows = int(np.prod(image.shape[:-1], dtype=int))
    step = image.strides[-2] if image.ndim > 1 else 0
    whole = {4: np.int32, 8: np.int64}[image.itemsize]
    return as_strided(image.view(whole), (rows, image.shape[-1]), (step, image.itemsize))


def _no_formula(*_):
    """Evaluate nothing, for hooks whose formulas are numbers."""


class StepsOnCard:
    """Take the steps of a lowered scene on a card.

    `functions` belong to the compiled hooks, in the order of their table.
    """

    def __init__(
        self, card: Any, s: arrays.Setup, scheme: Any, visits: type,
        hooks: arrays.Hooks | arrays.NoHooks = _NONE, functions: Sequence[Callable] = (),
    ):  # fmt: skip
        self.card, self.s, self.hooks, self.functions = card, (s := there(s)), hooks, functions
        self.images = Images(card)
        self.fate = np.zeros(5)
        self.images.of(self.fate)
        self.nodes = len(s.nodes.sums)
        self.corners = int(support(s.basis, s.kin)) // gpu.nodes_in_cell(s.basis, s.kin)
        self.cells = [self._cells(b.points.mass.size * self.corners) for b in s.blocks]
        self.use = np.zeros(self.nodes, np.int8)
        self.images.of(self.use)
        self._totals()
        rows = rows_of(scheme, visits)
        self._rooms(s, rows)
        self.begin = self._launches(first_rows(scheme, visits))
        self.step, self.last_step = self._steps(rows)
        self.end = self._launch(gpu.end_step, 1, s)
        self.before, self.behind = self._looks()
        self.order = list(self._order())
        parts = (self.begin, self.step, self.last_step, self.before, self.behind, self.order)
        self._do = dict(zip(PARTS, map(card.together, parts), strict=True))
        self.ordered = -np.inf  # how far points had gone when they were ordered

    def _steps(self, rows: list) -> tuple[list[KernelLaunch], list[KernelLaunch]]:
        """List the launches of a step, and of the last of several steps."""
        begin, end = self._clear(*self._slots()), [self._launch(gpu.finish_step, 1, self.s)]
        ahead: list[KernelLaunch] = []  # sums for the next step
        own = self._launches(rows, ahead)
        last = [launch for launch in own if launch not in ahead]
        return (
            [*begin, *own, *end, *self._publish(last=False)],
            [*begin, *last, *end, *self._publish(last=True)],
        )

    # --- rooms

    def _cells(self, points: int) -> gpu.CellLists:
        nodes, new, boxes = self.nodes, self.images.new, min(self.nodes, points) + 1
        self.levels = [-(-nodes // gpu.CHUNK)]
        while self.levels[-1] > gpu.CHUNK:
            self.levels.append(-(-self.levels[-1] // gpu.CHUNK))
        sums = (sum(self.levels),)
        count = np.zeros(nodes, np.int32)
        self.images.of(count)
        self.images.send([count])
        return gpu.CellLists(
            count, new((points,), np.int32), new((nodes + 1,), np.int32),
            new((nodes + 1,), np.int32), new((boxes,), np.int32), new((points,), np.int32),
            new(sums, np.int64), new(sums, np.int64), np.zeros((0, 0)), np.zeros((0, 0)),
        )  # fmt: skip

    def _totals(self) -> None:
        """Give room to copies of the totals, and to counts of members."""
        self.copies = np.zeros((self.card.copies, *self.s.control.totals.shape), np.int64)
        self.heavy = np.zeros(max(len(self.functions), 1), np.int64)
        self.images.of((self.copies, self.heavy))
        self.images.send([self.copies, self.heavy])

    def _rooms(self, s: arrays.Setup, rows: list) -> None:
        """Give room to what cells sum: for the visit that gives most."""
        stages = [self._stage(row) for row in self._plain(rows) if isinstance(row, table.Sweep)]
        most = max((stage.numbers for stage in stages), default=0)
        self.cells = [
            cells._replace(
                boxes=self.images.new((most, cells.cell.size), s.nodes.sums.dtype),
                loads=self._loads(stages, block),
            )
            for cells, block in zip(self.cells, s.blocks, strict=True)
        ]

    def _loads(self, stages: list[gpu.Stage], block: Any) -> np.ndarray:
        """Give room to what the points of a block give."""
        loads = [stage.load for stage in stages if stage.scatters]
        if INTERPRETED:
            counts = [len(load(self.s, block, 0)) for load in loads]
        else:
            arguments = self.images.of((self.s, block))
            counts = [numbers_of(load, arguments) for load in loads]
        shape = (max(counts, default=0), block.points.mass.size)
        return self.images.new(shape, self.s.nodes.sums.dtype)

    def _stage(self, row: Any) -> gpu.Stage:
        nodes = (row.at(self.s) if row.at else self.s).nodes
        present = ["sums", "velocity", *(type(one) for one in nodes.fields)]
        stage = gpu.Stage(row, self.s, present)
        size = self.s.nodes.sums.itemsize
        words = size // 4 * len(stage.columns) * stage.support
        stage.parts = max(1, -(-words // REGISTERS[size]))
        return stage

    # --- launches

    def _launch(
        self, function: Callable, count: int, *arguments: Any, called: dict | None = None
    ) -> KernelLaunch:
        function = gpu.while_steps_go_on(function)
        return KernelLaunch(self.images, function, count, self.fate, *arguments, called=called)

    def _of_points(self, function: Callable, block: Any, *rest: Any, **more: Any) -> KernelLaunch:
        """Launch a function of the setup and a block, by a thread for each point."""
        return self._launch(function, block.points.mass.size, self.s, block, *rest, **more)

    def _launches(self, rows: list, ahead: list[KernelLaunch] | None = None) -> list[KernelLaunch]:
        """List the launches of rows of a step; `ahead` takes those that serve the next one."""
        found: list[KernelLaunch] = []
        self._stages: set[int] = set()  # at which hooks have acted
        for row in self._plain(rows):
            if isinstance(row, table.Sweep):
                found += self._visit(row, ahead)
            elif isinstance(row, table.NodeTask):
                found.append(self._launch(gpu.of_nodes(row), self.nodes, self.s, self.use))
            elif isinstance(row, table.EachNode):
                act = fixes.each_node(row.function, self.s)
                found.append(self._launch(act, self.nodes, self.s, self.use, self.copies))
            elif isinstance(row, table.EachPoint):
                act = fixes.each_point(row.function, self.s)
                for block in self.s.blocks:
                    if isinstance(block.laws, row.law):
                        found.append(self._of_points(act, block, self.copies))
            elif isinstance(row, table.Once):
                found += self._collect(0, len(self.s.control.totals))
                found.append(self._launch(fixes.once(row.function), 1, self.s))
            elif isinstance(row, table.AtNodes):
                found += self._hooks_on_nodes(row.stage, row.target)
            elif isinstance(row, table.AtPoints):
                found += self._hooks_on_points(row.stage, row.then)
            elif isinstance(row, table.Check):
                found += [self._of_points(fixes.check_point, block) for block in self.s.blocks]
                found.append(self._launch(fixes.take_moves, 1, self.s))
                found.append(self._launch(gpu.take_reports(take_reports), 1, self.s))
            elif row.function is add_work:
                found += self._work_of_loads()
            elif row.function is heat.at_heat_nodes:
                found += self._hooks_on_nodes(*row.arguments, of_heat=True)
            elif row.function is heat.at_heated_points:
                found += self._hooks_on_points(arrays.SUPPLY_HEAT, 0)
            else:
                raise TypeError(f"no GPU knows what {row.function.__name__} does in a step")
        return found

    def _plain(self, rows: Iterable) -> Iterator[Any]:
        """Yield the rows of the scene, those that are repeated one after another."""
        for row in table.plain(rows, self.s):
            if isinstance(row, table.Repeated):
                for k in range(row.count(self.s)):
                    yield from self._plain(row.rows(k))
            else:
                yield row

    def _visit(self, row: Any, ahead: list[KernelLaunch] | None) -> list[KernelLaunch]:
        gathers, scatters = list(self._gathers(row)), list(self._scatters(row, ahead))
        if row.only_if_more and ahead is not None:
            ahead += scatters
        return gathers + scatters

    def _gathers(self, row: Any) -> Iterator[KernelLaunch]:
        if row.gathers:
            gather = self._stage(row).gather
            for block, cells in zip(self.s.blocks, self.cells, strict=True):
                yield self._of_points(gather, block, cells)
            if row.reported:
                yield self._launch(gpu.take_reports(row.reported), 1, self.s)

    def _scatters(self, row: Any, ahead: list[KernelLaunch] | None) -> Iterator[KernelLaunch]:
        s, stage = self.s, self._stage(row)
        pairs = list(zip(s.blocks, self.cells, strict=True))
        if not stage.scatters:
            return
        if not row.gathers:
            load = stage.load_point
            for block, cells in pairs:
                yield self._of_points(load, block, cells)
        # Points that stay are listed once, before the first step, where something is done then.
        if stage.lists and (s.frame.moves or ahead is None or not self.begin):
            count = stage.count
            for block, cells in pairs:
                yield self._of_points(count, block, cells)
                yield from self._lists(block, cells)
            yield self._launch(gpu.take_reports(take_reports), 1, s)
            yield self._launch(stage.age(), self.nodes, s, self.use)
            mark = stage.mark()
            for cells in self.cells:
                yield self._launch(mark, cells.cell.size, s, cells, self.use)
        for k, (block, cells) in enumerate(pairs):
            for part in range(stage.parts):
                scatter, sum_up = stage.scatter(part), stage.sum(part, anew=k == part == 0)
                yield self._launch(scatter, cells.cell.size, s, block, cells)
                yield self._launch(sum_up, self.nodes, s, block, cells, self.use)

    def _lists(self, block: Any, cells: gpu.CellLists) -> Iterator[KernelLaunch]:
        levels = self.levels
        begins = [0, *np.cumsum(levels).tolist()]
        yield self._launch(gpu.sum_counts, levels[0], cells)
        for k in range(len(levels) - 1):
            rest = (begins[k], levels[k], begins[k + 1])
            yield self._launch(gpu.sum_sums, levels[k + 1], cells, *rest)
        for k in reversed(range(len(levels))):
            above = begins[k + 1] if k + 1 < len(levels) else -1
            yield self._launch(gpu.sum_before, levels[k], cells, begins[k], above)
        yield self._launch(gpu.place_list, self.nodes, cells)
        yield self._launch(gpu.list_point, cells.number.size, cells)
        yield self._launch(gpu.sort_cell(self.corners), cells.cell.size, block.points.id, cells)

    def _order(self) -> Iterator[KernelLaunch]:
        """Bring points into the order in which threads go through them; domains stay."""
        if self.corners > 1:
            return
        for block, cells in zip(self.s.blocks, self.cells, strict=True):
            size = block.points.mass.size
            come_from = self.images.new((size,), np.int32)
            yield self._launch(gpu.order_cell, cells.cell.size, cells, come_from)
            tables = [as_rows(self.images.of(array)) for _, array in arrays.arrays_of(block.points)]
            room, most = cells.boxes.reshape(-1), max(rows.nbytes for rows in tables)
            if room.nbytes < most:  # where cells sum, there is room meanwhile
                room = self.images.new((-(-most // 8),), np.int64)
            for rows in tables:
                own = room.view(np.uint8)[: rows.nbytes].view(rows.dtype).reshape(rows.shape)
                yield self._launch(gpu.take_rows, size, rows, come_from, own)
                yield self._launch(gpu.put_rows, size, rows, own)

    # --- hooks of fixes

    def _table(self) -> Any:
        return () if isinstance(self.hooks, arrays.NoHooks) else self.hooks.table

    def _called(self, h: int) -> dict:
        """Map what is called by its address to the functions of a hook."""
        own = dict.fromkeys((NODE_FUNCTION, POINT_FUNCTION, HEAT_FUNCTION), self.functions[h])
        return {**own, EVALUATE: evaluate_in_table if self._has_formulas(h) else _no_formula}

    def _has_formulas(self, h: int) -> bool:
        """Tell whether a hook has formulas that are no numbers."""
        return any(program.begin < program.end for program in self.hooks.programs[h])

    def _values(self, h: int) -> int:
        """Count published values that a thread needs for itself: of formulas a step earlier."""
        if not (self._table()[h].uses_before and self._has_formulas(h)):
            return 0
        return 1 + max((operand for op, operand in self._globals()), default=0)

    def _globals(self) -> Iterator[tuple[int, int]]:
        """Yield the instructions of formulas that ask for published values."""
        return ((op, int(slot)) for op, slot in self.hooks.code if op % UNIFORM == GLOBAL)

    def _members(self, h: int) -> int:
        row = self._table()[h]
        return self.nodes if row.begin < 0 else int(row.end - row.begin)

    def _hooks_on_nodes(
        self, stage: int, target: int, of_heat: bool = False
    ) -> Iterator[KernelLaunch]:
        s = heat.at_its_nodes(self.s) if of_heat else self.s
        own = [h for h, row in enumerate(self._table()) if row.stage == stage]
        yield from self._clear_again(stage, own)
        if own and target == arrays.ON_UPDATE and self.hooks.held.size:
            yield self._launch(fixes.clear_held, self.nodes, self.hooks.held)
        nodes_of, length = fixes.hooked_nodes(target, of_heat), step_size if of_heat else kick
        for h in own:
            row = self._table()[h]
            if row.uses_share:
                yield self._launch(gpu.clear, 1, self.heavy, h)
                yield self._act(fixes.count_node, h, s)
            if row.address != arrays.WHOLE:
                yield self._act(fixes.on_node(nodes_of, ACT, self._values(h), length), h, s)
            elif target != arrays.ON_VELOCITY:
                act = fixes.on_node(fixes.whole_nodes(target, stage), ACT)
                yield self._act(act, h, s, self._whole(h))
            yield from self._publish_at_once(h)
        for h in own:
            if self.hooks.programs[h][FRICTION].begin >= 0:
                yield self._act(fixes.on_node(nodes_of, RUB), h, s)
                yield from self._publish_at_once(h)

    def _whole(self, h: int) -> arrays.Tag:
        (tag,) = (one for one in self.hooks.whole if one.row == h)
        return tag

    def _act(self, function: Callable, h: int, s: arrays.Setup, *tag: arrays.Tag) -> KernelLaunch:
        """Launch a function of the members of a hook on nodes."""
        about, called = fixes.Act(h, self.heavy, self.copies), self._called(h)
        return self._launch(function, self._members(h), s, self.hooks, about, *tag, called=called)

    def _hooks_on_points(self, stage: int, then: int) -> Iterator[KernelLaunch]:
        s, hooks = self.s, self.hooks
        own = [h for h, row in enumerate(self._table()) if row.stage == stage]
        heats = stage == arrays.SUPPLY_HEAT
        yield from self._clear_again(stage, own)
        for block in s.blocks:
            if stage == arrays.INITIAL_INTEGRATE and getattr(hooks, "whole", ()):
                yield self._of_points(fixes.clear_force, block)
            for h in own:
                about, called = fixes.Act(h, self.heavy, self.copies), self._called(h)
                if self._table()[h].address != arrays.WHOLE:
                    points_of = heat.heated if heats else moving_points
                    act = fixes.on_point(points_of, then, self._values(h))
                    yield self._of_points(act, block, hooks, about, called=called)
                else:
                    act, tag = fixes.on_point(fixes.whole_points(heats), then), self._whole(h)
                    yield self._of_points(act, block, hooks, about, tag, called=called)
        for h in own:
            yield from self._publish_at_once(h)

    def _work_of_loads(self) -> Iterator[KernelLaunch]:
        if len(self._table()) and self.hooks.loads.size:
            rest = self.s, self.hooks, fixes.Act(0, self.heavy, self.copies)
            yield self._launch(fixes.work_of_loads, self.nodes, *rest, called=self._called(0))

    # --- totals, and the watch over energy

    def _rows_of(self, h: int) -> tuple[int, int]:
        """Return the first of the rows of totals that a hook publishes, and where they end."""
        row = self._table()[h]
        return int(row.slot), int(row.slot) + max(3, int(row.totals))

    def _slots(self) -> tuple[int, int]:
        """Return the first of the rows of totals that hooks publish, and where they end."""
        rows = [self._rows_of(h) for h, row in enumerate(self._table()) if row.slot >= 0]
        return (min(rows)[0], max(end for _, end in rows)) if rows else (0, 0)

    def _clear_again(self, stage: int, own: list[int]) -> Iterator[KernelLaunch]:
        """Clear the totals of hooks whose stage comes again in a step: the last time counts."""
        if stage in self._stages:
            for h in own:
                if self._table()[h].slot >= 0:
                    yield from self._clear(*self._rows_of(h))
        self._stages.add(stage)

    def _clear(self, first: int, end: int) -> list[KernelLaunch]:
        """Clear rows of the totals."""
        sums, count = self.s.control.totals, end - first
        size = count * sums.shape[1]
        if not size:
            return []
        return [
            self._launch(fixes.clear_totals, len(self.copies) * size, self.copies, first, count),
            self._launch(fixes.clear_rows, size, sums, first),
        ]

    def _collect(self, first: int, end: int) -> list[KernelLaunch]:
        """Add up the copies of rows of the totals."""
        sums = self.s.control.totals
        size = (end - first) * sums.shape[1]
        return [self._launch(fixes.collect_total, size, self.copies, sums, first)] if size else []

    def _publish(self, last: bool) -> list[KernelLaunch]:
        if not len(self._table()):
            return []
        numbers = 0, len(self._table())
        publish = self._launch(fixes.publish, 1, self.s, self.hooks, numbers, last)
        return [*self._collect(*self._slots()), *self._collect(WORK, WORK + 1), publish]

    def _publish_at_once(self, h: int) -> list[KernelLaunch]:
        """Publish the totals of a hook after it, if other formulas may read them."""
        slots = range(*self._slots())
        if self._table()[h].slot < 0 or all(read not in slots for _, read in self._globals()):
            return []
        publish = self._launch(fixes.publish, 1, self.s, self.hooks, (h, h + 1), True)
        return [*self._collect(*self._rows_of(h)), publish]

    def _looks(self) -> tuple[list[KernelLaunch], list[KernelLaunch]]:
        """List the launches of a look at the energy: before, and a step later."""
        s, sums = self.s, self.s.control.totals
        copies, solids = self.copies, (len(s.control.values), len(sums))
        found = [*self._clear(0, WORK), *self._clear(*solids)]
        for block in s.blocks:
            if not moves_as_told(block.laws):
                threads = -(-block.points.mass.size // gpu.CHUNK)
                found.append(self._launch(fixes.add_energies, threads, s, block, copies, threads))
            if field(block.points.fields, WorkOfForces) is not None:
                found.append(self._of_points(fixes.add_work, block, copies))
        found += [*self._collect(0, WORK + 1), *self._collect(*solids)]
        before, behind = (
            self._launch(function, 1, s) for function in (fixes.look_before, fixes.look_behind)
        )
        return [*found, before], [*found, behind]

    # --- steps

    def send(self) -> None:
        """Copy the state of the scene to the card."""
        self.use[:] = 2  # what nodes show is unknown
        # Steps that went wrong have left their part of the totals.
        self.images.send([*arrays_in((self.s, self.hooks)), self.use, self.copies])
        self.ordered = -np.inf

    def fetch(self) -> None:
        """Copy it back, but for nodes; clock and values are up to date already."""
        here = arrays_in(self.s._replace(control=()))
        nodes = set(map(id, self._of_nodes()))
        self.images.fetch([array for array in here if id(array) not in nodes])

    def fetch_nodes(self) -> None:
        """Copy back what nodes show, which no step needs."""
        self.images.fetch(self._of_nodes())

    def _of_nodes(self) -> list[np.ndarray]:
        kept = {id(array) for _, array in kept_at_nodes(self.s)}
        return [array for _, array in of_nodes(self.s) if id(array) not in kept]

    @property
    def wrong(self) -> int:
        """Return the number of the first of the points that went wrong."""
        return int(gpu.BEHIND - self.fate[gpu.WRONG])

    def advance(self, count: int) -> int:
        """Take up to `count` steps; DONE, or why they ended."""
        control = self.s.control
        exchanged = [self.fate, control.clock, control.values, control.totals]
        self.fate[: gpu.DRIFT] = 0
        self.images.send(exchanged)
        begun, watched = int(control.values[arrays.TIMESTEP]), control.clock[0].watch_energy
        do = self._do
        do["begin"]()
        if self.begin:  # else points are listed in the first step
            self._order_if_due()
        for n in range(count):
            do["step" if n + 1 < count else "last step"]()
            looked = (begun + n + 1) % LOOK
            if watched and looked < 2:
                do["behind" if looked else "before"]()
            self.end()
            if (n + 1) % POLL == 0:
                self.images.fetch([self.fate])
                if self.fate[gpu.STATUS] > 0:
                    break
                self._order_if_due()
        self.images.fetch(exchanged)
        status = self.fate[gpu.STATUS]
        return int(status) - 1 if status > 0 else DONE

    def _order_if_due(self) -> None:
        """Order points in memory, once some have gone far since that was done last."""
        gone = self.fate[gpu.DRIFT]
        if gone - self.ordered > FAR:
            self.ordered = gone
            self._do["order"]()

    def seconds_of_step(self) -> list[tuple[KernelLaunch, float]]:
        """Time each launch of a step after the last one: the medians of a few steps."""
        for launch in self.begin:
            launch()
        times = [self.card.seconds_of(self.step) for _ in range(5)]
        return list(zip(self.step, map(median, zip(*times, strict=True)), strict=True))
