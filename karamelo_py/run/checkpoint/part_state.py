"""State for a restart file, from the parts of all processes, so many points at a time."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.kernels.arrays import Tiling, arrays_of
from karamelo_py.output.fields import PIECE
from karamelo_py.run.boxes import between, numbers
from karamelo_py.run.checkpoint.arrays import (
    Stored,
    changing,
    in_file,
    known,
    of_nodes,
    take_tiling,
    touched,
    wholes,
)
from karamelo_py.run.mpi.pack import by_tile, join_tilings, share_of_tiling, stripped
from karamelo_py.run.mpi.partition import work_of
from karamelo_py.run.tiles import SHARES, Tiles, in_use


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


def stored(simulation: Any, kept: dict[str, np.ndarray] | None = None) -> Iterator[Stored]:
    """Yield the arrays of a file, with the bits and in the order of one process, at the first.

    They are those of the present state, or of the one that each process has `kept`.
    """
    s, comm, tiles = simulation.setup, simulation.comm, simulation.tiles
    own = kept or dict(changing(simulation)) | touched(simulation)
    parts = comm.gather(
        {
            "tiling": [stripped(own, f"tiling/{k}/") for k in range(len(s.blocks))],
            "reached": tiles.reached_by(s), "work": own["work"].copy(),
            "touched": stripped(own, "touched/"),
        }
    )  # fmt: skip
    tilings, rows = [Tiles.empty_tiling(tiles) for _ in s.blocks], {}  # as of one process
    for k, tiling in enumerate(tilings if parts is not None else ()):
        tiling.count[1] = 1 if tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        rows |= {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
    if parts is not None:
        work = sum(part["work"] for part in parts)
        yield from in_file(rows | {"clock": own["clock"], "work": work})
    for k, tiling in enumerate(tilings):
        yield from _points(simulation, k, tiling, own)
    if kept:
        yield from wholes({"values": own["values"]})
    if found := [part["touched"] for part in parts or () if part["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in found]), True)
        rows = np.concatenate([of["rows"] for of in found])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": rows})
    if not kept:
        yield from wholes(known(simulation))
        yield from _nodes(
            simulation, comm.bcast(parts and tiles.spans_of_all(part["reached"] for part in parts))
        )


def _points(
    simulation: Any, k: int, tiling: Tiling, own: dict[str, np.ndarray]
) -> Iterator[Stored]:
    """Yield the points of a block, tile after tile."""
    comm = simulation.comm
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    limits = [
        (int(number[first]), int(number[end - 1]) + 1) if total else None
        for first, end in _cuts(ends)
    ]
    names = [name for name, _ in arrays_of(simulation.setup.blocks[k].points)]
    arrays = [own[f"points/{k}/{name}"] for name in names]
    begin = 0
    for of_piece in comm.bcast(limits):
        if of_piece is not None:
            found = comm.gather(points_of_tiles(stripped(own, f"tiling/{k}/"), arrays, *of_piece))
        else:  # not sorted yet: each has those of an equal share of the ids
            found = comm.gather({"points": arrays})
        if found is None:
            continue
        total = total or sum(part["points"][0].shape[-1] for part in found)
        order = np.arange(total) if of_piece is None else by_tile(found)
        for name, *same in zip(names, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _nodes(simulation: Any, spans: np.ndarray) -> Iterator[Stored]:
    """Yield rows of the arrays of nodes, of nodes in use."""
    kinds, counted = dict(of_nodes(simulation.setup)), simulation.counted()
    total = int((spans[:, 1] - spans[:, 0]).sum())
    for own, nodes in _pieces(spans):
        limits = (int(nodes[0]), int(nodes[-1]) + 1) if len(nodes) else (0, 0)
        here = counted[slice(*np.searchsorted(counted, limits))]
        found = simulation.comm.gather((here, [array[here] for array in kinds.values()]))
        if found is None:
            continue
        rows = {n: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for n, a in kinds.items()}
        for there, some in found:
            for array, of in zip(rows.values(), some, strict=True):
                array[np.searchsorted(nodes, there)] = of
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


def own_share(simulation: Any, state: Mapping) -> dict[str, np.ndarray]:
    """Read the state in a file as far as it is of this process, of tiles that are cut for it."""
    blocks, comm, tiles = simulation.setup.blocks, simulation.comm, simulation.tiles
    tilings = [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(len(blocks))]
    whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
    before = tiles.owner
    tiles.share_out(work_of(tiles.loads(whole), simulation.subdomain.load.costs))
    owner, tiles.owner = tiles.owner, before
    found = {n: state[n][()] for n in state if n in ALL_HAVE or n.startswith("touched/")}
    if not comm.leads:
        found["work"] = np.zeros_like(found["work"])
    for k, tiling in enumerate(tilings):
        points, of_tiles = share_of_tiling(k, tiling, owner == comm.rank)
        if not tiling.count[0]:  # not sorted yet: an equal share
            count = state[f"points/{k}/id"].size
            points = np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)
        names = [f"points/{k}/{name}" for name, _ in arrays_of(blocks[k].points)]
        found |= of_tiles | {name: _chosen(state[name], points) for name in names}
    return found | {"owner": owner}


def _chosen(array: Any, points: np.ndarray) -> np.ndarray:
    """Some points (ascending) of an array in a file, of which so many are read at a time."""
    found = rows_of_points((*array.shape[:-1], len(points)), array.dtype)
    for begin in range(0, array.shape[-1], PIECE):
        own = slice(*np.searchsorted(points, (begin, begin + PIECE)))
        if own.start < own.stop:
            found[..., own] = array[..., begin : begin + PIECE][..., points[own] - begin]
    return found


def take_nodes(simulation: Any, state: Mapping) -> None:
    """Let the nodes in use here show what they did; all processes come to it."""
    s, tiles = simulation.setup, simulation.tiles
    reached = simulation.comm.allgather(tiles.reached_by(s))
    used = np.zeros(len(tiles.foreign), np.bool_)
    used[numbers(s.spans)] = True
    for own, nodes in _pieces(tiles.spans_of_all(reached)):
        here = used[nodes]
        for name, array in of_nodes(s):
            array[nodes[here]] = state[name][own][here]
