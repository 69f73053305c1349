"""Fill regions with points in a pattern per cell."""

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.kinematics import free_from
from karamelo_py.scene.clipping import Pieces, clip, join
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.lattice import Lattice, chunks, positions
from karamelo_py.scene.machine_memory import Room
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError

MAX_POINTS = 2**31 - 1
SAMPLE = 4096
LOOKS = 9  # number of times that the sample is doubled, up to a million
FITS_EVERYWHERE = 1_000_000  # number of points that any machine can store
# Above this number, points outside the domain are not counted for the warning.
_MAX_COUNTED = 20_000_000


class Placement(NamedTuple):
    """Points and their initial domains. A value that is equal for all points may be a scalar."""

    x0: Any  # (n, d) positions: array or Filled
    volume: float | np.ndarray  # (n,) volumes per unit thickness or area, without the factor radius
    half_size: np.ndarray  # (n, d) half edges of the initial domains
    lo: np.ndarray  # (d,) lower corner of the solid's box
    hi: np.ndarray
    outside: float = 0
    shape: str = "box"  # "box" or a meshio cell type
    corners: np.ndarray | None = None  # (n, c, d) corners of domains other than boxes
    missed: float = 0


class Filled:
    """Positions (n, d) in a box of cells, stored as bits and computed on request."""

    def __init__(self, first: list[int], last: list[int], corner: np.ndarray, h: float,
                 places: np.ndarray):  # fmt: skip
        self._cells = first, last
        self.chunks = chunks(first, last, len(places))
        self._corner, self._h, self._places = corner, h, places
        self._kept: list[np.ndarray | None] = []
        self._ends = [0]
        self._moved = np.empty(0, np.int64), np.empty((0, len(corner)))
        self._counts = tuple(b - a + 1 for a, b in zip(first, last, strict=True))
        self._ppc = round(len(places) ** (1 / len(corner)))
        self._subs = np.rint((places / h + 0.5) * self._ppc - 0.5).astype(np.int64)
        self._number = np.empty((self._ppc,) * len(corner), np.int64)
        self._number[tuple(self._subs.T)] = np.arange(len(places))

    def candidates(self, begin: int, end: int) -> np.ndarray:
        centre = self._corner + (positions(*self._cells, begin, end) + 0.5) * self._h
        return (centre[:, None, :] + self._places).reshape(-1, len(self._corner))

    def keep(self, kept: np.ndarray) -> None:
        count = int(np.count_nonzero(kept))
        self._kept.append(np.packbits(kept) if 0 < count < len(kept) else None)
        self._ends.append(self._ends[-1] + count)

    def beside(self, number: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the numbers (n,) of positions `step` (n, d) away in the regular pattern, or -1."""
        cell, index_in_cell = self._cell_and_place(number)
        index = cell * self._ppc + self._subs[index_in_cell] + step
        none = ((index < 0) | (index >= np.array(self._counts) * self._ppc)).any(axis=1)
        cell, index_in_cell = np.divmod(np.where(none[:, None], 0, index), self._ppc)
        number = np.ravel_multi_index(tuple(cell.T), self._counts) * len(self._places)
        return np.where(none, -1, number + self._number[tuple(index_in_cell.T)])

    def middles(self, number: np.ndarray) -> np.ndarray:
        cell, index_in_cell = self._cell_and_place(number)
        return self._corner + (cell + self._cells[0] + 0.5) * self._h + self._places[index_in_cell]

    def _cell_and_place(self, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cell, index_in_cell = np.divmod(number, len(self._places))
        return np.array(np.unravel_index(cell, self._counts)).T, index_in_cell

    def move(self, rows: np.ndarray, x: np.ndarray) -> None:
        self._moved = rows, x

    def __len__(self) -> int:
        return self._ends[-1]

    def __getitem__(self, rows: slice) -> np.ndarray:
        begin, end, _ = rows.indices(len(self))
        out = np.empty((max(end - begin, 0), len(self._corner)))
        for k in range(bisect_right(self._ends, begin) - 1, len(self._kept)):
            first, last = self._ends[k : k + 2]
            if first >= end:
                break
            low, high = max(first, begin), min(last, end)
            if low < high:
                out[low - begin : high - begin] = self._some(k, low - first, high - first)
        moved, x = self._moved
        some = slice(*np.searchsorted(moved, [begin, end]))
        out[moved[some] - begin] = x[some]
        return out

    def _some(self, k: int, low: int, high: int) -> np.ndarray:
        start, bits, m = self.chunks[k][0], self._kept[k], len(self._places)
        if bits is None:
            rows = np.arange(low, high)
        else:
            rows = np.flatnonzero(np.unpackbits(bits))[low:high]
        begin, end = int(rows[0]) // m, int(rows[-1]) // m + 1
        x = self.candidates(start + begin, start + end)
        return x[low - begin * m : high - begin * m] if bits is None else x[rows - begin * m]


def lattice_of(region: Region, domain: Domain, h: float, *, apart: bool) -> Lattice:
    d = domain.dimension
    if not apart:
        return Lattice(d, domain.lo, domain.hi, h)
    if region.unknown:
        return Lattice(d, domain.lo, domain.lo, h)
    return Lattice(d, region.lo, region.hi, h)


def offsets(ppc: int, rule: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (ppc,) of points along a unit cell, from its centre, and their lengths.

    Rule ``gauss`` is Gauss-Legendre. The default is Karamelo's rule: equally spaced, except that
    three points are rounded Gauss points with equal lengths.
    """
    if rule == "gauss":
        places, weights = np.polynomial.legendre.leggauss(ppc)
        return places / 2, weights / weights.sum()
    lengths = np.full(ppc, 1 / ppc)
    if rule is None and ppc == 3:
        return np.array([-0.3873, 0.0, 0.3873]), lengths
    return (np.arange(ppc) + 0.5) / ppc - 0.5, lengths


def cell_pattern(
    ppc: int, dimension: int, rule: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and sizes (m, d) in Karamelo's order (y fastest, z slowest)."""
    places, lengths = (_in_order(along, dimension) for along in offsets(ppc, rule))
    return places, lengths if rule == "gauss" else lengths[0]


def _in_order(along: np.ndarray, dimension: int) -> np.ndarray:
    grid = np.stack(np.meshgrid(*[along] * dimension, indexing="ij"), axis=-1)
    points = grid.reshape(-1, dimension)
    return np.ascontiguousarray(points[:, [1, 2, 0]]) if dimension == 3 else points


def fill(
    region: Region,
    domain: Domain,
    lattice: Lattice,
    ppc: int,
    rule: str | None = None,
    room: Callable[[], Room] | None = None,
) -> Placement:
    """Fill a region in chunks of cells, x outermost.

    Raises ScriptError if the points exceed the memory (`room`) or 32-bit numbers.
    """
    dimension, h = domain.dimension, lattice.h
    used = slice(0, dimension)
    placed = Placement(
        x0=np.empty((0, dimension)),
        volume=(h / ppc) ** dimension,
        half_size=np.full(dimension, h / (2 * ppc)),
        lo=region.lo[used],
        hi=region.hi[used],
    )
    lo, hi = region.box_lo[used], region.box_hi[used]
    corner = lattice.lo[used]
    last_cell = np.array(lattice.cells[used]) - 1
    if region.unknown or (lo > hi).any():
        return placed
    # The range has one more cell at both ends, so that round-off loses no point on a face.
    first = np.floor((lo - corner) / h) - 1
    last = np.floor((hi - corner) / h) + 1
    # An open region ends at the domain. Other regions give a warning for points outside the domain.
    first = np.where(np.isinf(lo), 0, first)
    last = np.where(np.isinf(hi), last_cell, last)
    inner_first = np.clip(first, 0, last_cell + 1)
    inner_last = np.clip(last, -1, last_cell)
    inner = math.prod(np.maximum(inner_last - inner_first + 1, 0).tolist()) * ppc**dimension
    if inner > MAX_POINTS * 4:
        raise ScriptError(
            f"about {inner:.3g} points would be needed", expected=f"at most {MAX_POINTS}"
        )
    # No warning for points beyond an axis or plane of symmetry, where the mirror image is.
    ends = domain.lo[used], domain.hi[used]
    with np.errstate(invalid="ignore"):
        at_side = [np.abs((lo + hi) / 2 - end) <= domain.tolerance for end in ends]
    at_side[0] |= np.arange(dimension) < free_from(domain.kin)
    reaches_out = (lo < ends[0] - domain.tolerance) & np.isfinite(lo) & ~at_side[0]
    reaches_out |= (hi > ends[1] + domain.tolerance) & np.isfinite(hi) & ~at_side[1]
    whole = math.prod(np.maximum(last - first + 1, 0).tolist()) * float(ppc) ** dimension
    near = max(np.abs(first).max(), np.abs(last).max()) < 2**53  # doubles are exact here
    counted = reaches_out.any() and near and whole <= max(_MAX_COUNTED, 4 * inner)
    if not counted:
        first, last = inner_first, inner_last
    open_lo = np.where(np.isinf(lo) | at_side[0], ends[0] - domain.tolerance, -np.inf)
    open_hi = np.where(np.isinf(hi) | at_side[1], ends[1] + domain.tolerance, np.inf)

    memory = room() if room is not None and inner > FITS_EVERYWHERE else None
    if memory is not None:
        least = _least(region, domain, h / ppc, memory.most)
        if least > memory.most:
            raise memory.refused(least)
        memory.tell(least)
    places, sizes = (of_unit * h for of_unit in cell_pattern(ppc, dimension, rule))
    even = sizes.ndim == 1
    x0 = Filled([int(i) for i in first], [int(i) for i in last], corner, h, places)
    numbers: list[np.ndarray] = []
    left: list[tuple[np.ndarray, Pieces]] = []
    outside = 0.0
    for begin, end in x0.chunks:
        x = x0.candidates(begin, end)
        if rule == "cut":
            left.append(clip(region, x, h / ppc, begin * len(places)))
            if not counted:
                continue
        kept = region.inside(x)
        in_domain = domain.contains(x)
        if counted:
            beyond = x[kept & ~in_domain]
            outside += int(((beyond >= open_lo) & (beyond <= open_hi)).all(axis=1).sum())
        if rule == "cut":
            continue
        kept &= in_domain
        x0.keep(kept)
        if memory is not None and len(x0) > memory.most:
            raise memory.refused(len(x0))
        if not even:
            numbers.append(np.flatnonzero(kept) % len(places))
    if reaches_out.any() and not counted:
        outside = math.inf
    placed = placed._replace(x0=x0, outside=outside)
    if left:
        return _cut_off(placed, region, h / ppc, left)
    if even:
        return placed
    sizes = sizes[np.concatenate(numbers)] if numbers else np.empty((0, dimension))
    return placed._replace(volume=sizes.prod(axis=1), half_size=sizes / 2)


def _least(region: Region, domain: Domain, spacing: float, most: float) -> float:
    """Return a lower bound of the number of points, from samples that grow up to `most`."""
    used = slice(0, domain.dimension)
    lo, size = region.lo[used], region.hi[used] - region.lo[used]
    places, inside, whole = 0, 0, math.prod((size / spacing).tolist())
    random = np.random.default_rng(1)
    for _ in range(LOOKS):
        x = lo + size * random.random((max(SAMPLE, places), domain.dimension))
        places, inside = places + len(x), inside + int(region.inside(x).sum())
        fraction = inside / places
        unsure = 4 * math.sqrt(max(fraction * (1 - fraction), 1 / places) / places)
        least = (fraction - unsure) * whole
        if least > most or (fraction + unsure) * whole <= most:
            break
    return least


def _cut_off(
    placed: Placement, region: Region, size: float, left: list[tuple[np.ndarray, Pieces]]
) -> Placement:
    x0, d = placed.x0, region.dimension
    pieces = Pieces(*map(np.concatenate, zip(*(piece for _, piece in left), strict=True)))
    pieces = join(region, x0, pieces)
    begin, rows = 0, []
    for kept, _ in left:
        some = slice(*np.searchsorted(pieces.number, [begin, begin + len(kept)]))
        number = pieces.number[some] - begin
        kept[number] = pieces.fraction[some] > 0
        if len(number):
            rows.append(len(x0) - 1 + np.cumsum(kept)[number[kept[number]]])
        x0.keep(kept)
        begin += len(kept)
    filled = pieces.fraction > 0
    row = np.concatenate(rows) if rows else np.empty(0, np.int64)
    x0.move(row, pieces.middle[filled])
    fraction = np.ones((len(x0), 1))
    fraction[row, 0] = pieces.fraction[filled]
    half = np.ones((len(x0), 1))
    half[row, 0] = pieces.fraction[filled] ** (1 / d)
    return placed._replace(
        volume=placed.volume * fraction[:, 0], half_size=size / 2 * half, missed=pieces.missed(size)
    )
