"""Division of tiles among processes, and messages between the processes.

If several processes reach a node, each of them computes the whole sum there, in the same order.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.fields import field, length_of_rows, rows_of_points, some_points
from karamelo_py.kernels.arrays import Block, Points, Setup, Tag, Tiling, arrays_of, made_of
from karamelo_py.kernels.equations.corrected_acceleration import Acceleration
from karamelo_py.run.boxes import (
    Boxes,
    Reached,
    between,
    beyond,
    buffers_of,
    chosen_of,
    extents,
    give_up,
    ragged,
    rows_of,
    steps_of,
    unique,
)
from karamelo_py.run.tiles import SHARES, Tiles, one_after_another, shares_of
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.lattice import Lattice


def bisected(places: np.ndarray, work: np.ndarray, parts: int, rows: float = 1) -> np.ndarray:
    """Divide tiles by recursive bisection across the longest direction; return the part (T,).

    After Berger & Bokhari (1987), "A partitioning strategy for nonuniform problems on
    multiprocessors", IEEE Transactions on Computers C-36, 570-580. If a layer of tiles must be
    divided, it is cut across the next longest direction. `places` (T, d) are lower corners, `work`
    (T,) integers; tiles without work belong to any part. The last direction is cut only if it is
    `rows` times as long as each other direction.
    """
    d = places.shape[1]
    least = np.append(np.ones(d - 1), rows)
    part = np.zeros(len(work), np.int64)
    left = [(np.arange(len(work)), 0, parts)]
    while left:
        tiles, first, count = left.pop()
        if count == 1:
            part[tiles] = first
            continue
        busy = places[tiles[work[tiles] > 0]]
        lengths = np.ptp(busy, axis=0) if len(busy) else np.ones(d)
        # Of equally long directions, prefer the one with the largest stride in memory.
        long = np.argsort(-lengths / least, kind="stable")[::-1]
        tiles = tiles[np.lexsort([places[tiles, k] for k in long])]
        ends = np.cumsum(work[tiles])
        half = count // 2
        cut = np.searchsorted(ends - 0.5 * work[tiles], ends[-1:].sum() * (half / count))
        left += [(tiles[:cut], first, half), (tiles[cut:], first + half, count - half)]
    return part


IMBALANCE = 1.1  # factor by which a new division must reduce the largest work
# Short rows make loops slow: long tiles are cut along rows only if longer there by this factor.
ROWS = 4
OF_TILES = ("number", "range", "grid", "box", "rows")
FINE = 1000  # the cost of a tile is an integer, in this fraction of a unit


class Needs(NamedTuple):
    tile: np.ndarray  # (k,) number of the tile, ascending
    lo: np.ndarray  # (k, d) first nodes
    hi: np.ndarray  # (k, d) last nodes

    def among(self, tile: np.ndarray, begin: np.ndarray, end: np.ndarray) -> tuple:
        """Return overlaps with boxes (m, d) in tiles (m,): indices, first nodes, last nodes."""
        at = np.minimum(np.searchsorted(self.tile, tile), len(self.tile) - 1)
        low, high = np.maximum(begin, self.lo[at]), np.minimum(end, self.hi[at])
        which = np.flatnonzero((self.tile[at] == tile) & (low <= high).all(axis=1))
        return which, low[which], high[which]


class SharedTiles(Tiles):
    def __init__(
        self,
        comm: SerialComm,
        lattices: Sequence[Lattice],
        basis: Tag,
        points: int,
        sparse: bool,
        *,
        one_space: bool,
    ):
        super().__init__(lattices, basis, points, sparse)
        self.comm = comm
        self.one_space = one_space  # whether bodies in contact have nodes at the same positions
        self._places = np.concatenate(
            [
                one.lo[: self.dimension] + one.h * self.size * np.argwhere(np.ones(shape, bool))
                for one, shape in zip(lattices, self.shapes, strict=True)
            ]
        )
        self.owner = np.zeros(self.count, np.int64)
        # Memory of points, by block and field; unused memory, by shape and type.
        self._rooms: dict[tuple[int, str], np.ndarray] = {}
        self._spare: dict[tuple, np.ndarray] = {}
        self.foreign = np.zeros(int(self._first_node[-1] + self._nodes[-1].prod()), np.uint8)
        self._marked = np.empty(0, np.int64)
        self.sent: dict[int, np.ndarray] = {}  # rows of the buffers, by rank
        self._taken: dict[int, slice] = {}
        self._links: dict[tuple[int, int], tuple[list, Any]] = {}
        self._from = np.empty(0, np.int64)  # rank of each box of another process

    def share_out(self, work: np.ndarray) -> None:
        if not self.direct:
            self.owner = bisected(self._places, work, self.comm.size, ROWS if self.long else 1)

    def balance(self, work: np.ndarray) -> bool:
        before, work = self.owner, self.comm.allreduce(work)

        def largest() -> float:
            return np.bincount(self.owner, work, self.comm.size).max()

        now = largest()
        self.share_out(work)
        if now <= IMBALANCE * largest():
            self.owner = before
        return self.owner is not before

    def loads(self, blocks: Sequence[Block]) -> np.ndarray:
        counts = np.zeros((len(blocks) + 1, self.count), np.int64)
        for row, block in zip(counts, blocks, strict=False):
            tiles, points = occupied(block.tiling)
            row[tiles] = points
            counts[-1, tiles] += nodes_of(block.tiling)
        return counts

    def partners(self, going: np.ndarray) -> list[int]:
        going[self.comm.rank] = 0
        return np.flatnonzero(going + self.comm.alltoall(going)).tolist()

    def migrate(self, s: Setup, costs: np.ndarray) -> Setup:
        tiles = [self.tiles_of(s, block.points) for block in s.blocks]
        # Use the nodes in reach at the last sort.
        loads = self.loads(s.blocks)
        loads[:-1] = [np.bincount(of, minlength=self.count) for of in tiles]
        self.balance(work_of(loads, costs))
        owners, me = [self.owner[of] for of in tiles], self.comm.rank
        others = self.partners(sum(np.bincount(to, minlength=self.comm.size) for to in owners))

        def parts(rank: int) -> list[list[np.ndarray]]:
            return [
                # np.compress makes contiguous arrays.
                [np.compress(to == rank, array, axis=-1) for _, array in arrays_of(block.points)]
                for block, to in zip(s.blocks, owners, strict=True)
            ]

        come = list(self.comm.exchange({rank: parts(rank) for rank in others}).values())
        if not come:
            return s
        blocks = tuple(
            block._replace(points=self._with(k, block.points, np.flatnonzero(to == me), parts))
            for k, (block, to, *parts) in enumerate(zip(s.blocks, owners, *come, strict=True))
        )
        return s._replace(blocks=blocks)

    def _with(self, k: int, points: Points, stay: np.ndarray, come: list[list]) -> Points:
        """Join points that stay and points that arrive, in the memory of the last sort."""
        count = len(stay) + sum(parts[0].shape[-1] for parts in come)
        # Allocating new memory would take longer than the rest of a sort.
        arrays = []
        for i, (name, old) in enumerate(arrays_of(points)):
            new = [parts[i] for parts in come]
            shape = (*old.shape[:-1], count)
            kind, size = (shape[:-1], old.dtype), length_of_rows(shape, old.dtype)
            room = self._spare.pop(kind, np.empty(0, old.dtype))
            if room.size < size:
                room = np.empty(size + size // 8, old.dtype)
            array = rows_of_points(shape, old.dtype, room)
            for c in np.ndindex(shape[:-1]):
                np.take(old[c], stay, out=array[c][: len(stay)], mode="clip")
                array[c][len(stay) :] = np.concatenate([columns[c] for columns in new])
            if (k, name) in self._rooms:
                self._spare[kind] = self._rooms[k, name]
            self._rooms[k, name] = room
            arrays.append(array)
            give_up(old)  # frees the array, so that only one field has two copies at a time
            for parts in come:
                parts[i] = None
        return made_of(points, arrays)

    def _reach(self, s: Setup, block: Block, x: np.ndarray) -> float:
        return float(self.comm.allreduce_max(np.array([super()._reach(s, block, x)]))[0])

    def _boxes(self, s: Setup) -> Boxes:
        local, me = self.own_boxes(s), self.comm.rank
        self._looks_beyond = beyond(s.contact) > 0
        corrected = field(s.nodes.fields, Acceleration) is not None
        self._margin = int(corrected and not self._looks_beyond)
        of_all = {me: local, **dict(enumerate(self.comm.allgather(local)))}
        if len(local.grid):
            low = local.lo.min(axis=0) - self._margin
            high = local.hi.max(axis=0) + self._margin
            for rank, boxes in of_all.items():
                near = ((boxes.lo <= high) & (boxes.hi >= low)).all(axis=1)
                of_all[rank] = Boxes(*(array[near] for array in boxes))
        self._of = np.repeat(list(of_all), [len(boxes.grid) for boxes in of_all.values()])
        return Boxes(*(np.concatenate(same) for same in zip(*of_all.values(), strict=True)))

    def empty_tiling(self) -> Tiling:
        return super().empty_tiling()._replace(share=np.zeros(2 * SHARES + 1, np.int64))

    def lay_out(self, s: Setup) -> None:
        for _, link in self._links.values():
            self.comm.disconnect(link)
        self._links.clear()
        super().lay_out(s)

    def _shares(self, s: Setup) -> np.ndarray:
        self._border_first(s)
        return super()._shares(s)

    def _border_first(self, s: Setup) -> None:
        awaited = np.zeros(len(self._of), bool)
        for box, _, _ in self._passed.values():
            awaited[box] = True
        begin = 0
        for block in s.blocks:
            tiling = block.tiling
            waiting = awaited[begin : begin + tiling.count[0]]
            begin += tiling.count[0]
            border = np.count_nonzero(waiting)
            order = np.argsort(~waiting, kind="stable")
            tiling.order[: len(order)] = order
            tiling.count[1:] = 2 * SHARES, SHARES
            for k, tiles in enumerate((order[:border], order[border:])):
                ranges = one_after_another(tiling.range[tiles])
                share = k * border + shares_of(ranges, SHARES, SHARES + 1)
                tiling.share[k * SHARES : (k + 1) * SHARES + 1] = share

    def own_boxes(self, s: Setup) -> Boxes:
        order = [k * self.count + occupied(block.tiling)[0] for k, block in enumerate(s.blocks)]
        return super()._boxes(s)._replace(order=np.concatenate(order))

    def _tile_of_domain(self, tile: np.ndarray) -> np.ndarray:
        return tile % int(self._first_of_nodes[1]) if self.one_space else tile

    def _reached(self, boxes: Boxes) -> tuple[Boxes, Reached]:
        _, reached = super()._reached(boxes)
        of, tile = self._of[reached.box], self._tile_of_domain(reached.tile)
        me = self.comm.rank
        self._needs = self._uses = self._by_rank(reached)
        if self._margin:
            self._needs = self._by_rank(super()._reached(self._widened(boxes))[1])
        self._inner = self._inner_boxes(boxes) if self._looks_beyond else {}
        local, others = np.flatnonzero(of == me), np.flatnonzero(of != me)
        self._passed, self._from = {}, of[:0]
        if not len(local):
            return Boxes(*(array[:0] for array in boxes)), Reached(*(a[local] for a in reached))
        for rank, needs in self._needs.items():
            if rank != me:
                which, low, high = needs.among(
                    tile[local], reached.begin[local], reached.end[local]
                )
                self._passed[rank] = reached.box[local][which], low, high
        which, low, high = self._needs[me].among(
            tile[others], reached.begin[others], reached.end[others]
        )
        pieces = others[which]
        self._from, box = of[pieces], reached.box[pieces]
        more = Boxes(boxes.order[box], boxes.grid[box], low, high, boxes.rows[box])
        count = np.count_nonzero(self._of == me)
        result = Reached(*(array[np.append(local, pieces)] for array in reached))
        result.box[len(local) :] = count + np.arange(len(pieces))
        result.begin[len(local) :], result.end[len(local) :] = low, high
        return Boxes(
            *(np.append(a[:count], b, axis=0) for a, b in zip(boxes, more, strict=True))
        ), result

    def _by_rank(self, reached: Reached) -> dict[int, Needs]:
        of, tile = self._of[reached.box], self._tile_of_domain(reached.tile)
        return {
            int(rank): _needs(tile[here], reached.begin[here], reached.end[here])
            for rank in unique(of)
            for here in [of == rank]
        }

    def _widened(self, boxes: Boxes) -> Boxes:
        lo = np.maximum(boxes.lo - 1, 0)
        hi = np.minimum(boxes.hi + 1, self._nodes[boxes.grid] - 1)
        shape = hi - lo + 1
        rows = np.zeros((len(lo), int(shape[:, :-1].prod(axis=1).max(initial=0)), 2), np.int64)
        rows[:, :, 1] = shape[:, -1:] - 1
        return boxes._replace(lo=lo, hi=hi, rows=rows)

    def _inner_boxes(self, boxes: Boxes) -> dict[int, tuple]:
        low = np.where(boxes.lo > 0, boxes.lo + 1, 0)
        end = self._nodes[boxes.grid] - 1
        high = np.where(boxes.hi < end, boxes.hi - 1, end)
        return {
            int(rank): (boxes.grid[here], low[here], high[here])
            for rank in unique(self._of)
            for here in [self._of == rank]
        }

    def _number(self, s: Setup, boxes: Boxes) -> tuple[np.ndarray, ...]:
        first, steps = super()._number(s, boxes)
        self.sent = {
            rank: _rows(low, high, first[which], steps[which])
            for rank, (which, low, high) in self._passed.items()
            if len(which)  # boxes may overlap without a common node
        }
        ends = np.append(0, np.cumsum(np.prod(boxes.hi - boxes.lo + 1, axis=1)))
        local = len(ends) - 1 - len(self._from)
        self._taken = {}
        for rank in unique(self._from):
            begin, end = np.searchsorted(self._from, [rank, rank + 1])
            self._taken[int(rank)] = slice(int(ends[local + begin]), int(ends[local + end]))
        return first, steps

    def _see_nodes(
        self, tiles: np.ndarray, grid: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> None:
        # The first process that uses a node counts it.
        self.foreign[self._marked] = 0
        nodes, me = [self._marked[:0]], self.comm.rank
        if self._looks_beyond:
            nodes.append(self._unknown(between(*rows_of(self._parts(grid, begin, end, 0, 0)))))
        else:
            for rank, needs in self._uses.items():
                if rank < me:
                    which, low, high = needs.among(self._tile_of_domain(tiles), begin, end)
                    nodes.append(between(*rows_of(self._parts(grid[which], low, high, 0, 0))))
        if self._margin and me in self._uses:
            which, low, high = self._uses[me].among(self._tile_of_domain(tiles), begin, end)
            local = between(*rows_of(self._parts(grid[which], low, high, 0, 0)))
            every = between(*rows_of(self._parts(grid, begin, end, 0, 0)))
            nodes.append(every[~np.isin(every, local)])
        self._marked = np.concatenate(nodes)
        self.foreign[self._marked] = 1

    def _unknown(self, nodes: np.ndarray) -> np.ndarray:
        count = int(self._nodes[0].prod()) if self.one_space else len(self.foreign)
        number = nodes % count
        for rank, boxes in sorted(self._inner.items()):
            seen = np.isin(number, between(*rows_of(self._parts(*boxes, 0, 0))) % count)
            if rank == self.comm.rank:
                return nodes[~seen]
            number = np.where(seen, -1, number)
        return nodes

    def give(self, s: Setup, number: int, kinds: int) -> None:
        link = self._links.get((number, kinds))
        if link is None:
            of = next(one for one in buffers_of(s) if one.number == number)
            link = self._link(chosen_of(of.nodes, kinds))
            self._links[number, kinds] = link
        packed, self._under_way = link
        for array, rows, room in packed:
            np.take(array, rows, axis=0, out=room, mode="clip")
        self.comm.start(self._under_way)

    def take(self) -> None:
        self.comm.finish(self._under_way)

    def _link(self, arrays: list[np.ndarray]) -> tuple[list, Any]:
        packed, sent, taken = [], [], []
        for array in arrays:
            for rank, rows in self.sent.items():
                room = np.empty((len(rows), array.shape[1]), array.dtype)
                packed.append((array, rows, room))
                sent.append((rank, room))
            taken += [(rank, array[rows]) for rank, rows in self._taken.items()]
        return packed, self.comm.connect(sent, taken)


def work_of(loads: np.ndarray, costs: np.ndarray) -> np.ndarray:
    return np.rint(FINE * (costs @ loads)).astype(np.int64)


def nodes_of(tiling: Tiling) -> np.ndarray:
    count = tiling.count[0]
    if tiling.rows.shape[1]:
        return np.maximum(np.diff(tiling.rows[:count]) + 1, 0).sum(axis=(1, 2), dtype=np.int64)
    lo, hi = np.split(tiling.box[:count], 2, axis=1)
    return np.prod(hi - lo + 1, axis=1)


def occupied(tiling: Tiling) -> tuple[np.ndarray, np.ndarray]:
    count = tiling.count[0]
    return tiling.number[:count], np.diff(tiling.range[:count], axis=1)[:, 0]


def sized(points: Points, count: int) -> Points:
    if points.mass.size == count:
        return points
    shapes = [((*a.shape[:-1], count), a.dtype) for _, a in arrays_of(points)]
    return made_of(points, [rows_of_points(*shape) for shape in shapes])


def _needs(tile: np.ndarray, begin: np.ndarray, end: np.ndarray) -> Needs:
    order = np.argsort(tile, kind="stable")
    starts = np.flatnonzero(np.diff(tile[order], prepend=-1))
    return Needs(tile[order][starts], *extents(starts, begin[order], end[order]))


def _rows(lo: np.ndarray, hi: np.ndarray, first: np.ndarray, steps: np.ndarray) -> np.ndarray:
    shape = hi - lo + 1
    box, left = ragged(np.prod(shape, axis=1))
    inner = steps_of(shape)[box]
    places = lo[box] + left[:, None] // inner % shape[box]
    return first[box] + (places * steps[box]).sum(axis=1)


def share_of(s: Setup, mine: np.ndarray) -> dict[str, np.ndarray]:
    packed: dict[str, np.ndarray] = {}
    for k, block in enumerate(s.blocks):
        points, tiles = share_of_tiling(k, block.tiling, mine)
        arrays = arrays_of(block.points)
        packed |= tiles | {f"points/{k}/{name}": some_points(of, points) for name, of in arrays}
    return packed


def share_of_tiling(
    k: int, tiling: Tiling, mine: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    which = np.flatnonzero(mine[occupied(tiling)[0]])
    ranges = tiling.range[which]
    points = between(*ranges.T)
    rows = {name: getattr(tiling, name)[which] for name in OF_TILES}
    rows["range"] = one_after_another(ranges)
    rows["count"] = np.array([len(which), *tiling.count[1:]])
    rows["share"] = shares_of(rows["range"], int(tiling.count[1]), len(tiling.share))
    return points, {f"tiling/{k}/{name}": array for name, array in rows.items()}


def stripped(arrays: dict[str, np.ndarray], stem: str) -> dict[str, np.ndarray]:
    return {n.removeprefix(stem): array for n, array in arrays.items() if n.startswith(stem)}


def _joint(tilings: list[dict[str, np.ndarray]], name: str) -> np.ndarray:
    return np.concatenate([tiling[name][: tiling["count"][0]] for tiling in tilings])


def by_tile(tilings: list[dict[str, np.ndarray]]) -> np.ndarray:
    ranges = one_after_another(_joint(tilings, "range"))
    return between(*ranges[np.argsort(_joint(tilings, "number"))].T)


def join_tilings(tiling: Tiling, tilings: list[dict[str, np.ndarray]]) -> None:
    order = np.argsort(_joint(tilings, "number"))
    tiling.count[0] = len(order)
    names = [name for name in (*OF_TILES, "report") if name in tilings[0]]
    rows = {name: _joint(tilings, name)[order] for name in names}
    ranges = one_after_another(rows["range"])
    if "report" in rows:
        # Points that failed remain in their tile.
        wrong = rows["report"][:, 2] > 0
        rows["report"][wrong, 2] += (ranges - rows["range"])[wrong, 0]
    for name, array in (rows | {"range": ranges}).items():
        getattr(tiling, name)[: len(order)] = array
    tiling.share[:] = shares_of(ranges, int(tiling.count[1]), len(tiling.share))
