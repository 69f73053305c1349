"""Scenes that no memory of the machine holds are refused before their arrays are made.

What is compared is the least that a run has to hold: of what would run nothing is refused.
"""

import gc
from math import ceil

import numpy as np

from karamelo_py.kernels.arrays import SUMS_WIDTH, UPDATE_WIDTH, VELOCITY_WIDTH, Block
from karamelo_py.run.lower.build import PRECISIONS, check_scene, lower_points, part_of, point_kinds
from karamelo_py.run.lower.sizes import point_fields
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import machine_memory
from karamelo_py.scene.solid import Solid, own_grids
from karamelo_py.script.errors import ScriptError, plural

GIB = 2**30
FEW = 100_000  # points; so many have room everywhere


def check_room(hub: Hub, *, copied: bool) -> None:
    """Refuse a scene that needs more memory than this machine has, and warn of what is not free.

    Parameters
    ----------
    hub
        The scene.
    copied
        Whether there will be a copy of the last good state, as in a run.

    Raises
    ------
    ScriptError
        At the line of the largest solid.
    """
    comm = hub.settings.comm
    count = sum(solid.count for solid in hub.solids.values())
    if count <= FEW or (there := machine_memory(comm.on_machine)) is None:
        return
    check_scene(hub)
    need = comm.share_here * least_bytes(hub, PRECISIONS[hub.settings.precision], copied)
    if need > there.free:
        # Scenes of before, which point to themselves, stay until someone looks.
        gc.collect()
        there = machine_memory(comm.on_machine) or there
    if need <= there.free:
        return
    place, beside = _largest(hub).place, ""
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
    error = ScriptError(f"{message}{in_words(there.whole)} in all", place=place, hint=hint)
    error.command = "solid"
    raise error


def in_words(count: float) -> str:
    """Write a number of bytes."""
    size = count / GIB
    return f"{size:.0f} GiB" if size >= 100 else f"{size:.3g} GiB"


def _ways(hub: Hub, need: float, there: float, copied: bool) -> str:
    """Write what would bring the need down to what is `there`."""
    # Bytes go with that power of the number of cells along a side; two digits, rounded up.
    larger = ceil(10 * (need / max(there, 1.0)) ** (1 / hub.domain.dimension)) / 10
    ways = [f"cells {max(larger, 1.1):g} times as large, or fewer points per cell"]
    single = hub.settings.comm.share_here * least_bytes(hub, np.float32, copied)
    if hub.settings.precision == "double" and single < there:
        ways.append(f"precision(single), which needs at least {in_words(single)}")
    ways.append("processes on several machines (mpiexec), which share the points out")
    return "; ".join(ways)


def least_bytes(hub: Hub, real: type, copied: bool) -> float:
    """Count the bytes that points, their copy, and the nodes of the cells that they fill take.

    It is the least: boxes of tiles, groups and what the program itself takes come on top.
    """
    kin = hub.update.method.kinematics(hub)
    kinds = point_kinds(hub)
    points, cells = 0, [0.0]
    for solid in hub.solids.values():
        if not solid.count:
            continue
        one = part_of(solid, solid.first_id, solid.first_id + 1)
        block = Block(*lower_points(hub, [one], kin, kinds, real), None)
        sizes = {name: size for name, _, size in point_fields(block)}
        of_one = sum(sizes.values())
        points += solid.count * (of_one + (of_one - sizes["x moved"] if copied else 0))
        cells.append(_cells(solid))
    d, per_cell = kin.dimension, hub.update.method.basis.nodes_per_cell**kin.dimension
    of_node = np.dtype(real).itemsize * (SUMS_WIDTH[d] + UPDATE_WIDTH[d] + VELOCITY_WIDTH[d])
    nodes = sum(cells) if own_grids(hub) else max(cells)
    return points + nodes * per_cell * of_node


def _largest(hub: Hub) -> Solid:
    """Find the solid with most points."""
    return max(hub.solids.values(), key=lambda solid: solid.count)


def _cells(solid: Solid) -> float:
    """Count the cells that a solid fills at least."""
    ppc = getattr(solid, "ppc", 0)
    return solid.count / ppc**solid.domain.dimension if ppc else 0.0


def no_room(hub: Hub, error: MemoryError) -> ScriptError:
    """Make the error for a scene whose arrays the system does not give, whoever would use them."""
    nodes = sum(lattice.node_count for lattice in hub.lattices)
    count = sum(solid.count for solid in hub.solids.values())
    of_grid = nodes > count
    found = ScriptError(
        f"the arrays of {plural(nodes, 'node')} and {plural(count, 'point')} do not fit into "
        f"memory: {str(error) or 'the system gives no more'}",
        place=hub.domain.place if of_grid else _largest(hub).place,
        hint="larger cells, or a smaller domain" if of_grid else "larger cells, or fewer points",
    )
    found.command = "dimension" if of_grid else "solid"
    return found
