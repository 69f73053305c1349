"""Lines around bodies and tools, in 2D and projected in 3D."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from contourpy import contour_generator

FINE = 300  # steps along the longest side of a tool's outline
# For sections of 3D tools: search points per axis, steps along a section, bisections to find the
# ends of the tool, and number of sections between the ends.
COARSE, SECTION, HALVINGS, BETWEEN = 24, 80, 8, 3
SHARP, FLAT = 0.87, 1 - 1e-6  # cosines of angles between face normals
# Smallest and largest number of points used to measure the spacing; distances per batch.
FEW, SAMPLE, DISTANCES = 25, 400, 4_000_000

Depth = Callable[[np.ndarray], np.ndarray]  # depth (n,) in a tool at positions (n, d)


class Tool(NamedTuple):
    depth: Depth
    faces: np.ndarray | None = None

    def lines(self, lo: np.ndarray, hi: np.ndarray) -> Iterator[np.ndarray]:
        plane = len(lo) == 2
        if self.faces is None:
            contours = (
                zeros(self.depth, lo, hi, FINE) if plane else section_lines(self.depth, lo, hi)
            )
            yield from contours
            return
        step = np.linalg.norm(hi - lo) / FINE
        for start, end in self.faces if plane else edges(self.faces):
            count = int(np.linalg.norm(end - start) / step) + 2
            line = start + (end - start) * np.linspace(0, 1, count)[:, None]
            beyond = ((line < lo) | (line > hi)).any(axis=1)
            yield from (piece for piece, outside in split(line, beyond) if not outside)


def outlines(x: np.ndarray) -> list[np.ndarray]:
    """Return lines (m, 2) around points x (n, 2), along which points fill half of the area.

    Points are spread over three cells, so nodes at the surface get half as much as inner nodes.
    """
    cell = spacing(x, 4)
    if not cell > 0:
        return []
    lo = x.min(axis=0) - 4 * cell
    at = (x - lo) / cell
    filled = smoothed(scattered(at, tuple((at.max(axis=0) + 6).astype(int))))
    within = _largest(filled, 2)
    fraction = np.divide(filled, within, out=np.zeros_like(filled), where=within > 0)
    across, up = (low + cell * np.arange(n) for low, n in zip(lo, filled.shape, strict=True))
    return _contours(across, up, fraction.T, 0.5)


def _contours(x: np.ndarray, y: np.ndarray, z: np.ndarray, level: float) -> list[np.ndarray]:
    lines: Any = contour_generator(x, y, z).lines(level)
    return lines


def corners(at: np.ndarray, shape: tuple[int, ...]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    first = at.astype(int)
    for corner in product((0, 1), repeat=len(shape)):
        node = first + corner
        yield np.ravel_multi_index(tuple(node.T), shape), np.prod(1 - abs(at - node), axis=1)


def scattered(at: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return nodal sums of linear weights of points at `at`, in cells."""
    sums = np.zeros(int(np.prod(shape)))
    for node, weight in corners(at, shape):
        sums += np.bincount(node, weight, len(sums))
    return sums.reshape(shape)


def _largest(values: np.ndarray, reach: int) -> np.ndarray:
    for axis in [*range(values.ndim)] * reach:
        neighbours = np.maximum(np.roll(values, 1, axis), np.roll(values, -1, axis))
        values = np.maximum(values, neighbours)
    return values


def smoothed(values: np.ndarray) -> np.ndarray:
    for axis in range(values.ndim):
        for _ in range(2):
            neighbours = np.roll(values, 1, axis) + np.roll(values, -1, axis)
            values = 0.5 * values + 0.25 * neighbours
    return values


def zeros(depth: Depth, lo: np.ndarray, hi: np.ndarray, fine: int) -> list[np.ndarray]:
    """Return lines (m, 2) of zero depth between corners `lo` and `hi` (2,), on `fine` steps."""
    steps = np.ceil(fine * (hi - lo) / (hi - lo).max()).astype(int)
    x, y = (np.linspace(*ends) for ends in zip(lo, hi, steps + 1, strict=True))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    depths = depth(places.reshape(-1, 2)).reshape(places.shape[:2])
    return _contours(x, y, depths, 0.0)


