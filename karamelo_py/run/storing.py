"""What a file to go on from holds, from the parts of all processes, so many points at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import Block, Tiling, arrays_of
from karamelo_py.kernels.totals import carry
from karamelo_py.output.fields import PIECE
from karamelo_py.run.handing import by_tile, join_tilings
from karamelo_py.run.state import Stored, known, latest, of_nodes
from karamelo_py.run.tiles import SHARES, between, in_use


def points_of_tiles(block: Block, first: int, end: int) -> dict[str, Any]:
    """Own points in tiles with numbers from `first` to before `end`, and how they lie in them."""
    tiling = block.tiling
    own = slice(*np.searchsorted(tiling.number[: tiling.count[0]], (first, end)))
    ranges = tiling.range[own]
    points = slice(ranges[0, 0], ranges[-1, 1]) if len(ranges) else slice(0, 0)
    return {
        "number": tiling.number[own], "range": ranges, "count": [len(ranges)],
        "points": [array[..., points] for _, array in arrays_of(block.points)],
    }  # fmt: skip


def stored(ranks: Any) -> Iterator[Stored]:
    """The arrays of `state.arrays_by_name`, with the same bits, in the same order."""
    parts = ranks.together("tell_of_tiles")
    tilings = [ranks.tiles.empty_tiling() for _ in ranks.blocks]
    for k, tiling in enumerate(tilings):
        tiling.count[1] = 1 if ranks.tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        for name, rows in in_use(tiling):
            yield _whole(f"tiling/{k}/{name}", getattr(tiling, name)[:rows])
    yield _whole("clock", ranks.control.clock.view(np.ndarray))
    work = sum(part["work"] for part in parts)
    carry(work)
    yield _whole("work", work)
    for k, tiling in enumerate(tilings):
        yield from _points(ranks, k, tiling)
    reached = zip(*(part["reached"] for part in parts), strict=True)
    spans = ranks.tiles.spans_of(*map(np.concatenate, reached))
    if memory := ranks.part.memory():
        yield from _nodes(ranks, spans, {"contact": memory[0]})
    yield from (_whole(name, array) for name, array in known(ranks).items())
    yield from _nodes(ranks, spans, dict(of_nodes(ranks.part.setup)))


def _whole(name: str, array: np.ndarray) -> Stored:
    return name, array.shape, ..., array


def _points(ranks: Any, k: int, tiling: Tiling) -> Iterator[Stored]:
    """The points of a block, tile after tile."""
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    likes = [(name, array) for name, array in arrays_of(ranks.part.setup.blocks[k].points)]
    cuts = np.unique(np.searchsorted(ends, np.arange(PIECE, total, PIECE), side="right"))
    begin = 0
    for first, end in zip(np.append(0, cuts), np.append(cuts, len(ends)), strict=True):
        if first == end and total:
            continue
        numbers = (int(number[first]), int(number[end - 1]) + 1) if total else (0, 0)
        found = ranks.together("give_tiles", k, *numbers)
        order = by_tile(found)
        for (name, like), *same in zip(likes, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*like.shape[:-1], total), where, array
        begin += len(order)


def _nodes(ranks: Any, spans: np.ndarray, kinds: dict[str, np.ndarray]) -> Iterator[Stored]:
    """Rows of nodes in use: of the arrays of nodes, or what contact remembers of them."""
    memory = "contact" in kinds
    ends = np.cumsum(spans[:, 1] - spans[:, 0])
    total, begin = int(ends[-1]) if len(ends) else 0, 0
    cuts = np.unique(np.searchsorted(ends, np.arange(PIECE, total, PIECE), side="right"))
    for first, end in zip(np.append(0, cuts), np.append(cuts, len(ends)), strict=True):
        nodes = between(*spans[first:end].T)
        if not len(nodes) and total:
            continue
        limits = (int(nodes[0]), int(nodes[-1]) + 1) if total else (0, 0)
        rows = {n: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for n, a in kinds.items()}
        for own, found in ranks.together("give_rows", *limits, memory):
            for array, some in zip(rows.values(), found, strict=True):
                array[np.searchsorted(nodes, own)] = some
        for name, array in rows.items():
            array = latest(array, ranks.step) if memory else array + 0
            shape = total, *array.shape[1:]
            yield name, shape, slice(begin, begin + len(nodes)), array
        begin += len(nodes)
