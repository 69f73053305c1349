"""What a file to go on from holds, from the parts of all processes, so many points at a time."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.kernels.arrays import Tiling, arrays_of
from karamelo_py.output.fields import PIECE
from karamelo_py.run.checkpoint.arrays import (
    Stored,
    in_file,
    known,
    of_nodes,
    take_tiling,
    wholes,
)
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


def stored(ranks: Any, *, kept: bool = False) -> Iterator[Stored]:
    """Yield the arrays of a file, with the bits and in the order of one process.

    They are those of the present state, or with `kept` of the one that each process has kept.
    """
    parts, own = ranks.together("tell_of_state", kept), ranks.part.state(kept)
    tilings = [ranks.tiles.empty_tiling() for _ in ranks.blocks]
    rows = {}
    for k, tiling in enumerate(tilings):
        tiling.count[1] = 1 if ranks.tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        rows |= {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
    yield from in_file(rows | {"clock": own["clock"], "work": sum(part["work"] for part in parts)})
    for k, tiling in enumerate(tilings):
        yield from _points(ranks, k, tiling, kept)
    if kept:
        yield from wholes({"values": own["values"]})
    if touched := [part["touched"] for part in parts if part["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in touched]), True)
        rows = np.concatenate([of["rows"] for of in touched])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": rows})
    if not kept:
        yield from wholes(known(ranks))
        yield from _nodes(ranks, ranks.part.tiles.spans_of_all(part["reached"] for part in parts))


def _points(ranks: Any, k: int, tiling: Tiling, kept: bool) -> Iterator[Stored]:
    """Yield the points of a block, tile after tile."""
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    names = [name for name, _ in arrays_of(ranks.part.setup.blocks[k].points)]
    begin = 0
    for first, end in _cuts(ends):
        limits = (int(number[first]), int(number[end - 1]) + 1) if total else (0, 0)
        found = ranks.together("give_points", kept, k, *limits)
        order = by_tile(found)
        for name, *same in zip(names, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _nodes(ranks: Any, spans: np.ndarray) -> Iterator[Stored]:
    """Yield rows of the arrays of nodes, of nodes in use."""
    kinds = dict(of_nodes(ranks.part.setup))
    total = int((spans[:, 1] - spans[:, 0]).sum())
    for own, nodes in _pieces(spans):
        rows = {n: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for n, a in kinds.items()}
        limits = (int(nodes[0]), int(nodes[-1]) + 1) if len(nodes) else (0, 0)
        for here, found in ranks.together("give_rows", *limits):
            for array, some in zip(rows.values(), found, strict=True):
                array[np.searchsorted(nodes, here)] = some
        for name, array in rows.items():
            yield name, (total, *array.shape[1:]), own, array + 0


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


ALL_HAVE = ("clock", "work", "values")

# --- and back -------------------------------------------------------------------------------------


def tilings_of(tiles: SharedTiles, blocks: int, state: Mapping) -> list[Tiling]:
    """The tiles of all points."""
    return [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(blocks)]


def own_share(part: Any, state: Mapping, owner: np.ndarray) -> dict[str, np.ndarray]:
    """Return the state in a file as it is for a part, whose tiles are its own by their `owner`."""
    blocks, own = part.setup.blocks, owner == part.crew.rank
    found = {n: state[n][()] for n in state if n in ALL_HAVE or n.startswith("touched/")}
    if not part.crew.leads:
        found["work"] = np.zeros_like(found["work"])
    for k, tiling in enumerate(tilings_of(part.tiles, len(blocks), state)):
        points, tiles = share_of_tiling(k, tiling, own)
        names = [f"points/{k}/{name}" for name, _ in arrays_of(blocks[k].points)]
        found |= tiles | {name: _chosen(state[name], points) for name in names}
    return found | {"owner": owner}


def _chosen(array: Any, points: np.ndarray) -> np.ndarray:
    """Some points (ascending) of an array in a file, of which so many are read at a time."""
    found = rows_of_points((*array.shape[:-1], len(points)), array.dtype)
    for begin in range(0, array.shape[-1], PIECE):
        own = slice(*np.searchsorted(points, (begin, begin + PIECE)))
        if own.start < own.stop:
            found[..., own] = array[..., begin : begin + PIECE][..., points[own] - begin]
    return found


def take_nodes(part: Any, state: Mapping) -> None:
    """Let the nodes in use here show what they did; all processes come to it."""
    reached = part.crew.everyone(part.tiles.reached_by(part.setup))
    used = np.zeros(len(part.tiles.foreign), np.bool_)
    used[numbers(part.setup.spans)] = True
    for own, nodes in _pieces(part.tiles.spans_of_all(reached)):
        here = used[nodes]
        for name, array in of_nodes(part.setup):
            array[nodes[here]] = state[name][own][here]