def section_lines(depth: Depth, lo: np.ndarray, hi: np.ndarray) -> Iterator[np.ndarray]:
    """Yield lines (m, 3) on the surface of a tool between two corners (3,).

    The lines are sections normal to each axis: at the ends, where faces meet, and between these if
    the surface is curved. A box gives its edges, a ball circles.
    """
    lattice = _lattice_around(depth, lo, hi)
    for axis in range(3) if lattice else ():
        ends = _ends(depth, lattice, axis)
        if ends and ends[0] < ends[1]:
            yield from _sections(depth, lattice, axis, ends, (lo[axis], hi[axis]))


class _Lattice(NamedTuple):
    axes: list[np.ndarray]
    depths: np.ndarray
    lo: np.ndarray
    hi: np.ndarray


def _on_lattice(depth: Depth, axes: list[np.ndarray]) -> np.ndarray:
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return depth(places.reshape(-1, 3)).reshape(places.shape[:3])


def _lattice_around(depth: Depth, lo: np.ndarray, hi: np.ndarray) -> _Lattice | None:
    """Return depths on a lattice around the surface between two corners (3,), or None."""
    for _ in range(3):
        axes = [np.linspace(*ends, COARSE) for ends in zip(lo, hi, strict=True)]
        depths = _on_lattice(depth, axes)
        away = np.abs(depths)
        near = np.nonzero(away < min(np.linalg.norm((hi - lo) / (COARSE - 1)), away.max()))
        if not len(near[0]):
            return None
        lo = np.array([a[max(k.min() - 1, 0)] for a, k in zip(axes, near, strict=True)])
        hi = np.array([a[min(k.max() + 1, COARSE - 1)] for a, k in zip(axes, near, strict=True)])
    return _Lattice(axes, depths, lo, hi)


def _crossed(depths: np.ndarray, axis: int) -> np.ndarray:
    within = np.moveaxis(depths, axis, 0).reshape(depths.shape[axis], -1) > 0
    return np.asarray(within.any(axis=1) & ~within.all(axis=1))


def _ends(depth: Depth, lattice: _Lattice, axis: int) -> list[float]:
    axes, crossed = lattice.axes, np.flatnonzero(_crossed(lattice.depths, axis))
    ends = []
    for k, beyond in ((crossed[0], -1), (crossed[-1], 1)) if len(crossed) else ():
        inner, outer = axes[axis][[k, np.clip(k + beyond, 0, COARSE - 1)]]
        for _ in range(HALVINGS):
            middle = np.array([(inner + outer) / 2])
            depths = _on_lattice(depth, [*axes[:axis], middle, *axes[axis + 1 :]])
            inner, outer = (middle[0], outer) if _crossed(depths, axis)[0] else (inner, middle[0])
        ends.append(inner)
    return ends


def _sections(
    depth: Depth, lattice: _Lattice, axis: int, ends: list[float], cuts: tuple[float, float]
) -> Iterator[np.ndarray]:
    """Yield lines (m, 3) on the surface, in planes normal to an axis.

    Lines on the planes `cuts`, where the surface is cut off, are omitted.
    """
    others = [k for k in range(3) if k != axis]
    lo, hi = lattice.lo[others], lattice.hi[others]
    heights = np.linspace(ends[0], ends[1], BETWEEN + 2)
    apart = (heights[1] - heights[0]) / 2 * np.eye(3)[axis]
    # A section at an end is taken one step inside the tool.
    step = (hi - lo).max() / SECTION
    inset_of = {ends[0]: min(step, apart.sum() / 2), ends[1]: -min(step, apart.sum() / 2)}
    for height in heights:
        cut_off = height in cuts
        inset = 0.0 if cut_off else inset_of.get(height, 0.0)
        for flat in zeros(partial(_section, depth, axis, height + inset), lo, hi, SECTION):
            line = np.insert(flat, axis, height + inset, axis=1)
            if inset:
                offset = inset / 2 * np.eye(3)[axis]
                slope = (depth(line + offset) - depth(line - offset)) / inset
                shows = abs(inset) < step or np.median(np.abs(slope)) < 0.7
            elif not cut_off:
                bend = np.abs(depth(line + apart) + depth(line - apart))
                shows = np.mean(bend > 1e-3 * np.linalg.norm(apart)) > 0.05
            if cut_off or shows:
                line[:, axis] = height
                yield line


