"""Memory of a scene, or of a process's part of it; scenes that do not fit are refused.

Only the least that a run needs is compared: nothing that would run is refused.
"""

import gc
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Block, Hooks
from karamelo_py.run.boxes import used
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.lower.build import PRECISIONS, lower_points, part_of, point_kinds
from karamelo_py.run.mpi.partition import occupied
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import in_words, machine_memory
from karamelo_py.scene.solid import Solid, own_grids
from karamelo_py.script.errors import ScriptError, plural

LARGE, PAGE = 1 << 22, 1 << 21  # bytes from which on NumPy asks for large pages, and of these
THERE = 1  # bytes of each point of the whole scene, for those that were deleted


class MemoryTaken(NamedTuple):
    touched: int
    copied: int  # of the last good state, with places of the present alone
    known: int  # to each process, of the whole scene


def memory_of(simulation: Any, s: arrays.Setup, boxes: int) -> MemoryTaken:
    """Return the memory of the points in the tiles of `s`, nodes in use, and `boxes` bytes."""
    counts = [int(occupied(block.tiling)[1].sum()) for block in s.blocks]
    of_point = [{name: size for name, _, size in point_fields(block)} for block in s.blocks]
    points = sum(sum(of.values()) * n for of, n in zip(of_point, counts, strict=True))
    moved = sum(of["x moved"] * n for of, n in zip(of_point, counts, strict=True))
    nodes = sum(bytes_in(used(s.spans)[1:], array) for _, array in node_fields(simulation.setup))
    of_fixes = simulation.hooks
    hooks = of_fixes.x0.nbytes + of_fixes.members.nbytes if isinstance(of_fixes, Hooks) else 0
    return MemoryTaken(points + nodes + boxes, points - moved, known(simulation.hub) + hooks)


def known(hub: Hub) -> int:
    """Return the bytes of data about the whole scene that each process holds: solids, groups."""
    seen = {id(hub)}
    parts = (part for all in (hub.solids, hub.regions, hub.groups) for part in all.values())
    there = THERE * sum(solid.count for solid in hub.solids.values())
    return there + sum(_held(part, seen) for part in parts)


def _held(thing: Any, seen: set[int]) -> int:
    if isinstance(thing, np.ndarray) and isinstance(thing.base, np.ndarray):
        thing = thing.base
    if id(thing) in seen:
        return 0
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    ours = type(thing).__module__.startswith("karamelo_py.") and hasattr(thing, "__dict__")
    parts = thing if isinstance(thing, (list, tuple)) else vars(thing).values() if ours else ()
    return sum(_held(part, seen) for part in parts)


def bytes_in(spans: np.ndarray, array: np.ndarray) -> int:
    """Return the bytes of array rows in ascending spans (k, 2).

    For large arrays Linux uses pages of 2 MiB, which include what lies between the nodes in use.
    """
    row = array.nbytes // max(len(array), 1)
    page = PAGE if array.nbytes >= LARGE else row
    first, end = spans[:, 0] * row // page, -(-spans[:, 1] * row // page)
    before = np.append(0, np.maximum.accumulate(end)[:-1])
    return int(np.maximum(end - np.maximum(first, before), 0).sum()) * page


def nodes_in_use(s: arrays.Setup) -> int:
    return int(np.diff(used(s.spans)[1:]).sum())


def node_fields(s: Any) -> list[tuple[str, np.ndarray]]:
    parts = ((name.partition("/"), array) for name, array in of_nodes(s))
    return [(name + " (heat)" * (kind == "heat"), array) for (kind, _, name), array in parts]


def point_fields(block: Block) -> list[tuple[str, str, int]]:
    """Return name, shape and bytes of each field of a point of this block."""
    found = [("x", block.points.x[0]), ("x moved", block.points.x[1])]
    found += [(name, array) for name, array in arrays.arrays_of(block.points) if name != "x"]
    sizes = [(name, len(array) if array.ndim > 1 else 1, array) for name, array in found]
    return [(name, str(size), size * array.itemsize) for name, size, array in sizes]


def bytes_per_point(simulation: Any) -> int:
    blocks = simulation.setup.blocks
    own = np.array([len(block.points.id) for block in blocks])
    counts = simulation.comm.allreduce(own).tolist()
    of_one = [sum(size for *_, size in point_fields(block)) for block in blocks]
    return round(np.dot(counts, of_one) / max(1, sum(counts)))


FEW = 100_000  # points; this number fits everywhere


def check_room(hub: Hub, *, copied: bool) -> None:
    """Refuse a scene that exceeds memory, with a copy if `copied`; warn if it is not free."""
    comm = hub.settings.comm
    count = sum(solid.count for solid in hub.solids.values())
    if count <= FEW or (there := machine_memory(comm.on_machine)) is None:
        return
    need = comm.share_here * least_bytes(hub, PRECISIONS[hub.settings.precision], copied)
    if need > there.free:
        # Scenes of before, which point to themselves, stay until someone looks.
        gc.collect()
        there = machine_memory(comm.on_machine) or there
    if need <= there.free:
        return
    place, beside = largest(hub).place, ""
    if comm.share_here < 1:
        beside = f" for {comm.on_machine} of {comm.size} processes"
    message = (
        f"the scene has {plural(count, 'point')}, which take at least {in_words(need)} of memory"
        f"{beside}; this machine has "
    )
    if need <= there.whole:  # who may have it the system knows alone
        message += f"{in_words(there.free)} free: it may not fit"
        hub.warn(message, place=place, hint=_ways(hub, need, there.free, copied))
        return
    hint = _ways(hub, need, there.whole, copied)
    said = f"{message}{in_words(there.whole)} in all"
    error = ScriptError(said, place=place, hint=hint, code="memory")
    error.command = "solid"
    raise error


def _ways(hub: Hub, need: float, there: float, copied: bool) -> str:
    # Bytes go with that power of the number of cells along a side; two digits, rounded up.
    larger = ceil(10 * (need / max(there, 1.0)) ** (1 / hub.domain.dimension)) / 10
    ways = [f"cells {max(larger, 1.1):g} times as large, or fewer points per cell"]
    single = hub.settings.comm.share_here * least_bytes(hub, np.float32, copied)
    if hub.settings.precision == "double" and single < there:
        ways.append(f"precision(single), which needs at least {in_words(single)}")
    ways.append("processes on several machines (mpiexec), which divide the points")
    return "; ".join(ways)


def least_bytes(hub: Hub, real: type, copied: bool) -> float:
    """Return the least bytes of points, their copy, and the nodes of the cells they fill."""
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
        ppc = solid.ppc  # else nothing is known of the cells that it fills
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
    found = ScriptError(
        f"the arrays of {plural(nodes, 'node')} and {plural(count, 'point')} do not fit into "
        f"memory: {str(error) or 'the system gives no more'}",
        place=hub.domain.place if of_grid else largest(hub).place,
        hint="larger cells, or a smaller domain" if of_grid else "larger cells, or fewer points",
        code="memory",
    )
    found.command = "dimension" if of_grid else "solid"
    return found
