"""Tiles: blocks of grid cells with their points, the nodes in reach, and the nodes in use."""

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any, Protocol

import numpy as np

from karamelo_py.compiler.fields import SummedField, addresses_of_rows
from karamelo_py.compiler.lanes import lanes_for
from karamelo_py.compiler.threads import Serial, Threaded
from karamelo_py.kernels import sorting
from karamelo_py.kernels.arrays import (
    ADD,
    CLEAR,
    TAKE,
    Block,
    Buffers,
    Control,
    Hooks,
    Nodes,
    NoHooks,
    OnGrids,
    Points,
    Setup,
    Tag,
    Tiling,
    arrays_of,
)
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.sweep import ROUNDING
from karamelo_py.points.basis import first_node, shape_size
from karamelo_py.points.kinematics import planar
from karamelo_py.run import boxes as grid_boxes
from karamelo_py.scene.lattice import MAX_NODES, Lattice

# Cells per direction in a tile of points; nodes per direction in a tile of nodes. Small boxes fit
# into caches, large ones overlap less.
TILES = {1: 64, 2: 24, 3: 8}
NODES = {1: 64, 2: 8, 3: 8}
LONGER = 16  # in 3D with one point per cell, tiles are longer along rows, to have more points
SHARES = 64  # sets of tiles in a block with about equal numbers of points, for threads
# Boxes with fewer rows than this times the nodes are allocated at the start: unused pages take no
# memory.
ALLOCATED_UP_TO = 8
DIRECT_UP_TO = 2000  # points up to which clearing and summing boxes costs more than threads save
PART = 2000  # points per part, for sorting by threads
MOST_DRIFT = 1.0  # cells that points may move between sorts
# With less drift, boxes are smaller and more neighbouring points have the same nodes. In 2D this
# gains less than the additional sorting costs.
LEAST_DRIFT = {1: MOST_DRIFT, 2: MOST_DRIFT, 3: 0.25}
SORT_STEPS = 32  # intended number of steps between sorts
# If points scatter directly to nodes, a larger drift only puts more nodes in use.
DIRECT_DRIFT, DIRECT_STEPS = 4.0, 1000


