"""What a file to go on from holds, from the parts of all processes, so many points at a time."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.kernels.arrays import Tiling, arrays_of
from karamelo_py.kernels.totals import WORK, carry
from karamelo_py.output.fields import PIECE
from karamelo_py.run.checkpoint.arrays import (
    Stored,
    check_points,
    known,
    latest,
    of_nodes,
    opened,
    take_known,
    take_tiling,
    wholes,
)
from karamelo_py.run.mpi.pack import (
    by_tile,
    join_tilings,
    share_of_tiling,
    stripped,
    tilings_in_use,
)
from karamelo_py.run.mpi.partition import SharedTiles, work_of
from karamelo_py.run.tiles.boxes import between, numbers
from karamelo_py.run.tiles.tiles import SHARES, Tiles, in_use


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


def stored(simulation: Any) -> Iterator[Stored]:
    """Yield the arrays of `arrays.arrays_by_name`, with the same bits and in the same order.

    All processes go through this together; the first gets the arrays.
    """
    s, comm, tiles = simulation.setup, simulation.comm, simulation.tiles
    work, reached = s.control.totals[WORK].copy(), tiles.reached_by(s)
    parts = comm.gather({"tiling": tilings_in_use(s), "reached": reached, "work": work})
    own = [[a for _, a in arrays_of(block.points)] for block in s.blocks]
    yield from _in_tiles(simulation, parts, s.control.clock, tilings_in_use(s), own)
    spans = comm.bcast(parts and tiles.spans_of_all(part["reached"] for part in parts))
    if memory := simulation.subdomain.contact_memory():
        yield from _nodes(simulation, spans, {"contact": memory[0]}, memory)
    yield from wholes(known(simulation))
    kinds = dict(of_nodes(s))
    yield from _nodes(simulation, spans, kinds, list(kinds.values()))


def stored_snapshot(simulation: Any, kept: Mapping[str, np.ndarray]) -> Iterator[Stored]:
    """Yield the arrays of `arrays.stored_copies`, likewise, of what each process has kept."""
    blocks = simulation.setup.blocks
    tilings = [stripped(kept, f"tiling/{k}/") for k in range(len(blocks))]
    touched = stripped(kept, "touched/")
    parts = simulation.comm.gather({"tiling": tilings, "work": kept["work"], "touched": touched})
    own = [
        [kept[f"points/{k}/{name}"] for name, _ in arrays_of(block.points)]
        for k, block in enumerate(blocks)
    ]
    yield from _in_tiles(simulation, parts, kept["clock"], tilings, own)
    yield from wholes({"values": kept["values"]})
    if found := [part["touched"] for part in parts or () if part["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in found]), True)
        rows = np.concatenate([of["rows"] for of in found])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": rows})


def _in_tiles(
    simulation: Any, parts: list[dict] | None, clock: np.ndarray, own_tilings: list[dict],
    own: list[list[np.ndarray]],
) -> Iterator[Stored]:  # fmt: skip
    """Yield tiles, clock and work, and the points, tile after tile.

    Parameters
    ----------
    parts
        Tiles and work of all processes, at the first.
    own_tilings, own
        Tiles and arrays of the points of this process, block by block.
    """
    tilings = [Tiles.empty_tiling(simulation.tiles) for _ in own]  # as of one process
    for k, tiling in enumerate(tilings if parts is not None else ()):
        tiling.count[1] = 1 if simulation.tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        rows = {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
        yield from wholes(rows)
    if parts is not None:
        work = sum(part["work"] for part in parts)
        carry(work)
        yield from wholes({"clock": clock.view(np.ndarray), "work": work})
    for k, tiling in enumerate(tilings):
        yield from _points(simulation, k, tiling, own_tilings[k], own[k])


def _points(
    simulation: Any, k: int, tiling: Tiling, own_tiling: dict, own: list[np.ndarray]
) -> Iterator[Stored]:
    """Yield the points of a block, tile after tile."""
    comm = simulation.comm
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    limits = [
        (int(number[first]), int(number[end - 1]) + 1) if total else (0, 0)
        for first, end in _cuts(ends)
    ]
    names = [name for name, _ in arrays_of(simulation.setup.blocks[k].points)]
    begin = 0
    sorted_before = comm.bcast(bool(total))
    for first, end in comm.bcast(limits):
        if sorted_before:
            found = comm.gather(points_of_tiles(own_tiling, own, first, end))
        else:  # each has those of an equal share of the ids
            found = comm.gather({"points": own})
        if found is None:
            continue
        total = total or sum(part["points"][0].shape[-1] for part in found)
        order = by_tile(found) if sorted_before else np.arange(total)
        for name, *same in zip(names, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _nodes(
    simulation: Any, spans: np.ndarray, kinds: dict[str, np.ndarray], arrays: list[np.ndarray]
) -> Iterator[Stored]:
    """Yield rows of nodes in use: of the arrays of nodes, or what contact remembers of them."""
    memory, counted = "contact" in kinds, simulation.counted()
    total = int((spans[:, 1] - spans[:, 0]).sum())
    for own, nodes in _pieces(spans):
        limits = (int(nodes[0]), int(nodes[-1]) + 1) if len(nodes) else (0, 0)
        here = counted[slice(*np.searchsorted(counted, limits))]
        found = simulation.comm.gather((here, [array[here] for array in arrays]))
        if found is None:
            continue
        rows = {n: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for n, a in kinds.items()}
        for there, some in found:
            for array, of in zip(rows.values(), some, strict=True):
                array[np.searchsorted(nodes, there)] = of
        for name, array in rows.items():
            array = latest(array, simulation.step) if memory else array + 0
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


def take_stored(simulation: Any, path: Path) -> None:
    """Take the own share of the state that a file holds."""
    comm, subdomain = simulation.comm, simulation.subdomain
    with opened(path) as state, comm.joint():
        take_known(simulation, state)
        for k, block in enumerate(simulation.setup.blocks):
            check_points(block.points, state, f"points/{k}/")
        simulation.tiles.owner = owner = _owner_in(simulation, state)
        simulation.tiles.empty_nodes(simulation.setup)
        subdomain.put(_own_share(simulation, state, owner))
        s = simulation.setup
        _take_nodes(
            simulation,
            state,
            simulation.tiles.spans_of_all(comm.allgather(simulation.tiles.reached_by(s))),
        )
        simulation.present[:] = state["present"][()]
    if not comm.leads:
        simulation.control.totals[WORK] = 0


def take_snapshot(simulation: Any, path: Path) -> dict[str, np.ndarray]:
    """Read the own share of the snapshot that a file holds."""
    with opened(path, "good") as found:
        owner, names = _owner_in(simulation, found), ("clock", "work", "values")
        known = {n: found[n][()] for n in found if n in names or n.startswith("touched/")}
        kept = _own_share(simulation, found, owner) | known | {"owner": owner}
    if not simulation.comm.leads:
        kept["work"][:] = 0
    return kept


def _owner_in(simulation: Any, state: Mapping) -> np.ndarray:
    """Find who is to have each tile of the points that a file holds."""
    tiles, blocks = simulation.tiles, simulation.setup.blocks
    tilings = _tilings_of(tiles, len(blocks), state)
    whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
    before = tiles.owner
    tiles.share_out(work_of(tiles.loads(whole), simulation.subdomain.load.costs))
    owner, tiles.owner = tiles.owner, before
    return owner


def _tilings_of(tiles: SharedTiles, blocks: int, state: Mapping) -> list[Tiling]:
    """The tiles of all points."""
    return [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(blocks)]


def _own_share(simulation: Any, state: Mapping, owner: np.ndarray) -> dict[str, np.ndarray]:
    """Read the points and tiles that are of this process by the `owner` of each tile."""
    blocks, found = simulation.setup.blocks, {}
    own = owner == simulation.comm.rank
    for k, tiling in enumerate(_tilings_of(simulation.tiles, len(blocks), state)):
        points, tiles = share_of_tiling(k, tiling, own)
        if not tiling.count[0]:  # not sorted yet: an equal share
            count, comm = state[f"points/{k}/id"].size, simulation.comm
            ends = count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size
            points = np.arange(*ends)
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


def _take_nodes(simulation: Any, state: Mapping, spans: np.ndarray) -> None:
    """Take rows of the nodes in use here, and what contact remembers of all nodes."""
    s = simulation.setup
    used = np.zeros(len(simulation.tiles.foreign), np.bool_)
    used[numbers(s.spans)] = True
    memory = simulation.subdomain.contact_memory()
    for own, nodes in _pieces(spans):
        here = used[nodes]
        for name, array in of_nodes(s):
            array[nodes[here]] = state[name][own][here]
        for array in memory:
            array[nodes] = state["contact"][own]
