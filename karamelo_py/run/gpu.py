"""Steps of a scene on a GPU: its arrays there, and the launches that a step consists of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from karamelo_py.compiler.gpu import Images, Launch
from karamelo_py.kernels import gpu, table
from karamelo_py.kernels.arrays import Setup
from karamelo_py.kernels.p2g import columns_of
from karamelo_py.kernels.step import DONE, first_rows, rows_of

POLL = 64  # steps between two looks at how far a run is
REGISTERS = 64  # numbers that a thread of a cell sums at once


def arrays_in(thing: Any) -> Iterator[np.ndarray]:
    """Every array in nested tuples."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, tuple):
        for item in thing:
            yield from arrays_in(item)


class StepsOnCard:
    """Take the steps of a lowered scene on a card."""

    def __init__(self, card: Any, s: Setup, scheme: Any, visits: type):
        self.card, self.s = card, s
        self.images = Images(card)
        self.fate = np.zeros(4)
        self.fate_there = self.images.of(self.fate)
        self.nodes = len(s.nodes.sums)
        own = [b.points.mass.size for b in s.blocks]
        self.cells = [self._cells(n) for n in own]
        self.listed = False  # whether the points are in lists that stay
        self._rooms(s, rows_of(scheme, visits))
        self.begin = self._launches(first_rows(scheme, visits))
        rows = rows_of(scheme, visits)
        self.step = [*self._launches(rows), self._launch(gpu.end_step, 1, s)]
        self.last_step = [*self._launches(rows, more=False), self.step[-1]]

    # --- rooms

    def _cells(self, points: int) -> gpu.Cells:
        nodes, new = self.nodes, self.images.new
        levels, count = [], nodes
        while count > 1:
            count = -(-count // gpu.CHUNK)
            levels.append(count)
        self.levels = levels or [1]
        return gpu.Cells(
            new((nodes,), np.int64), new((points,), np.int64), new((nodes + 1,), np.int64),
            new((nodes,), np.int64), new((points,), np.int64), new((sum(self.levels),), np.int64),
            np.zeros((0, 0)),
        )  # fmt: skip

    def _rooms(self, s: Setup, rows: list) -> None:
        """Give room to what cells sum: for the visit that gives most."""
        self.present = ["sums", "velocity", *(type(one) for one in s.nodes.fields)]
        stages = [self._stage(row) for row in rows if isinstance(row, table.Sweep)]
        most = max((len(stage.columns) * stage.support for stage in stages), default=0)
        made = []
        for cells, block in zip(self.cells, s.blocks, strict=True):
            boxes = min(self.nodes, block.points.mass.size)
            room = self.images.new((most, max(boxes, 1)), s.nodes.sums.dtype)
            made.append(cells._replace(boxes=room))
        self.cells = made

    def _stage(self, row: Any) -> gpu.Stage:
        columns = columns_of(row.visit.quantities, self.s.kin)
        numbers = sum(end - first for name, first, end in columns if name in self.present)
        stage = gpu.Stage(row, self.s.basis, self.s.kin, self.present)
        stage.parts = max(1, -(-numbers * stage.support // REGISTERS))
        return stage

    # --- launches

    def _launch(self, function: Callable, count: int, *arguments: Any) -> Launch:
        return Launch(self.images, function, count, self.fate, *arguments)

    def _launches(self, rows: list, more: bool = True) -> list[Launch]:
        """What the rows of a part of a step launch."""
        found: list[Launch] = []
        for row in rows:
            if isinstance(row, table.Sweep):
                found += self._visit(row, more)
            elif isinstance(row, table.NodeTask):
                found.append(self._launch(gpu.of_nodes(row.task), self.nodes, self.s))
            elif isinstance(row, table.SceneTask) and row.function.says(self.s) is not None:
                raise NotImplementedError(row.function.says(self.s))
        return found

    def _visit(self, row: Any, more: bool) -> Iterator[Launch]:
        s, stage = self.s, self._stage(row)
        scatters = more if row.only_if_more else row.scatters
        sizes = [block.points.mass.size for block in s.blocks]
        pairs = list(zip(s.blocks, self.cells, sizes, strict=True))
        if row.gathers:
            gather = stage.gather()
            for block, _, size in pairs:
                yield self._launch(gather, size, s, block)
            yield self._launch(gpu.take_reports, 1, s)
        if not scatters or not row.visit.quantities:
            return
        if stage.lists:
            count = stage.count()
            for block, cells, size in pairs:
                yield self._launch(count, size, s, block, cells)
                yield from self._lists(block, cells)
            yield self._launch(gpu.take_reports, 1, s)
        functions = [stage.scatter(part) for part in range(stage.parts)]
        for k, (block, cells, _) in enumerate(pairs):
            for scatter in functions:
                yield self._launch(scatter, self.nodes, s, block, cells)
            yield self._launch(stage.sum(k == 0), self.nodes, s, block, cells)

    def _lists(self, block: Any, cells: gpu.Cells) -> Iterator[Launch]:
        levels = self.levels
        begins = [0, *np.cumsum(levels).tolist()]
        yield self._launch(gpu.sum_counts, levels[0], cells)
        steps = [(begins[k], levels[k], begins[k + 1]) for k in range(len(levels) - 1)]
        for k, (begin, count, above) in enumerate(steps):
            yield self._launch(gpu.sum_sums, levels[k + 1], cells.sums, begin, count, above)
        for k in reversed(range(len(levels))):
            above = begins[k + 1] if k + 1 < len(levels) else -1
            threads = -(-levels[k] // gpu.CHUNK)
            yield self._launch(gpu.spread_sums, threads, cells.sums, begins[k], levels[k], above)
        yield self._launch(gpu.spread_counts, levels[0], cells)
        yield self._launch(gpu.list_point, block.points.mass.size, cells)
        yield self._launch(gpu.sort_cell, self.nodes, block.points.id, cells)

    # --- steps

    def send(self) -> None:
        """Copy the state of the scene to the card."""
        self.images.send(arrays_in(self.s))

    def fetch(self) -> None:
        """Copy it back."""
        self.images.fetch(arrays_in(self.s))

    def advance(self, count: int) -> int:
        """Take up to `count` steps; DONE, or why they ended."""
        self.fate[:] = 0
        self.images.send([self.fate, self.s.control.clock, self.s.control.values])
        for launch in self.begin:
            launch()
        for n in range(count):
            for launch in self.step if n + 1 < count else self.last_step:
                launch()
            if (n + 1) % POLL == 0:
                self.images.fetch([self.fate])
                if self.fate[gpu.STATUS] > 0:
                    break
        self.images.fetch([self.fate, self.s.control.clock, self.s.control.values])
        status = self.fate[gpu.STATUS]
        return int(status) - 1 if status > 0 else DONE
