"""What several processes would have of a scene, and pass on in a step: their plan, made by one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import Setup, Tiling
from karamelo_py.kernels.step import Fused, Staged, step
from karamelo_py.kernels.sums import given
from karamelo_py.kernels.sweep import sum_buffers, sweep_nodes, sweep_points
from karamelo_py.run.crew import Crew
from karamelo_py.run.shares import SharedTiles, occupied
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.stable import sparse
from karamelo_py.run.tiles import chosen_of

MAY_CHANGE = 1.25  # largest share of the points over the mean that is no waste yet


class Share(NamedTuple):
    """What one process has.

    Attributes
    ----------
    points, tiles, nodes
        Points, occupied tiles of them, nodes in use.
    others
        Processes that it passes something on to.
    given
        Bytes that it passes on in a step.
    """

    points: int
    tiles: int
    nodes: int
    others: int
    given: int


class _Sums(NamedTuple):
    """Sweeps nothing, and notes which arrays of the nodes are given to in a step."""

    found: list


@sweep_points.on(_Sums)
def _(mode, visit, s, block, then, gathers, scatters, dt):
    return None


@sweep_nodes.on(_Sums)
def _(mode, task, kin, nodes, spans, dt):
    return None


@sum_buffers.on(_Sums)
def _(mode, quantities, s, due):
    if due:
        mode.found.append((given(quantities, s.kin), s.nodes))


class _Pretended(Crew):
    """One of several processes that are not there."""

    def __init__(self, rank: int, boxes: list):
        self.rank, self.size, self.boxes = rank, len(boxes), boxes

    def everyone(self, thing: Any) -> list:
        return self.boxes


def bytes_of_node(simulation: Simulation) -> int:
    """Bytes that are passed on in a step of each node that tiles of another process reach."""
    s, sums = simulation.setup, _Sums([])
    control = s.control
    kept = control.values.copy(), control.clock.copy(), control.totals.copy()
    visits = Staged() if simulation.staged else Fused()
    step(simulation.hub.update.scheme, visits, sums, s, simulation.hooks, True)
    control.values[:], control.clock[:], control.totals[:] = kept
    total = 0
    for what, nodes in sums.found:
        total += sum(array.itemsize * array.shape[1] for array in chosen_of(nodes, what))
    return total


def plan(simulation: Simulation, ranks: int) -> list[Share]:
    """The shares of so many processes in a scene whose points are sorted."""
    s, hub = simulation.setup, simulation.hub
    method = hub.update.method
    lattices, one_place = method.lattices(hub), method.fields_per_solid
    per_node = bytes_of_node(simulation)

    def tiles_of(crew: Crew) -> SharedTiles:
        return SharedTiles(
            crew, lattices, s.basis, simulation.count, sparse(simulation.hub), one_place=one_place
        )

    first = tiles_of(_Pretended(0, [None] * ranks))
    first.share_out(first.points_in(s.blocks))
    cuts, d = first.cuts, first.dimension
    parts = [[_part(b.tiling, *cuts[r : r + 2]) for b in s.blocks] for r in range(ranks)]
    boxes = []
    for part in parts:
        block = np.repeat(np.arange(len(part)), [one.count[0] for one in part])
        grid, box = (
            np.concatenate([getattr(t, name)[: t.count[0]] for t in part])
            for name in ("grid", "box")
        )
        boxes.append((block, grid, box[:, :d], box[:, d:]))
    return [
        _share(s, tiles_of(_Pretended(rank, boxes)), part, per_node)
        for rank, part in enumerate(parts)
    ]


def _share(s: Setup, tiles: SharedTiles, part: list[Tiling], per_node: int) -> Share:
    spans = np.zeros((1, 2), np.int64)
    blocks = tuple(b._replace(tiling=t) for b, t in zip(s.blocks, part, strict=True))
    none = s.nodes._replace(
        sums=s.nodes.sums[:, :0], velocity=s.nodes.velocity[:, :0], fields=()
    )  # boxes of nothing: only their places matter
    mine = s._replace(blocks=blocks, spans=spans, heat=None, buffers=tiles.empty_buffers(none))
    tiles.lay_out(mine)
    points = sum(int(occupied(one)[1].sum()) for one in part)
    used = spans[1 : 1 + spans[0, 0]]
    rows = sum(map(len, tiles.given.values()))
    count = sum(int(one.count[0]) for one in part)
    nodes = int(np.diff(used, axis=1).sum())
    return Share(points, count, nodes, len(tiles.given), rows * per_node)


def _part(tiling: Tiling, low: int, high: int) -> Tiling:
    """The tiles from `low` to `high`."""
    a, b = np.searchsorted(tiling.number[: tiling.count[0]], (low, high))
    rows = {name: getattr(tiling, name)[a : b + 1].copy() for name in Tiling._fields}
    return tiling._replace(**{**rows, "count": np.array([b - a, tiling.count[1]]),
                              "share": tiling.share})  # fmt: skip


def told(simulation: Simulation, ranks: int) -> list[str]:
    """Lines that say what so many processes would have, and pass on."""
    shares = plan(simulation, ranks)
    columns = np.array(shares)
    mean = columns[:, 0].mean()
    lines = [f"shared out among {ranks} processes{'':<6}least     largest"]
    words = ("points", "tiles", "nodes in use", "others to talk to", "bytes given in a step")
    lines += [
        f"  {word:<30}{low:>8} {high:>11}"
        for word, low, high in zip(words, columns.min(axis=0), columns.max(axis=0), strict=True)
    ]
    over = columns[:, 0].max() / mean if mean else 1.0
    lines.append(f"  {'largest share over the mean':<30}{'':>8} {over:>11.2f}")
    if simulation.tiles.direct:
        lines.append("  so few points are not shared out: the first process has them all")
    elif over > MAY_CHANGE:
        lines.append("  tiles are not cut: fewer processes would wait less for the largest share")
    return lines