class Tiles:
    """Sorts the points of a setup by tile, and finds the nodes that each tile may reach."""

    threads = 1
    mode: Serial | Threaded = Serial()

    def __init__(self, lattices: Sequence[Lattice], basis: Tag, points: int, sparse: bool):
        self.direct = points <= DIRECT_UP_TO  # points scatter directly to nodes
        self.dimension = d = lattices[0].dimension
        self.size, self.node_size = np.full(d, TILES[d]), np.full(d, NODES[d])
        self.long = sparse and d == 3
        if self.long:
            self.size[-1] *= LONGER
            self.node_size[:] = 1, 1, self.size[-1]
        self.per_cell = basis.traits.nodes_per_cell
        self.least_nodes = basis.traits.least_nodes
        self.beyond = basis.traits.cells // 2  # nodes of the stencil beyond the cell
        self.sorts = self.sets = 0
        self.rows = 0  # number of rows of the buffers
        self.occupied = 0  # number of tiles with points
        self._nodes = np.array([x.shape[:d] for x in lattices], np.int64)
        self._cells = np.array([x.cells[:d] for x in lattices], np.int64)
        self._first_node = np.array([x.first for x in lattices], np.int64)
        self._steps = grid_boxes.steps_of(self._nodes)
        self.shapes = -(-self._cells // self.size)
        self.first = grid_boxes.numbered(self.shapes)
        # In the total frame, points reach at most two cells beyond their tile (contact: three).
        far = 2 if len(lattices) == 1 else 3
        widest = (self.size + 2 * far) * self.per_cell + 1 + 2 * self.beyond
        widest = np.minimum(widest, self._nodes)
        most = float(np.diff(self.first) @ np.prod(widest, axis=1, dtype=float))
        shaped = shape_size(type(basis), d) > 0
        self._most_rows = inf if shaped else most
        rows = np.prod(widest[:, :-1], axis=1, dtype=np.int64).max()
        # Points of a long tile may spread at one end only, so the nodes in use are stored per row.
        by_rows = self.long and not shaped and not self.direct
        self._most_in_box = int(rows) if by_rows else 0
        self.count = int(self.first[-1])
        self._cut = sorting.TileGrid(self.size, self.shapes, self.first)
        tiles = -(-self._nodes // self.node_size)
        self._tile_steps = grid_boxes.steps_of(tiles)
        self._first_of_nodes = grid_boxes.numbered(tiles)
        self._layout = np.zeros(2, np.int64), np.zeros(1, np.int64), np.zeros((0, 10), np.int64)

    def empty_tiling(self) -> Tiling:
        return Tiling(
            count=np.array([0, 1, 0]),
            share=np.zeros(SHARES + 1, np.int64),
            order=np.arange(self.count + 1),
            range=np.zeros((self.count + 1, 2), np.int64),
            grid=np.zeros(self.count + 1, np.int64),
            number=np.zeros(self.count + 1, np.int64),
            box=np.zeros((self.count + 1, 2 * self.dimension), np.int64),
            rows=np.zeros((self.count + 1, self._most_in_box, 2), np.int16),
            buffer=np.zeros((self.count + 1, 5), np.int64),
            report=np.zeros((self.count + 1, 15)),
        )

    def empty_buffers(self, nodes: Nodes, blocks: int) -> Buffers:
        most = blocks * self._most_rows
        rows = int(most) if most <= ALLOCATED_UP_TO * len(nodes.sums) else 0
        summed_fields = tuple(one for one in nodes.fields if isinstance(one, SummedField))
        of = nodes._replace(fields=summed_fields)
        if not self.direct:
            of = Nodes(
                *(grid_boxes.room_of(rows, array) for array in of[:-1]),
                tuple(type(one)(grid_boxes.room_of(rows, one.array)) for one in summed_fields),
            )
        self.sets += 1
        return Buffers(of, *self._layout, self.sets - 1)

    def empty_nodes(self, s: Setup) -> None:
        _empty(s, grid_boxes.used(s.spans)[1:])
        if not self.direct:
            for one in grid_boxes.buffers_of(s):
                for array in grid_boxes.summed(one.nodes):
                    array[: self.rows] = 0

    def unsort(self, control: Control, *, limit: float | None = None) -> None:
        """Request a sort before the next step; `limit` replaces the drift limit."""
        motion = control.motion[0]
        motion.drift = np.inf
        if limit is not None:
            motion.drift_limit = limit

    def sort(self, s: Setup) -> None:
        """Sort all points by tile, find the nodes in use, and zero the sums at all others.

        The next step zeroes nodes in use. Boxes are zero between steps.
        """
        before = grid_boxes.used(s.spans)[1:].copy()
        motion = s.control.motion[0]
        most, steps = (DIRECT_DRIFT, DIRECT_STEPS) if self.direct else (MOST_DRIFT, SORT_STEPS)
        limit = min(max(LEAST_DRIFT[self.dimension], steps * motion.pace), most)
        # After a deletion of points the drift is infinite.
        motion.drift_limit = limit if s.frame.moves else np.finfo(float).max
        motion.drift = motion.pace = 0.0
        occupied = [self._sort_block(s, block) for block in s.blocks]
        self.occupied = len(set().union(*(tiles.tolist() for tiles in occupied)))
        self.lay_out(s)
        _empty(s, grid_boxes.without(before, grid_boxes.used(s.spans)[1:]))
        self.sorts += 1

    def _reach(self, s: Setup, block: Block, x: np.ndarray) -> float:
        """Bound the distance in cells from `x` to its nodes; valid until the next sort."""
        far = 0.0
        if len(x) > self.dimension:
            at = OnGrids(s.basis, s.kin, s.grids, block.points.grid, x)
            far = sorting.widest(at)
        cells = float(self._cells.max())
        rounding = ROUNDING + 4 * np.finfo(x.dtype).eps * cells
        drift = s.control.motion[0].drift_limit + rounding if s.frame.moves else 0.0
        beyond = far + drift + grid_boxes.beyond(s.contact)
        return beyond if far < cells else cells  # also if far is NaN

    def _where(self, s: Setup, points: Points) -> np.ndarray:
        return points.x[s.control.motion[0].now] if points.home is None else points.home

    def tiles_of(self, s: Setup, points: Points) -> np.ndarray:
        x, ends = self._where(s, points), np.empty((self.threads, self.count), np.int64)
        tile = np.empty(x.shape[1], np.int64)
        at = OnGrids((), planar(s.kin), s.grids, points.grid, x)
        sorting.find_tiles(self.mode, len(ends), at, self._cut, ends, tile)
        return tile

    def _sort_block(self, s: Setup, block: Block) -> np.ndarray:
        points, tiling = block.points, block.tiling
        x = self._where(s, points)
        reach = self._reach(s, block, x)
        # Use several parts per thread, as tiles differ in size. With few points use one part: the
        # first thread would finish before the other threads start.
        n, mode = x.shape[1], self.mode
        parts = min(4 * self.threads, n // PART, 4 * n // self.count)
        if self.threads == 1 or parts < 2:
            parts, mode = 1, Serial()
        result = sorting.SortedOrder(
            width=lanes_for(8 * x.itemsize).width,
            ends=np.empty((parts, self.count), np.int64),
            share=np.empty(parts + 1, np.int64),
            boxes=np.empty((2, self.count, self.dimension), np.int64),
            bins=np.empty((parts, 2, self.size.prod()), np.int32),
            order=np.empty(n, np.int64),
            tile=np.empty(n, np.int64),
            room=np.empty((2, n), np.int64),
        )
        top, least = self._nodes - 1, self.least_nodes - 1
        offset = float(first_node(s.basis, s.grids.h[0]))
        around = sorting.Neighbourhood(top, self.per_cell, self.beyond, least, reach, offset)
        at = OnGrids((), planar(s.kin), s.grids, points.grid, x)
        by = sorting.SortKeys(self._cut, around, points.id)
        rows = addresses_of_rows(array for _, array in arrays_of(points))
        sorting.sort_points(mode, at, by, result, rows)
        ends = result.ends[-1]
        begins = np.append(0, ends[:-1])
        occupied = np.flatnonzero(ends > begins)
        count = len(occupied)
        shares = 1 if self.direct else SHARES
        tiling.count[:2] = count, shares
        tiling.number[:count] = occupied
        tiling.range[:count] = np.stack([begins[occupied], ends[occupied]], axis=1)
        tiling.share[:] = shares_of(tiling.range[:count], shares, len(tiling.share))
        tiling.grid[:count] = np.searchsorted(self.first, occupied, side="right") - 1
        tiling.box[:count] = np.concatenate(result.boxes[:, occupied], axis=1)
        if self._most_in_box:
            sorting.find_rows(mode, parts, at, around, tiling, parts)
        return occupied

    def box_bytes(self, s: Setup) -> int:
        if self.direct:
            return 0
        summed_arrays = [
            array for one in grid_boxes.buffers_of(s) for array in grid_boxes.summed(one.nodes)
        ]
        return self.rows * sum(array.itemsize * array.shape[1] for array in summed_arrays)

    def lay_out(self, s: Setup) -> None:
        spans, *parts = self._rows_to_clear(s) if self.direct else self._parts_to_sum(s)
        s.buffers.count[:] = len(parts[1]) - 1, self.direct
        spans = np.concatenate([[[len(spans), 0]], spans])
        for room, rows in zip((s.spans, s.ranges, *s.buffers[2:4]), (spans, *parts), strict=True):
            grid_boxes.grow(room, len(rows))
            room[: len(rows)] = rows

    def _rows_to_clear(self, s: Setup) -> tuple[np.ndarray, ...]:
        """Divide nodes as `_parts_to_sum` does, but into one set, with a part per span."""
        boxes = Tiles._boxes(self, s)
        steps = self._steps[boxes.grid]
        self._tell_buffers(s, 0, 0, self._first_node[boxes.grid], steps)
        spans = grid_boxes.joined_spans(self._parts(boxes.grid, boxes.lo, boxes.hi, 0, steps))
        parts = np.ones((len(spans), 10), np.int64)
        parts[:, 0], parts[:, 4] = spans[:, 0], spans[:, 1] - spans[:, 0]
        parts[:, 9] = CLEAR
        ranges = grid_boxes.ranges_of_shares(spans, np.zeros(len(spans), np.int64), 1)
        return spans, ranges, np.array([0, len(spans)]), parts

    def _parts_to_sum(self, s: Setup) -> tuple[np.ndarray, ...]:
        """Return spans and ranges of the nodes that boxes reach, and the parts to sum.

        The sets of nodes are ordered like the sets of points, and each node belongs to the set from
        which most of its sums come, so that a thread finds these in its own caches. Fetching them
        from other caches takes longer than summing.
        """
        boxes, reached = self._reached(self._boxes(s))
        first, steps = self._number(s, boxes)
        order = np.lexsort((boxes.order[reached.box], -reached.size, reached.tile))
        shares = self._shares(s)
        local = order[reached.box[order] < len(shares)][::-1]  # assigned last: the largest
        beside = self._beside(reached.tile, boxes.grid[reached.box])
        owner = np.zeros(self._first_of_nodes[-1], np.int64)
        owner[beside[local]] = shares[reached.box[local]]
        owner = owner[beside]
        order = order[np.argsort(owner[order], kind="stable")]
        box, tile, begin, end, _ = (array[order] for array in reached)
        starts = np.flatnonzero(np.diff(tile, prepend=-1))
        grid = boxes.grid[box]
        own_begin, own_end = grid_boxes.extents(starts, begin, end)
        more = ((begin[starts] != own_begin) | (end[starts] != own_end)).any(axis=1)
        parts = self._parts(grid, begin, end, first[box], steps[box])
        parts[:, 9] = ADD
        parts[starts[~more], 9] = TAKE
        local = self._parts(grid[starts], own_begin, own_end, 0, 0)
        parts = np.insert(parts, starts[more], local[more], axis=0)
        self._see_nodes(tile[starts], grid[starts], own_begin, own_end)
        owner = _evenly(local, beside[order][starts])
        firsts = np.append(starts + np.cumsum(more) - more, len(parts))
        rows = np.stack(grid_boxes.rows_of(local), axis=1)
        ranges = grid_boxes.ranges_of_shares(
            rows, np.repeat(owner, local[:, 2] * local[:, 3]), SHARES
        )
        firsts = firsts[np.searchsorted(owner, np.arange(SHARES + 1))]
        return grid_boxes.joined_spans(local), ranges, firsts, parts

    def _beside(self, tile: np.ndarray, grid: np.ndarray) -> np.ndarray:
        """Return, for each tile of nodes (n,), the first tile that must be in the same set.

        Access with gaps of some thousand bytes takes twice as long. Therefore a single thread has
        one set, and if tiles are long, tiles in the same rows of nodes are in one set.
        """
        if self.threads == 1:
            return np.zeros_like(tile)
        if not self.long:
            return tile
        first, along = self._first_of_nodes[grid], self._tile_steps[grid, -2]
        return tile - (tile - first) % along

    def _shares(self, s: Setup) -> np.ndarray:
        sets = []
        for block in s.blocks:
            tiles, shares, _ = block.tiling.count
            share = np.empty(tiles, np.int64)
            sizes = np.diff(block.tiling.share[: shares + 1])
            share[block.tiling.order[:tiles]] = np.repeat(np.arange(shares) % SHARES, sizes)
            sets.append(share)
        return np.concatenate(sets)

    def _boxes(self, s: Setup) -> grid_boxes.Boxes:
        d, tilings = self.dimension, [block.tiling for block in s.blocks]
        grid = np.concatenate([one.grid[: one.count[0]] for one in tilings])
        box = np.concatenate([one.box[: one.count[0]] for one in tilings])
        rows = np.concatenate([one.rows[: one.count[0]] for one in tilings])
        return grid_boxes.Boxes(np.arange(len(box)), grid, box[:, :d], box[:, d:], rows)

    def _reached(self, boxes: grid_boxes.Boxes) -> tuple[grid_boxes.Boxes, grid_boxes.Reached]:
        size = self.node_size
        low = boxes.lo // size
        across = boxes.hi // size - low + 1
        box, left = grid_boxes.ragged(np.prod(across, axis=1))
        places = low[box] + left[:, None] // grid_boxes.steps_of(across)[box] % across[box]
        grid = boxes.grid[box]
        tile = self._first_of_nodes[grid] + (places * self._tile_steps[grid]).sum(axis=1)
        begin = np.maximum(places * size, boxes.lo[box])
        end = np.minimum(places * size + size - 1, boxes.hi[box])
        if self._most_in_box:
            from_corner = places[:, :2] - boxes.lo[box, :2]
            row = from_corner[:, 0] * (boxes.hi - boxes.lo + 1)[box, 1] + from_corner[:, 1]
            first, last = (boxes.lo[box, 2:] + boxes.rows[box, row]).T
            begin[:, 2] = np.maximum(begin[:, 2], first)
            end[:, 2] = np.minimum(end[:, 2], last)
            some = begin[:, 2] <= end[:, 2]
            box, tile, begin, end = box[some], tile[some], begin[some], end[some]
        return boxes, grid_boxes.Reached(box, tile, begin, end, np.prod(end - begin + 1, axis=1))

    def _number(self, s: Setup, boxes: grid_boxes.Boxes) -> tuple[np.ndarray, ...]:
        """Assign buffer rows to boxes: return the row of node 0, and strides (k, d)."""
        steps = grid_boxes.steps_of(boxes.hi - boxes.lo + 1)
        ends = np.cumsum(np.prod(boxes.hi - boxes.lo + 1, axis=1))
        begins = np.concatenate([[0], ends])[:-1]
        first = begins - (boxes.lo * steps).sum(axis=1)
        self._tell_buffers(s, begins, ends, first, steps)
        self.rows = int(ends[-1]) if len(ends) else 0
        if self.rows > MAX_NODES:
            raise MemoryError(f"tiles of points would need {self.rows} records of nodes")
        for one in grid_boxes.buffers_of(s):
            for array in grid_boxes.summed(one.nodes):
                grid_boxes.grow(array, self.rows)
        return first, steps

    def _tell_buffers(self, s: Setup, begins, ends, first, steps) -> None:
        columns = np.zeros((len(first), 5), np.int64)
        columns[:, 0], columns[:, 1], columns[:, 2] = begins, ends, first
        columns[:, 3 : 2 + self.dimension] = steps[:, :-1]
        done = 0
        for block in s.blocks:
            count = block.tiling.count[0]
            block.tiling.buffer[:count] = columns[done : done + count]
            done += count

    def _see_nodes(
        self, tiles: np.ndarray, grid: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> None:
        """Record tiles of nodes in use, and their nodes from `begin` to `end`."""

    def _parts(self, grid, begin, end, first, steps) -> np.ndarray:
        """Return `Buffers.parts` of the nodes (k, d) from `begin` to `end` of grids.

        The row of a node in its box is `first` + sum of `steps` (k, d) times indices.
        """
        d = self.dimension
        parts = np.ones((len(grid), 10), np.int64)
        parts[:, 9] = CLEAR
        parts[:, 0] = self._first_node[grid] + (begin * self._steps[grid]).sum(axis=1)
        parts[:, 1] = first + (begin * steps).sum(axis=1)
        parts[:, 5 - d : 5] = end - begin + 1
        parts[:, 8 - d : 7] = self._steps[grid][:, :-1]
        parts[:, 10 - d : 9] = np.broadcast_to(steps, begin.shape)[:, :-1]
        return parts


class HasSetup(Protocol):
    setup: Setup


class WholeDomain:
    parted = False

    def __init__(self, simulation: HasSetup):
        self.simulation = simulation

    def migrate(self, s: Setup) -> Setup:
        return s

    def share_memory(self) -> None:
        """Send contact memory and stored fields of the nodes to all processes."""

    def share_kept(self) -> None:
        """Send the stored fields of the nodes to all processes."""

    def counted(self) -> np.ndarray:
        return grid_boxes.numbers(self.simulation.setup.spans)

    def act(self, function: Callable[[Setup], None], s: Setup) -> None:
        function(s)

    def begin(self, hooks: Hooks | NoHooks, *, from_python: bool) -> None:
        """Prepare for the next steps."""

    def end(self) -> None:
        """Complete the last steps."""

    def state(self) -> dict[str, np.ndarray]:
        return {}

    def own_part(self, state: Mapping[str, Any]) -> Mapping[str, Any]:
        return state


def _empty(s: Setup, spans: np.ndarray) -> None:
    of = [s.nodes] + ([s.heat.nodes] if isinstance(s.heat, Conducting) else [])
    arrays = [array for nodes in of for array in grid_boxes.read_beside(nodes)]
    for begin, end in spans.tolist():
        for array in arrays:
            array[begin:end] = 0


def _evenly(parts: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return the set, from 0 to SHARES - 1, of each of n tiles of nodes: ascending (n,).

    `parts` (n, 10) are the used nodes of each tile (see `Buffers`). All sets have about the same
    number of nodes. Consecutive tiles with equal `beside` (n,) are in the set of the first of these
    tiles.
    """
    size = np.prod(parts[:, 2:5], axis=1)
    middle = np.cumsum(size) - size / 2
    firsts = np.diff(beside, prepend=-1) != 0
    share = (middle[firsts] * (SHARES / max(size.sum(), 1))).astype(np.int64)
    return share[np.cumsum(firsts) - 1]


def in_use(tiling: Tiling) -> list[tuple[str, int]]:
    tiles = tiling.count[0]
    whole = [(name, len(getattr(tiling, name))) for name in ("count", "share")]
    return [*whole, *((name, tiles) for name in ("range", "grid", "number", "box", "rows"))]


def shares_of(ranges: np.ndarray, shares: int, size: int) -> np.ndarray:
    """Return the first tiles (size,) of nearly equal sets of tiles with point ranges (T, 2)."""
    out = np.zeros(size, np.int64)
    out[shares] = len(ranges)
    if shares > 1:
        parts = np.arange(1, shares) * ranges[:, 1].max(initial=0) / shares
        out[1:shares] = np.searchsorted(ranges.sum(axis=1) / 2, parts)
    return out


def one_after_another(ranges: np.ndarray) -> np.ndarray:
    """Shift ranges (k, 2) so that each begins where the previous one ends."""
    ends = np.cumsum(ranges[:, 1] - ranges[:, 0])
    return np.stack([np.append(0, ends)[:-1], ends], axis=1)
