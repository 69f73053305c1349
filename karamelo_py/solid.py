"""Solids: bodies of material points, and where the points are put."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Annotated

import numpy as np

from karamelo_py.domain import Domain, boxes, require_domain
from karamelo_py.forms import finite
from karamelo_py.material import Material
from karamelo_py.points.materials import specific_volume
from karamelo_py.regions.base import Region, look_up
from karamelo_py.script.errors import Place, ScriptError
from karamelo_py.signature import Argument, AtLeast, Positive

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

MAX_POINTS = 2**31 - 1
_SAMPLE = 5000
# Beyond this many candidates the points outside the domain are no longer counted, only mentioned.
_MAX_COUNTED = 20_000_000


class Solid:
    """A body of points that fills a region, `ppc` points per cell and direction.

    Parameters
    ----------
    region
        ID of the region to fill.
    ppc
        Points per cell in each direction: 2 gives 4 points per cell in 2D, 8 in 3D.
    material
        ID of the material.
    h
        Cell size. With a grid shared by all solids (ulmpm) it must be that of the domain.
    T0
        Initial temperature.

    Attributes
    ----------
    index : int
        0 for the first solid made, and so on.
    first_id : int
        Number (from 0) of its first point; point ids are these numbers plus 1.
    x0 : ndarray (n, dimension)
        Reference positions.
    point_volume, point_mass : float
        Volume and mass of each point (per unit thickness in 2D, per unit area in 1D).
    """

    syntax = "regionID, ppc, material, h[, T0]"
    id: str = ""
    place: Place | None = None

    def __init__(
        self,
        hub: Hub,
        region: Region,
        ppc: Annotated[int, AtLeast(1)],
        material: Material,
        h: Annotated[float, Positive],
        T0: float = 0.0,
    ):
        domain = require_domain(hub)
        for name, value in (("h", h), ("T0", T0)):
            finite(hub, value, name)
        if domain.h is None:
            domain.set_cell_size(h)
        elif abs(h - domain.h) > 1e-9 * domain.h:
            raise ScriptError(
                f"cell size {h:g} differs from that of the domain's grid, {domain.h:g}, "
                "which all solids share",
                argument="h",
                expected=f"{domain.h:g}, as in dimension(...)",
            )
        self.region = region
        self.ppc = ppc
        self.material = material
        self.h = domain.h
        self.T0 = T0
        self.index = len(hub.solids)
        self.first_id = sum(len(other.x0) for other in hub.solids.values())
        self.point_volume = (self.h / ppc) ** domain.dimension
        self.point_mass = self.point_volume / float(specific_volume(material.law))
        self.x0, outside = fill(region, domain, ppc)
        if not len(self.x0) and not region.unknown:
            raise ScriptError(
                "the solid has no points: "
                + ("all of them lie outside the domain" if outside else _why_empty(region, domain)),
                argument="region",
                expected=f"a region that holds points of the grid with cell size {self.h:g} and "
                f"{ppc} per cell and direction, inside the domain",
            )
        if self.first_id + len(self.x0) > MAX_POINTS:
            raise ScriptError(f"the scene has more than {MAX_POINTS} points", argument="h")
        if outside:
            hub.warn(
                f"{_counted(outside)} of region '{region.id}' outside the domain "
                "left out of the solid",
                hint="make the domain larger or the region smaller",
            )

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.x0)

    @property
    def volume0(self) -> np.ndarray:
        """Initial volumes (n,), made anew at each call."""
        return np.full(len(self.x0), self.point_volume)

    @property
    def mass(self) -> np.ndarray:
        """Masses (n,), made anew at each call."""
        return np.full(len(self.x0), self.point_mass)

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Solid:
        """The solid that `argument` names."""
        return look_up(hub.solids, argument)


def coinciding(a: Solid, b: Solid) -> bool:
    """Whether points of `a` lie where points of `b` are; of many points, a sample is looked at."""
    if not len(a.x0) or not len(b.x0):
        return False
    lo = np.maximum(a.x0.min(axis=0), b.x0.min(axis=0))
    hi = np.minimum(a.x0.max(axis=0), b.x0.max(axis=0))
    if (lo > hi).any():
        return False
    inside = [x[((x >= lo) & (x <= hi)).all(axis=1)] for x in (a.x0, b.x0)]
    sample = inside[0][:: max(1, len(inside[0]) // _SAMPLE)]
    return bool(np.isin(_keys(sample, a.h), _keys(inside[1], a.h)).any())


def _keys(x: np.ndarray, h: float) -> np.ndarray:
    """A number (n,) for each position, equal for positions that differ by rounding only."""
    places = np.rint(x * (1e4 / h)).astype(np.int64)
    # Primes keep places apart; the product may overflow, which only mixes the bits.
    return places @ np.array([1, 1_000_003, 998_244_353_001], np.int64)[: x.shape[1]]


def _counted(outside: float) -> str:
    if math.isinf(outside):
        return "points"
    return "1 point" if outside == 1 else f"{outside:.0f} points"


def _why_empty(region: Region, domain: Domain) -> str:
    used = slice(0, domain.dimension)
    if (region.box_lo > region.box_hi)[used].any():
        return f"region '{region.id}' is empty"
    return f"no point lies in region '{region.id}'"


def offsets(ppc: int) -> np.ndarray:
    """Places of `ppc` points along one cell of size 1, measured from its centre: (ppc,).

    Equally spaced, but for 3, which are the Gauss points of order 3 as Karamelo writes them.
    """
    if ppc == 3:
        return np.array([-0.3873, 0.0, 0.3873])
    return (np.arange(ppc) + 0.5) / ppc - 0.5


def cell_pattern(ppc: int, dimension: int) -> np.ndarray:
    """Places of the points of one cell of size 1, measured from its centre: (ppc^d, d).

    In Karamelo's order: x before y; in 3D the lowest z first.
    """
    along = offsets(ppc)
    if dimension == 3:
        return np.array([(x, y, z) for z, x, y in itertools.product(along, repeat=3)])
    return np.array(list(itertools.product(along, repeat=dimension)))


def fill(region: Region, domain: Domain, ppc: int) -> tuple[np.ndarray, float]:
    """Positions of the points that fill `region`, and how many more would lie outside the domain.

    Cells are counted from the lower corner of the domain, x outermost, then y, then z. Only cells
    that the box around the region reaches are looked at, a bounded number at a time.

    Returns
    -------
    x0 : ndarray (n, dimension)
    outside : float
        Points of the region that were left out; inf when there are too many to count.

    Raises
    ------
    ScriptError
        When there would be more points than can be numbered.
    """
    dimension, h = domain.dimension, domain.h
    lo, hi = region.box_lo[:dimension], region.box_hi[:dimension]
    corner, end = domain.lo[:dimension], domain.hi[:dimension]
    last_cell = np.array(domain.cells[:dimension]) - 1
    if region.unknown or (lo > hi).any():
        return np.empty((0, dimension)), 0
    # One cell more on either side: rounding must not lose a point that lies on a face.
    first = np.floor((lo - corner) / h) - 1
    last = np.floor((hi - corner) / h) + 1
    # An open side ends at the domain; a closed one may reach beyond it, and then we say so.
    first = np.where(np.isinf(lo), 0, first)
    last = np.where(np.isinf(hi), last_cell, last)
    inner_first = np.clip(first, 0, last_cell + 1)
    inner_last = np.clip(last, -1, last_cell)
    inner = math.prod(np.maximum(inner_last - inner_first + 1, 0).tolist()) * ppc**dimension
    if inner > MAX_POINTS * 4:
        raise ScriptError(
            f"about {inner:.3g} points would be needed", expected=f"at most {MAX_POINTS}"
        )
    reaches_out = (lo < corner - domain.tolerance) & np.isfinite(lo)
    reaches_out |= (hi > end + domain.tolerance) & np.isfinite(hi)
    whole = math.prod(np.maximum(last - first + 1, 0).tolist()) * float(ppc) ** dimension
    counted = reaches_out.any() and whole <= max(_MAX_COUNTED, 4 * inner)
    if not counted:
        first, last = inner_first, inner_last

    pattern = cell_pattern(ppc, dimension) * h
    chunks: list[np.ndarray] = []
    outside = 0.0
    for index in boxes([int(i) for i in first], [int(i) for i in last], len(pattern)):
        centre = corner + (index + 0.5) * h
        x = (centre[:, None, :] + pattern).reshape(-1, dimension)
        x = x[region.inside(x)]
        in_domain = domain.contains(x)
        if not in_domain.all():
            if counted:
                outside += _beyond_closed_sides(x[~in_domain], lo, hi, domain)
            x = x[in_domain]
        if len(x):
            chunks.append(x)
    if reaches_out.any() and not counted:
        outside = math.inf
    return _joined(chunks, dimension), outside


def _beyond_closed_sides(x: np.ndarray, lo: np.ndarray, hi: np.ndarray, domain: Domain) -> int:
    """How many of `x` lie outside the domain across sides where the region is closed."""
    beyond = np.zeros(len(x), dtype=bool)
    within_open = np.ones(len(x), dtype=bool)
    for axis in range(domain.dimension):
        below = x[:, axis] < domain.lo[axis] - domain.tolerance
        above = x[:, axis] > domain.hi[axis] + domain.tolerance
        for out, end in ((below, lo[axis]), (above, hi[axis])):
            if np.isfinite(end):
                beyond |= out
            else:
                within_open &= ~out
    return int(np.count_nonzero(beyond & within_open))


def _joined(chunks: list[np.ndarray], dimension: int) -> np.ndarray:
    """The chunks in one array; each is freed once copied, so that memory holds the points once."""
    x0 = np.empty((sum(len(chunk) for chunk in chunks), dimension))
    start = 0
    chunks.reverse()
    while chunks:
        chunk = chunks.pop()
        x0[start : start + len(chunk)] = chunk
        start += len(chunk)
    return x0
