"""Predict in one process how a scene would be divided among several: memory and messages."""

from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import NoHooks, Setup, Tiling, arrays_of
from karamelo_py.kernels.step import StepKind, step
from karamelo_py.kernels.sums import arrays_given
from karamelo_py.kernels.sweep import sum_buffers, sweep_nodes, sweep_points
from karamelo_py.run.boxes import Boxes, chosen_of, no_nodes
from karamelo_py.run.lower.memory import memory_of, nodes_in_use
from karamelo_py.run.mpi.partition import SharedTiles, occupied
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.stable_step import sparse
from karamelo_py.run.tiles import SHARES
from karamelo_py.scene.comm import SerialComm
from karamelo_py.styles.fixes.pairs import SENT

MAY_CHANGE = 1.25  # threshold of (largest number of points of a process) / mean


class ProcessShare(NamedTuple):
    points: int
    tiles: int  # tiles with points
    nodes: int
    others: int  # number of processes to which a process sends data
    sent: int  # bytes per step
    memory: int  # bytes used in steps, including the copy of the last good state
    common: int  # bytes that each process holds of the whole scene (solids, regions, groups)


class _Sums(NamedTuple):
    sums: list


@sweep_points.on(_Sums)
@sweep_nodes.on(_Sums)
def _sweep_nothing(mode, *rest): ...


@sum_buffers.on(_Sums)
def _sum_buffers_sums(mode, quantities, s, due):
    if due:
        mode.sums.append((arrays_given(quantities, s.kin), s.nodes))


class _PretendedComm(SerialComm):
    def __init__(self, rank: int, size: int, boxes: list[Boxes]):
        self.rank, self.size, self.boxes = rank, size, boxes

    def allgather(self, thing: object) -> list:
        return self.boxes


def bytes_of_node(simulation: Simulation) -> int:
    s, sums = simulation.setup, _Sums([])
    control = s.control
    kept = control.values.copy(), control.clock.copy(), control.totals.copy()
    step(StepKind(simulation.scheme, simulation.visits, sums), s, NoHooks(), True)
    control.values[:], control.clock[:], control.totals[:] = kept
    total = 0
    for names, nodes in sums.sums:
        total += sum(array.itemsize * array.shape[1] for array in chosen_of(nodes, names))
    return total


def plan(simulation: Simulation, ranks: int) -> list[ProcessShare]:
    s, method = simulation.setup, simulation.hub.update.method
    lattices, one_space = method.lattices(simulation.hub), method.fields_per_solid
    few = simulation.count, sparse(simulation.hub)
    boxes: list[Boxes] = []
    of_all = [
        SharedTiles(
            _PretendedComm(rank, ranks, boxes), lattices, s.basis, *few, one_space=one_space
        )
        for rank in range(ranks)
    ]
    of_all[0].share_out(of_all[0].loads(s.blocks)[:-1].sum(axis=0))
    parts = [_part(s, of_all[0].owner == rank) for rank in range(ranks)]
    boxes += [tiles.own_boxes(setup) for tiles, setup in zip(of_all, parts, strict=True)]
    per_node = bytes_of_node(simulation)
    return [
        _share(simulation, setup, tiles, per_node)
        for setup, tiles in zip(parts, of_all, strict=True)
    ]


def _share(simulation: Simulation, s: Setup, tiles: SharedTiles, per_node: int) -> ProcessShare:
    none = s.nodes._replace(
        sums=s.nodes.sums[:, :0], velocity=s.nodes.velocity[:, :0], fields=()
    )  # only positions are needed
    tiles.lay_out(s._replace(buffers=tiles.empty_buffers(none, len(s.blocks))))
    tilings = [block.tiling for block in s.blocks]
    memory = memory_of(simulation, s, tiles.box_bytes(simulation.setup))
    return ProcessShare(
        points=sum(int(occupied(one)[1].sum()) for one in tilings),
        tiles=sum(int(one.count[0]) for one in tilings),
        nodes=nodes_in_use(s),
        others=len(tiles.sent),
        sent=per_node * sum(map(len, tiles.sent.values())),
        memory=sum(memory),
        common=memory.common,
    )


def _part(s: Setup, mine: np.ndarray) -> Setup:
    blocks = []
    for block in s.blocks:
        which = np.flatnonzero(mine[occupied(block.tiling)[0]])
        rows = {name: getattr(block.tiling, name)[which] for name in Tiling._fields[2:]}
        rows["count"] = np.array([len(which), *block.tiling.count[1:]])
        rows["share"] = np.zeros(2 * SHARES + 1, np.int64)
        blocks.append(block._replace(tiling=block.tiling._replace(**rows)))
    return s._replace(blocks=tuple(blocks), **no_nodes(), heat=None)


def report_lines(simulation: Simulation, ranks: int) -> list[str]:
    columns = np.array(plan(simulation, ranks))
    mean = columns[:, 0].mean()
    lines = [f"distributed over {ranks} processes{'':<6}least     largest"]
    columns[:, -2:] >>= 20
    words = (
        "points", "tiles", "nodes in use", "neighbour processes", "bytes sent per step",
        "memory, in MiB", "in each process, MiB",
    )  # fmt: skip
    lines += [
        f"  {word:<30}{low:>8} {high:>11}"
        for word, low, high in zip(words, columns.min(axis=0), columns.max(axis=0), strict=True)
    ]
    over = columns[:, 0].max() / mean if mean else 1.0
    lines.append(f"  {'largest part over the mean':<30}{'':>8} {over:>11.2f}")
    if simulation.tiles.direct:
        lines.append("  so few points are not distributed: the first process has them all")
    elif over > MAY_CHANGE:
        lines.append("  tiles are not divided: fewer processes would wait less")
    acting = (fix for pairs in simulation.fixes.lasting.in_python.values() for fix, _ in pairs)
    if fix := next((fix for fix in acting if not fix.point_by_point), None):
        blocks = simulation.setup.blocks
        moved = sum(array.nbytes for block in blocks for _, array in arrays_of(block.points))
        lines.append(
            f"  fix {fix.style} '{fix.id}' acts on the whole scene: in each step the first "
            f"process receives and returns {moved >> 20} MiB, and needs the memory of a serial run"
        )
    for fix in simulation.hub.fixes.values():
        if hasattr(fix, "sent"):
            lines.append(
                f"  fix {fix.style} '{fix.id}' sends all points that may touch "
                f"({fix.sent(simulation)} now) to the first process, {SENT} bytes each"
            )
    return lines
