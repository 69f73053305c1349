"""What a file to go on from holds, from the parts of all processes, so many points at a time."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.kernels.arrays import Tiling, arrays_of
from karamelo_py.kernels.totals import carry
from karamelo_py.output.fields import PIECE
from karamelo_py.run.checkpoint.arrays import Stored, known, latest, of_nodes, take_tiling, wholes
from karamelo_py.run.mpi.pack import by_tile, join_tilings, share_of_tiling
from karamelo_py.run.mpi.partition import SharedTiles
from karamelo_py.run.tiles.boxes import between, numbers
from karamelo_py.run.tiles.tiles import SHARES, in_use


def points_of_tiles(
    tiling: dict[str, np.ndarray], arrays: list[np.ndarray], first: int, end: int
) -> dict[str, Any]:
    """Own points in tiles with numbers from `first` to before `end`, and how they lie in them."""
    own = slice(*np.searchsorted(tiling["number"], (first, end)))
    ranges = tiling["range"][own]
    points = slice(ranges[0, 0], ranges[-1, 1]) if len(ranges) else slice(0, 0)
    return {
        "number": tiling["number"][own], "range": ranges, "count": [len(ranges)],
        "points": [array[..., points] for array in arrays],
    }  # fmt: skip


def stored(ranks: Any) -> Iterator[Stored]:
    """The arrays of `state.arrays_by_name`, with the same bits, in the same order."""
    parts = ranks.together("tell_of_tiles")
    yield from _in_tiles(ranks, parts, ranks.control.clock, "give_tiles")
    spans = ranks.part.tiles.spans_of_all(part["reached"] for part in parts)
    if memory := ranks.part.memory():
        yield from _nodes(ranks, spans, {"contact": memory[0]})
    yield from wholes(known(ranks))
    yield from _nodes(ranks, spans, dict(of_nodes(ranks.part.setup)))


def stored_snapshot(ranks: Any) -> Iterator[Stored]:
    """The arrays of `state.stored_copies`, likewise."""
    parts, own = ranks.together("tell_of_kept"), ranks.part.kept
    yield from _in_tiles(ranks, parts, own["clock"], "give_kept")
    yield from wholes({"values": own["values"]})
    if touched := [part["touched"] for part in parts if part["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in touched]), True)
        rows = np.concatenate([of["rows"] for of in touched])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": rows})


def _in_tiles(ranks: Any, parts: list[dict], clock: np.ndarray, give: str) -> Iterator[Stored]:
    """Tiles, clock and work, and the points, which the parts `give` tile after tile."""
    tilings = [ranks.tiles.empty_tiling() for _ in ranks.blocks]
    for k, tiling in enumerate(tilings):
        tiling.count[1] = 1 if ranks.tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        rows = {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
        yield from wholes(rows)
    work = sum(part["work"] for part in parts)
    carry(work)
    yield from wholes({"clock": clock.view(np.ndarray), "work": work})
    for k, tiling in enumerate(tilings):
        yield from _points(ranks, k, tiling, give)


def _points(ranks: Any, k: int, tiling: Tiling, give: str) -> Iterator[Stored]:
    """The points of a block, tile after tile."""
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    names = [name for name, _ in arrays_of(ranks.part.setup.blocks[k].points)]
    begin = 0
    for first, end in _cuts(ends):
        limits = (int(number[first]), int(number[end - 1]) + 1) if total else (0, 0)
        found = ranks.together(give, k, *limits)
        order = by_tile(found)
        for name, *same in zip(names, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _nodes(ranks: Any, spans: np.ndarray, kinds: dict[str, np.ndarray]) -> Iterator[Stored]:
    """Rows of nodes in use: of the arrays of nodes, or what contact remembers of them."""
    memory = "contact" in kinds
    total = int((spans[:, 1] - spans[:, 0]).sum())
    for own, nodes in _pieces(spans):
        rows = {n: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for n, a in kinds.items()}
        limits = (int(nodes[0]), int(nodes[-1]) + 1) if len(nodes) else (0, 0)
        for here, found in ranks.together("give_rows", *limits, memory):
            for array, some in zip(rows.values(), found, strict=True):
                array[np.searchsorted(nodes, here)] = some
        for name, array in rows.items():
            array = latest(array, ranks.step) if memory else array + 0
            yield name, (total, *array.shape[1:]), own, array


def _cuts(ends: np.ndarray) -> Iterator[tuple[int, int]]:
    """From where to where what ends there has some `PIECE` rows."""
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(PIECE, total, PIECE), side="right")
    return pairwise([*np.unique([0, *cuts]).tolist(), len(ends)])


def _pieces(spans: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Nodes in spans, so many at a time: which of all, and their numbers."""
    begin = 0
    for first, end in _cuts(np.cumsum(spans[:, 1] - spans[:, 0])):
        nodes = between(*spans[first:end].T)
        yield slice(begin, begin + len(nodes)), nodes
        begin += len(nodes)


# --- and back -------------------------------------------------------------------------------------


def tilings_of(tiles: SharedTiles, blocks: int, state: Mapping) -> list[Tiling]:
    """The tiles of all points."""
    return [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(blocks)]


def own_share(part: Any, state: Mapping, owner: np.ndarray) -> dict[str, np.ndarray]:
    """Points and tiles of a part, which are its own by the `owner` of each tile."""
    blocks, found = part.setup.blocks, {}
    own = owner == part.crew.rank
    for k, tiling in enumerate(tilings_of(part.tiles, len(blocks), state)):
        points, tiles = share_of_tiling(k, tiling, own)
        names = [f"points/{k}/{name}" for name, _ in arrays_of(blocks[k].points)]
        found |= tiles | {name: _chosen(state[name], points) for name in names}
    return found


def _chosen(array: Any, points: np.ndarray) -> np.ndarray:
    """Some points (ascending) of an array in a file, of which so many are read at a time."""
    found = rows_of_points((*array.shape[:-1], len(points)), array.dtype)
    for begin in range(0, array.shape[-1], PIECE):
        own = slice(*np.searchsorted(points, (begin, begin + PIECE)))
        if own.start < own.stop:
            found[..., own] = array[..., begin : begin + PIECE][..., points[own] - begin]
    return found


def take_nodes(part: Any, state: Mapping, spans: np.ndarray) -> None:
    """Rows of the nodes in use here, and what contact remembers of all nodes."""
    used = np.zeros(len(part.tiles.foreign), np.bool_)
    used[numbers(part.setup.spans)] = True
    memory = part.memory()
    for own, nodes in _pieces(spans):
        here = used[nodes]
        for name, array in of_nodes(part.setup):
            array[nodes[here]] = state[name][own][here]
        for array in memory:
            array[nodes] = state["contact"][own]
