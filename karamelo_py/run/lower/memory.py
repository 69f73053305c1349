"""Memory of a scene, or of its part on one process; scenes that do not fit are refused.

Only the minimum that a run needs is compared, so that no scene that could run is refused.
"""

import gc
from math import ceil
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Block, Hooks
from karamelo_py.run.boxes import used
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.lower.build import PRECISIONS, lower_points, part_of, point_kinds
from karamelo_py.run.mpi.partition import occupied
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import in_words, machine_memory
from karamelo_py.scene.solid import Solid, own_grids
from karamelo_py.script.errors import ScriptError, plural

LARGE, PAGE = 1 << 22, 1 << 21  # bytes above which NumPy uses large pages, and the size of these
THERE = 1  # bytes per point in `present`


class MemoryTaken(NamedTuple):
    touched: int
    copied: int  # bytes of the copied last good state
    common: int  # bytes that each process holds of the whole scene (solids, regions, groups)


def memory_of(simulation: SceneState, s: arrays.Setup, boxes: int) -> MemoryTaken:
    counts = [int(occupied(block.tiling)[1].sum()) for block in s.blocks]
    of_point = [{name: size for name, _, size in point_fields(block)} for block in s.blocks]
    points = sum(sum(of.values()) * n for of, n in zip(of_point, counts, strict=True))
    moved = sum(of["x moved"] * n for of, n in zip(of_point, counts, strict=True))
    nodes = sum(bytes_in(used(s.spans)[1:], array) for _, array in node_fields(simulation.setup))
    of_fixes = simulation.hooks
    hooks = of_fixes.x0.nbytes + of_fixes.members.nbytes if isinstance(of_fixes, Hooks) else 0
    return MemoryTaken(points + nodes + boxes, points - moved, common(simulation.hub) + hooks)


def common(hub: Hub) -> int:
    seen = {id(hub)}
    members = (member for all in (hub.solids, hub.regions, hub.groups) for member in all.values())
    deleted = THERE * sum(solid.count for solid in hub.solids.values())
    return deleted + sum(_held(member, seen) for member in members)


def _held(item: object, seen: set[int]) -> int:
    if isinstance(item, np.ndarray) and isinstance(item.base, np.ndarray):
        item = item.base
    if id(item) in seen:
        return 0
    seen.add(id(item))
    if isinstance(item, np.ndarray):
        return item.nbytes
    ours = type(item).__module__.startswith("karamelo_py.") and hasattr(item, "__dict__")
    members = item if isinstance(item, (list, tuple)) else vars(item).values() if ours else ()
    return sum(_held(member, seen) for member in members)


def bytes_in(spans: np.ndarray, array: np.ndarray) -> int:
    """Return the bytes of array rows in ascending spans (k, 2).

    For large arrays, Linux uses pages of 2 MiB; these may include nodes not in use.
    """
    row = array.nbytes // max(len(array), 1)
    page = PAGE if array.nbytes >= LARGE else row
    first, end = spans[:, 0] * row // page, -(-spans[:, 1] * row // page)
    before = np.append(0, np.maximum.accumulate(end)[:-1])
    return int(np.maximum(end - np.maximum(first, before), 0).sum()) * page


def nodes_in_use(s: arrays.Setup) -> int:
    return int(np.diff(used(s.spans)[1:]).sum())


def node_fields(s: arrays.Setup) -> list[tuple[str, np.ndarray]]:
    parts = ((name.partition("/"), array) for name, array in of_nodes(s))
    return [(name + " (heat)" * (kind == "heat"), array) for (kind, _, name), array in parts]


def point_fields(block: Block) -> list[tuple[str, str, int]]:
    named = [("x", block.points.x[0]), ("x moved", block.points.x[1])]
    named += [(name, array) for name, array in arrays.arrays_of(block.points) if name != "x"]
    sizes = [(name, len(array) if array.ndim > 1 else 1, array) for name, array in named]
    return [(name, str(size), size * array.itemsize) for name, size, array in sizes]


