"""Arrays of what points give to nodes, which grow and are given up in place."""

import numpy as np

from karamelo_py.compiler.argument_buffer import forget
from karamelo_py.compiler.fields import records
from karamelo_py.kernels.arrays import Buffers, Nodes, Setup
from karamelo_py.kernels.heat import Conducting


def no_nodes() -> dict[str, np.ndarray]:
    """Room for the nodes in use of a setup, where none are yet."""
    return {name: np.zeros((1, 2), np.int64) for name in ("spans", "ranges")}


def buffers_of(s: Setup) -> list[Buffers]:
    """All buffers of a scene, in the order of their numbers."""
    return [s.buffers] + ([s.heat.buffers] if isinstance(s.heat, Conducting) else [])


def chosen_of(nodes: Nodes, what: int) -> list[np.ndarray]:
    """The arrays that points give to, of the kinds that `what` names (kernels.p2g.given)."""
    sums, velocity, *rest = summed(nodes)
    return [sums] * (what & 1) + [velocity] * (what >> 1 & 1) + rest * (what >> 2 & 1)


def summed(nodes: Nodes) -> list[np.ndarray]:
    """The arrays that points give to."""
    own = [one.array for one in nodes.fields if getattr(type(one), "summed", False)]
    return [nodes.sums, nodes.velocity, *own]


def room_of(rows: int, like: np.ndarray) -> np.ndarray:
    """So many rows as the array has, zero; with none it can grow."""
    width, kind = like.shape[1], like.dtype
    return records(rows, width, kind) if rows else np.zeros((0, width), kind)


def give_up(array: np.ndarray) -> None:
    """Let an array, which is of no use any more, have no memory."""
    if array.flags.owndata:
        forget(array)
        array.resize((0,) * array.ndim, refcheck=False)


def grow(array: np.ndarray, rows: int) -> None:
    """See that an array has so many rows; in place, since setups hold it."""
    if len(array) < rows:
        forget(array)
        array.resize((rows + rows // 8, *array.shape[1:]), refcheck=False)
