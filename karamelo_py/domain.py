"""The domain: the box that holds everything, and the background grid laid over it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from karamelo_py.script.errors import ScriptError

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

# A point this far (in cells) beyond a face still counts as lying on it.
RELATIVE_TOLERANCE = 1e-9
# Node numbers have to fit into 32 bits wherever a kernel packs them.
MAX_NODES = 2**31 - 1
# Points or nodes looked at together: large enough for NumPy, small enough for the cache and memory.
CHUNK = 1 << 18


class Domain:
    """A box with a grid of square cells that starts at its lower corner.

    The grid covers the whole box; when a side is not a multiple of `h` it reaches over the upper
    corner by less than one cell.

    Parameters
    ----------
    dimension
        1, 2 or 3.
    lo, hi
        Corners, one number per dimension.
    h
        Cell size; None leaves the grid to the first solid (the older language).

    Attributes
    ----------
    lo, hi : ndarray (3,)
        Corners; 0 in unused directions.
    shape : tuple of 3 int
        Nodes per direction, 1 in unused directions.
    cells : tuple of 3 int
        Cells per direction, 1 in unused directions.
    axisymmetric : bool
        Whether x is a radius and y the axis.
    """

    axisymmetric = False

    def __init__(self, dimension: int, lo: Sequence[float], hi: Sequence[float], h: float | None):
        self.dimension = dimension
        self.lo = np.zeros(3)
        self.hi = np.zeros(3)
        self.lo[:dimension] = lo
        self.hi[:dimension] = hi
        self.h: float | None = None
        self.shape: tuple[int, int, int] = (1, 1, 1)
        self.cells: tuple[int, int, int] = (1, 1, 1)
        if h is not None:
            self.set_cell_size(h)

    def set_cell_size(self, h: float) -> None:
        """Lay the grid.

        Raises
        ------
        ScriptError
            When there would be more nodes than can be counted.
        """
        lengths = (self.hi - self.lo)[: self.dimension]
        cells = [max(1, math.ceil(length / h - RELATIVE_TOLERANCE)) for length in lengths]
        nodes = math.prod(n + 1 for n in cells)
        if nodes > MAX_NODES:
            raise ScriptError(
                f"cell size {h:g} gives a grid of {nodes:.3g} nodes",
                argument="h",
                expected=f"at most {MAX_NODES} nodes: a larger h or a smaller domain",
            )
        self.h = float(h)
        unused = (1,) * (3 - self.dimension)
        self.cells = (*cells, *unused)
        self.shape = (*(n + 1 for n in cells), *unused)

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return math.prod(self.shape)

    @property
    def tolerance(self) -> float:
        """Distance from a face within which a point lies on it."""
        size = self.h if self.h is not None else float((self.hi - self.lo).max()) * 1e-3
        return RELATIVE_TOLERANCE * size

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which of the positions `x` (n, >= dimension) lie in the closed box: (n,) bool."""
        tolerance = self.tolerance
        inside = np.ones(len(x), dtype=bool)
        for axis in range(self.dimension):
            inside &= x[:, axis] >= self.lo[axis] - tolerance
            inside &= x[:, axis] <= self.hi[axis] + tolerance
        return inside

    def node_positions(self) -> np.ndarray:
        """Positions of all nodes, (n, 3); node (i, j, k) has the number (i ny + j) nz + k."""
        positions = np.empty((*self.shape, 3))
        for axis, count in enumerate(self.shape):
            along = [1, 1, 1]
            along[axis] = count
            positions[..., axis] = (self.lo[axis] + np.arange(count) * (self.h or 0.0)).reshape(
                along
            )
        return positions.reshape(-1, 3)

    def nodes_between(
        self, lo: np.ndarray, hi: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Nodes in a box, some thousand at a time: their numbers (m,) and positions (m, dimension).

        `lo` and `hi` (3,) may be infinite. Nodes come in the order of their numbers.
        """
        first, last = [], []
        for axis in range(self.dimension):
            top = self.shape[axis] - 1
            below = (lo[axis] - self.lo[axis]) / self.h - 1e-6
            above = (hi[axis] - self.lo[axis]) / self.h + 1e-6
            first.append(math.ceil(min(max(below, 0), top + 1)))
            last.append(math.floor(min(max(above, -1), top)))
        if any(a > b for a, b in zip(first, last, strict=True)):
            return
        _, *trailing = self.shape[: self.dimension]
        for index in boxes(first, last, 1):
            number = index[:, 0].copy()
            for axis, count in enumerate(trailing, start=1):
                number *= count
                number += index[:, axis]
            yield number, self.lo[: self.dimension] + index * self.h


def boxes(first: Sequence[int], last: Sequence[int], weight: int) -> Iterator[np.ndarray]:
    """Integer positions between `first` and `last` (inclusive), the last axis fastest, in chunks.

    Each chunk is an int64 array (m, d) with about CHUNK / `weight` rows, so that `weight` items
    for every position stay a bounded amount of memory however large the box is.
    """
    counts = [b - a + 1 for a, b in zip(first, last, strict=True)]
    total = math.prod(counts)
    step = max(1, CHUNK // weight)
    for start in range(0, total, step):
        number = np.arange(start, min(start + step, total), dtype=np.int64)
        index = np.empty((len(number), len(counts)), dtype=np.int64)
        for axis in range(len(counts) - 1, -1, -1):
            number, index[:, axis] = np.divmod(number, counts[axis])
            index[:, axis] += first[axis]
        yield index


def require_domain(hub: Hub) -> Domain:
    """The domain of the scene.

    Raises
    ------
    ScriptError
        When there is none yet.
    """
    if hub.domain is None:
        announced = getattr(hub, "announced_dimension", None)
        if announced:
            raise ScriptError(
                f"the domain has no size yet: dimension({announced}) only says how many "
                "directions there are",
                expected="create_domain(...) or the longer form of dimension(...) before this line",
            )
        raise ScriptError(
            "there is no domain yet",
            expected="dimension(...) before this line, such as "
            "dimension(2, xmin, xmax, ymin, ymax, h)",
        )
    return hub.domain


def require_grid(hub: Hub) -> Domain:
    """The domain of the scene with its grid.

    Raises
    ------
    ScriptError
        When there is no domain, or no cell size yet.
    """
    domain = require_domain(hub)
    if domain.h is None:
        raise ScriptError(
            "the grid has no cell size yet",
            expected="h as the last argument of create_domain, or a solid before this line",
        )
    return domain
