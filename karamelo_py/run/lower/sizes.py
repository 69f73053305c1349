"""Memory that a scene, or the share of a process, takes."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.fields import name_of
from karamelo_py.kernels.arrays import Setup, arrays_of
from karamelo_py.kernels.heat import Conducting
from karamelo_py.run.mpi.partition import occupied
from karamelo_py.scene.hub import Hub

LARGE, PAGE = 1 << 22, 1 << 21  # bytes from which on NumPy asks for large pages, and of these
THERE = 1  # bytes of each point of the whole scene, for those that were deleted


class MemoryTaken(NamedTuple):
    """Bytes touched by the steps, of a copy of the last good state, and known to each process.

    Of places, the copy has only those of the present.
    """

    touched: int
    copied: int
    known: int


def memory_of(simulation: Any, s: Setup, boxes: int) -> MemoryTaken:
    """Count what the points in the tiles of `s`, its nodes in use, and boxes of so many bytes take.

    Places before the first step and members of groups, where fixes act on points by them, and
    the marks of deleted points are known of the whole scene.
    """
    counts = [int(occupied(block.tiling)[1].sum()) for block in s.blocks]
    of_point = [{name: size for name, _, size in point_fields(block)} for block in s.blocks]
    points = sum(sum(of.values()) * n for of, n in zip(of_point, counts, strict=True))
    moved = sum(of["x moved"] * n for of, n in zip(of_point, counts, strict=True))
    spans = s.spans[1 : 1 + s.spans[0, 0]]
    nodes = sum(bytes_in(spans, array) for _, array in node_fields(simulation.setup))
    hooks = sum(getattr(simulation.hooks, name, np.empty(0)).nbytes for name in ("x0", "members"))
    whole = known(simulation.hub) + hooks
    return MemoryTaken(points + nodes + boxes, points - moved, whole)


def known(hub: Hub) -> int:
    """Count the bytes of what each process knows of the whole scene, such as solids and groups."""
    seen = {id(hub)}
    parts = (part for all in (hub.solids, hub.regions, hub.groups) for part in all.values())
    there = THERE * sum(solid.count for solid in hub.solids.values())
    return there + sum(_held(part, seen) for part in parts)


def _held(thing: Any, seen: set[int]) -> int:
    """Count the bytes of the arrays that a thing and its parts hold, each once."""
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
    """Count what rows of an array take, from each of ascending spans (k, 2) to before its end.

    Of large arrays Linux gives pages of 2 MiB: what lies between the nodes in use is there, too.
    """
    row = array.nbytes // max(len(array), 1)
    page = PAGE if array.nbytes >= LARGE else row
    first, end = spans[:, 0] * row // page, -(-spans[:, 1] * row // page)
    before = np.append(0, np.maximum.accumulate(end)[:-1])
    return int(np.maximum(end - np.maximum(first, before), 0).sum()) * page


def nodes_in_use(s: Setup) -> int:
    """Count the nodes that points may give to before they are sorted again."""
    spans = s.spans[1 : 1 + s.spans[0, 0]]
    return int(np.sum(spans[:, 1] - spans[:, 0]))


def node_fields(s: Any) -> list[tuple[str, np.ndarray]]:
    """List the arrays of the nodes, and of those that heat flows through, with their names."""
    found = list(_arrays_of_nodes(s.nodes))
    if isinstance(s.heat, Conducting):
        found += [(f"{name} (heat)", array) for name, array in _arrays_of_nodes(s.heat.nodes)]
    return found


def _arrays_of_nodes(nodes: Any) -> Iterator[tuple[str, np.ndarray]]:
    for name in ("sums", "update", "velocity"):
        yield name, getattr(nodes, name)
    for one in nodes.fields:
        yield name_of(type(one)), one.array


def point_fields(block: Any) -> list[tuple[str, str, int]]:
    """List name, shape and bytes of each field that a point of this block carries."""
    found = [("x", block.points.x[0]), ("x moved", block.points.x[1])]
    found += [(name, array) for name, array in arrays_of(block.points) if name != "x"]
    sizes = [(name, len(array) if array.ndim > 1 else 1, array) for name, array in found]
    return [(name, str(size), size * array.itemsize) for name, size, array in sizes]
