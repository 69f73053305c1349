"""Boxes: the nodes that the points of one tile can reach, and the buffers for their sums."""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import forget_array
from karamelo_py.compiler.fields import SummedField, field, records
from karamelo_py.kernels.arrays import Buffers, Nodes, Setup, Tag
from karamelo_py.kernels.contact import SeparateFields
from karamelo_py.kernels.equations.corrected_acceleration import Acceleration
from karamelo_py.kernels.heat import Conducting

SPAN = 256  # nodes in a span


class Boxes(NamedTuple):
    order: np.ndarray  # (b,) order of summation
    grid: np.ndarray  # (b,) grid of each box
    lo: np.ndarray  # (b, d) first node in each direction
    hi: np.ndarray  # (b, d) last node in each direction
    rows: np.ndarray  # (b, r, 2) as `Tiling.rows`


class Reached(NamedTuple):
    """Overlaps between boxes and tiles of nodes, one entry per pair."""

    box: np.ndarray  # (k,) number of the box
    tile: np.ndarray  # (k,) number of the tile
    begin: np.ndarray  # (k, d) first nodes of the overlap
    end: np.ndarray  # (k, d) last nodes of the overlap
    size: np.ndarray  # (k,) number of nodes


def rows_of(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    row, left = ragged(boxes[:, 2] * boxes[:, 3])
    rows = boxes[row]
    begin = rows[:, 0] + left // rows[:, 3] * rows[:, 5] + left % rows[:, 3] * rows[:, 6]
    return begin, begin + rows[:, 4]


def joined_spans(boxes: np.ndarray) -> np.ndarray:
    begin, end = rows_of(boxes)
    order = np.argsort(begin, kind="stable")
    begin, end = begin[order], np.maximum.accumulate(end[order])
    apart = begin[1:] > end[:-1]
    begin, end = np.append(begin[:1], begin[1:][apart]), np.append(end[:-1][apart], end[-1:])
    of, left = ragged(-(-(end - begin) // SPAN))
    begin = begin[of] + left * SPAN
    return np.stack([begin, np.minimum(begin + SPAN, end[of])], axis=1)


def ranges_of_shares(rows: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    order = np.lexsort((rows[:, 0], owner))
    rows, owner = rows[order], owner[order]
    apart = (rows[1:, 0] != rows[:-1, 1]) | (owner[1:] != owner[:-1])
    first, last = (edge[: len(rows)] for edge in (np.append(True, apart), np.append(apart, True)))
    ends = count + np.searchsorted(owner[first], np.arange(count + 1))
    return np.concatenate(
        [np.stack([ends[:-1], ends[1:]], axis=1), np.stack([rows[first, 0], rows[last, 1]], axis=1)]
    )


def extents(starts: np.ndarray, begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, ...]:
    if not len(starts):
        return begin, end
    return np.minimum.reduceat(begin, starts), np.maximum.reduceat(end, starts)


def used(spans: np.ndarray) -> np.ndarray:
    return spans[: 1 + spans[0, 0]]


def without(spans: np.ndarray, others: np.ndarray) -> np.ndarray:
    edges = np.concatenate([spans.T.ravel(), others.T.ravel()])
    steps = np.repeat([1, -1, 2, -2], [len(spans)] * 2 + [len(others)] * 2)
    order = np.argsort(edges, kind="stable")
    edges, covered = edges[order], np.cumsum(steps[order])
    parts = np.stack([edges[:-1], edges[1:]], axis=1)[covered[:-1] == 1]
    return parts[parts[:, 0] < parts[:, 1]]


def numbers(spans: np.ndarray) -> np.ndarray:
    return between(*used(spans)[1:].T)


def between(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    of, left = ragged(end - begin)
    return begin[of] + left


def ragged(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For lists with `counts` (k,) items, return the list and the index in it of each item (n,)."""
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - (np.cumsum(counts) - counts)[of]


def numbered(shapes: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(np.prod(shapes, axis=1))])


def steps_of(shapes: np.ndarray) -> np.ndarray:
    after = np.concatenate([shapes[:, 1:], np.ones((len(shapes), 1), np.int64)], axis=1)
    return np.cumprod(after[:, ::-1], axis=1)[:, ::-1]


def unique(numbers: np.ndarray) -> np.ndarray:
    """Return sorted unique numbers; ``np.unique`` takes 0.03 s to import numpy.ma."""
    return np.unique(numbers, return_counts=True)[0]


def no_nodes() -> dict[str, np.ndarray]:
    return {name: np.zeros((1, 2), np.int64) for name in ("spans", "ranges")}


def buffers_of(s: Setup) -> list[Buffers]:
    return [s.buffers] + ([s.heat.buffers] if isinstance(s.heat, Conducting) else [])


def chosen_of(nodes: Nodes, kinds: int) -> list[np.ndarray]:
    sums, velocity, *rest = summed(nodes)
    return [sums] * (kinds & 1) + [velocity] * (kinds >> 1 & 1) + rest * (kinds >> 2 & 1)


def summed(nodes: Nodes) -> list[np.ndarray]:
    declared = [one.array for one in nodes.fields if isinstance(one, SummedField)]
    return [nodes.sums, nodes.velocity, *declared]


def read_beside(nodes: Nodes) -> list[np.ndarray]:
    """Return arrays that must be zero at the nodes next to the nodes in use."""
    beside = field(nodes.fields, Acceleration)
    return summed(nodes) + ([] if beside is None else [beside])


def beyond(contact: Tag) -> int:
    """Return how many cells beyond the nodes in use contact reads."""
    return contact.looks_beyond if isinstance(contact, SeparateFields) else 0


def room_of(rows: int, array: np.ndarray) -> np.ndarray:
    width, kind = array.shape[1], array.dtype
    return records(rows, width, kind) if rows else np.zeros((0, width), kind)


def give_up(array: np.ndarray) -> None:
    if array.flags.owndata:
        forget_array(array)
        array.resize((0,) * array.ndim, refcheck=False)


def grow(array: np.ndarray, rows: int) -> None:
    """Resize an array in place, because setups hold references to it."""
    if len(array) < rows:
        forget_array(array)
        array.resize((rows + rows // 8, *array.shape[1:]), refcheck=False)
