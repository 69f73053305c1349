"""Regular grids and their node numbers."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from karamelo_py.points.grid import Grid
from karamelo_py.script.errors import ScriptError

# Points up to this distance past a face (in cells) count as points on the face.
RELATIVE_TOLERANCE = 1e-9
MAX_NODES = 2**31 - 1  # limit of 32-bit numbers in kernels
# Points or nodes per batch: enough to hide NumPy's overhead, few enough for caches and memory.
CHUNK = 1 << 18


class Lattice:
    """A grid of square cells of size `h` from the lower corner of a box.

    The grid extends past the upper corner by less than a cell. `nodes_per_cell` is 1, or 2 with
    additional nodes at cell centres. Each direction has at least `least_nodes` nodes; surplus nodes
    have no mass. Nodes are numbered from `first` and cells from `first_cell`; `shape` and `cells`
    (3,) are their counts per direction, 1 in unused ones. Raises ScriptError for more than
    `MAX_NODES` nodes.
    """

    def __init__(
        self,
        dimension: int,
        lo: Sequence[float] | np.ndarray,
        hi: Sequence[float] | np.ndarray,
        h: float,
        nodes_per_cell: int = 1,
        least_nodes: int = 2,
    ):
        self.dimension = dimension
        self.lo, self.hi = np.zeros((2, 3))
        self.lo[:dimension], self.hi[:dimension] = lo[:dimension], hi[:dimension]
        self.h = float(h)
        self.nodes_per_cell = nodes_per_cell
        self.first = self.first_cell = 0
        lengths = (self.hi - self.lo)[:dimension]
        cells = [max(1, math.ceil(length / h - RELATIVE_TOLERANCE)) for length in lengths]
        nodes = [max(n * nodes_per_cell + 1, least_nodes) for n in cells]
        if math.prod(nodes) > MAX_NODES:
            raise ScriptError(
                f"cell size {h:g} gives a grid of {math.prod(nodes):.3g} nodes",
                argument="h",
                expected=f"at most {MAX_NODES} nodes: a larger h or a smaller domain",
            )
        unused = (1,) * (3 - dimension)
        self.cells = (*cells, *unused)
        self.shape = (*nodes, *unused)

    @property
    def spacing(self) -> float:
        return self.h / self.nodes_per_cell

    @property
    def node_count(self) -> int:
        return math.prod(self.shape)

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """Return indices (n, 3): node (i, j, k) has the number `first` + (i ny + j) nz + k."""
        return np.stack(np.unravel_index(numbers - self.first, self.shape), axis=1)

    def positions(self, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the positions (n, 3) of nodes, by default of all nodes."""
        if numbers is None:
            numbers = self.first + np.arange(self.node_count)
        return self.lo + self.places(numbers) * self.spacing

    def between(self, lo: np.ndarray, hi: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        used = slice(self.dimension)
        corner, shape = self.lo[used], self.shape[used]
        below = (lo[used] - corner) / self.spacing - 1e-6
        above = (hi[used] - corner) / self.spacing + 1e-6
        first = np.ceil(np.clip(below, 0, shape)).astype(int).tolist()
        last = np.floor(np.clip(above, -1, np.array(shape) - 1)).astype(int).tolist()
        if any(a > b for a, b in zip(first, last, strict=True)):
            return
        for index in boxes(first, last, 1):
            number = np.ravel_multi_index(tuple(index.T), shape)
            yield number + self.first, corner + index * self.spacing

    def cells_of(self, x: np.ndarray) -> np.ndarray:
        """Return the cells (n, d) that contain positions; outside the grid, the nearest cells."""
        used = slice(self.dimension)
        cell = np.floor((x - self.lo[used]) / self.h).astype(np.int64)
        return np.clip(cell, 0, np.array(self.cells[used]) - 1)

    def around(self, cells: np.ndarray, steps: Sequence[int]) -> np.ndarray:
        """Return numbers (k, n) of nodes around cells.

        A node is `steps` away, along each axis, from the first node of its cell.
        """
        shape = np.array(self.shape[: self.dimension])
        places = (
            np.clip((cells + np.array(step)) * self.nodes_per_cell, 0, shape - 1)
            for step in itertools.product(steps, repeat=self.dimension)
        )
        return np.array([self.first + np.ravel_multi_index(tuple(p.T), shape) for p in places])

    def numbers(self, real: type) -> Grid:
        size = (self.hi - self.lo) / self.h
        reach = float(np.abs([self.lo, self.hi]).max()) / self.h
        _, ny, nz = self.shape
        slack = max(RELATIVE_TOLERANCE, 8 * np.finfo(real).eps * reach)
        lengths = *self.lo, self.h, 1 / self.h, self.spacing
        return Grid(
            *map(real, lengths),
            *self.cells,
            *map(real, (*size, slack)),
            step_x=ny * nz,
            step_y=nz,
            first=self.first,
            first_cell=self.first_cell,
        )


def table(lattices: Sequence[Lattice], real: type) -> Grid:
    rows = [lattice.numbers(real) for lattice in lattices]
    columns: Any = (np.array(column) for column in zip(*rows, strict=True))
    return Grid(*columns)


def numbered(lattices: Sequence[Lattice]) -> list[Lattice]:
    first = first_cell = 0
    for lattice in lattices:
        lattice.first, lattice.first_cell = first, first_cell
        first += lattice.node_count
        first_cell += math.prod(lattice.cells)
    if first > MAX_NODES:
        raise ScriptError(
            f"the grids have {first:.3g} nodes together", expected=f"at most {MAX_NODES} nodes"
        )
    return list(lattices)


def boxes(first: Sequence[int], last: Sequence[int], weight: int) -> Iterator[np.ndarray]:
    """Yield indices (m, d) from `first` to `last`, last axis fastest; m ~ CHUNK / `weight`."""
    for begin, end in chunks(first, last, weight):
        yield positions(first, last, begin, end)


def chunks(first: Sequence[int], last: Sequence[int], weight: int) -> list[tuple[int, int]]:
    total = math.prod(b - a + 1 for a, b in zip(first, last, strict=True))
    step = max(1, CHUNK // weight)
    return [(begin, min(begin + step, total)) for begin in range(0, total, step)]


def positions(first: Sequence[int], last: Sequence[int], start: int, end: int) -> np.ndarray:
    counts = [b - a + 1 for a, b in zip(first, last, strict=True)]
    return np.stack(np.unravel_index(np.arange(start, end), counts), axis=1) + first