def edges(faces: np.ndarray) -> np.ndarray:
    """Return sharp edges (n, 2, 3) of triangles (m, 3, 3), and sections of curved surfaces."""
    corner = np.unique(faces.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    sides = np.sort(corner[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)  # makes equal sides adjacent
    shared = (sides[order[:-1]] == sides[order[1:]]).all(axis=1)
    first, second = order[:-1][shared], order[1:][shared]
    cosine = np.abs((normal[first // 3] * normal[second // 3]).sum(axis=1))
    sharp = first[cosine < SHARP]
    segments = [
        np.stack((faces[sharp // 3, sharp % 3], faces[sharp // 3, (sharp + 1) % 3]), axis=1)
    ]
    bends = (cosine >= SHARP) & (cosine < FLAT)
    smooth = faces[np.unique(np.concatenate([first[bends], second[bends]]) // 3)]
    for axis in range(3) if len(smooth) else ():
        along = smooth[:, :, axis]
        for height in np.linspace(along.min(), along.max(), BETWEEN + 2)[1:-1]:
            crossed = (along > height) != (np.roll(along, -1, axis=1) > height)
            a, b = smooth[crossed], np.roll(smooth, -1, axis=1)[crossed]
            fraction = (height - a[:, axis]) / (b[:, axis] - a[:, axis])
            segments.append((a + fraction[:, None] * (b - a)).reshape(-1, 2, 3))
    return np.concatenate(segments)


def _section(depth: Depth, axis: int, height: float, x: np.ndarray) -> np.ndarray:
    return depth(np.insert(x, axis, height, axis=1))


class Front:
    """Height of the surface nearest to the viewer in each cell, from projected points x (n, 3).

    A point fills its cell and the adjacent ones. Gaps of up to 2 `gaps` cells are closed.
    """

    def __init__(self, x: np.ndarray, low: np.ndarray, high: np.ndarray, cell: float, gaps: int):
        self.low, self.cell = low - 4 * cell, cell
        self.height = np.full(np.ceil((high - self.low) / cell + 4).astype(int), -np.inf)
        np.maximum.at(self.height, self._cells(x), x[:, 2])
        self.height = -_largest(-_largest(self.height, 1 + gaps), gaps)

    def _cells(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        last = np.array(self.height.shape) - 1
        return tuple(np.clip((x[:, :2] - self.low) / self.cell, 0, last).astype(int).T)

    def beside(self, x: np.ndarray) -> np.ndarray:
        return _largest(self.height, 2)[self._cells(x)]

    def outlines(self) -> list[np.ndarray]:
        filled = smoothed(np.isfinite(self.height).astype(float))
        across, up = (
            low + self.cell * (np.arange(n) + 0.5)
            for low, n in zip(self.low, filled.shape, strict=True)
        )
        return _contours(across, up, filled.T, 0.5)

    def hides(self, x: np.ndarray, height: np.ndarray, around: int = 0) -> np.ndarray:
        return -_largest(-self.height, around)[self._cells(x)] > height + 3 * self.cell


def split(line: np.ndarray, hidden: np.ndarray) -> Iterator[tuple[np.ndarray, bool]]:
    turns = np.flatnonzero(np.diff(hidden)) + 1
    for first, end in pairwise([0, *turns, len(line)]):
        yield line[first : end + 1], bool(hidden[first])


def spacing(x: np.ndarray, count: int = 1) -> float:
    if len(x) <= count:
        return 0.0
    near = []
    sample = min(max(DISTANCES // len(x), FEW), SAMPLE, len(x))
    for k in np.linspace(0, len(x) - 1, sample).astype(int):
        square = ((x - x[k]) ** 2).sum(axis=1)
        near.append(np.sqrt(np.partition(square, count)[1 : count + 1]).mean())
    return float(np.median(near))