def bytes_per_point(simulation: SceneState) -> int:
    blocks = simulation.setup.blocks
    local = np.array([len(block.points.id) for block in blocks])
    counts = simulation.comm.allreduce(local).tolist()
    of_one = [sum(size for *_, size in point_fields(block)) for block in blocks]
    return round(np.dot(counts, of_one) / max(1, sum(counts)))


FITS_EVERYWHERE = 100_000  # points of a scene that fits into the memory of any machine


def check_room(hub: Hub, *, copied: bool) -> None:
    comm = hub.settings.comm
    count = sum(solid.count for solid in hub.solids.values())
    if count <= FITS_EVERYWHERE or (memory := machine_memory(comm.on_machine)) is None:
        return
    need = comm.share_here * least_bytes(hub, PRECISIONS[hub.settings.precision], copied)
    if need > memory.free:
        # Free earlier scenes, which are in reference cycles.
        gc.collect()
        memory = machine_memory(comm.on_machine) or memory
    if need <= memory.free:
        return
    mark, beside = largest(hub).mark, ""
    if comm.share_here < 1:
        beside = f" for {comm.on_machine} of {comm.size} processes"
    message = (
        f"the scene has {plural(count, 'point')}, which take at least {in_words(need)} of memory"
        f"{beside}; this machine has "
    )
    if need <= memory.whole:  # other programs may release memory before it is needed
        message += f"{in_words(memory.free)} free: it may not fit"
        hub.warn(message, mark=mark, hint=_ways(hub, need, memory.free, copied))
        return
    hint = _ways(hub, need, memory.whole, copied)
    said = f"{message}{in_words(memory.whole)} in all"
    raise ScriptError(said, mark=mark, hint=hint, code="memory", command="solid")


def _ways(hub: Hub, need: float, free: float, copied: bool) -> str:
    # The cell size that fits, as a factor with two digits, rounded up.
    larger = ceil(10 * (need / max(free, 1.0)) ** (1 / hub.domain.dimension)) / 10
    ways = [f"cells {max(larger, 1.1):g} times as large, or fewer points per cell"]
    single = hub.settings.comm.share_here * least_bytes(hub, np.float32, copied)
    if hub.settings.precision == "double" and single < free:
        ways.append(f"precision(single), which needs at least {in_words(single)}")
    ways.append("processes on several machines (mpiexec), which divide the points")
    return "; ".join(ways)


def least_bytes(hub: Hub, real: type, copied: bool) -> float:
    kin = hub.update.method.kinematics(hub)
    kinds = point_kinds(hub)
    points, cells = 0, [0.0]
    for solid in hub.solids.values():
        if not solid.count:
            continue
        one = part_of(solid, solid.first_id, solid.first_id + 1)
        block = arrays.Block(*lower_points(hub, [one], kin, kinds, real), None)
        sizes = {name: size for name, _, size in point_fields(block)}
        of_one = sum(sizes.values())
        points += solid.count * (of_one + (of_one - sizes["x moved"] if copied else 0))
        ppc = solid.ppc  # without ppc, the number of cells is unknown
        cells.append(solid.count / ppc**solid.domain.dimension if ppc else 0.0)
    d, per_cell = kin.dimension, hub.update.method.basis.traits.nodes_per_cell**kin.dimension
    of_node = np.dtype(real).itemsize * (
        arrays.SUMS_WIDTH[d] + arrays.UPDATE_WIDTH[d] + arrays.VELOCITY_WIDTH[d]
    )
    nodes = sum(cells) if own_grids(hub) else max(cells)
    return points + nodes * per_cell * of_node


def largest(hub: Hub) -> Solid:
    return max(hub.solids.values(), key=lambda solid: solid.count)


def no_room(hub: Hub, error: MemoryError) -> ScriptError:
    nodes = sum(lattice.node_count for lattice in hub.lattices)
    count = sum(solid.count for solid in hub.solids.values())
    of_grid = nodes > count
    return ScriptError(
        f"the arrays of {plural(nodes, 'node')} and {plural(count, 'point')} do not fit into "
        f"memory: {str(error) or 'the system gives no more'}",
        mark=hub.domain.mark if of_grid else largest(hub).mark,
        hint="larger cells, or a smaller domain" if of_grid else "larger cells, or fewer points",
        code="memory",
        command="dimension" if of_grid else "solid",
    )
