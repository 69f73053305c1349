"""Base class of regions: inside test, bounding box, inversion."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.surfaces import Outside
from karamelo_py.language.arguments import Named
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.script.errors import ScriptError

EXTERIOR = "exterior"
HALVINGS = 12  # bisections that locate a surface


class Region(Named):
    """Base of region styles, which override `contains`.

    `lo` and `hi` (d,) bound the shape; they are infinite where it is open. `exterior` inverts the
    region. `parts` are the regions that it combines.
    """

    skin: Any = None  # `Skin` of a region from a file
    catalogue = "regions"

    def __init__(
        self,
        hub: Scene,
        lo: Sequence[float],
        hi: Sequence[float],
        *,
        exterior: bool = False,
        parts: "Sequence[Region]" = (),
    ):
        self.hub = hub
        self.domain = hub.require_domain()
        self.exterior = exterior
        self.dimension = dimension = self.domain.dimension
        self.parts = tuple(parts)
        self.unknown: bool = bool(np.isnan([*lo, *hi]).any()) or any(p.unknown for p in self.parts)
        # Bounding box, infinite where it is open, 0 in unused directions.
        self.box_lo, self.box_hi = np.zeros((2, 3))
        self.box_lo[:dimension] = -np.inf if exterior else lo
        self.box_hi[:dimension] = np.inf if exterior else hi

    @property
    def tolerance(self) -> float:
        return self.domain.tolerance

    @property
    def lo(self) -> np.ndarray:
        return np.clip(self.box_lo, self.domain.lo, self.domain.hi)

    @property
    def hi(self) -> np.ndarray:
        return np.clip(self.box_hi, self.domain.lo, self.domain.hi)

    @property
    def aligned(self) -> bool:
        """True if all faces are known to be parallel to the axes."""
        return bool(self.parts) and all(region.aligned for region in self.parts)

    @property
    def sheet(self) -> np.ndarray | None:
        """Simplices (m, d, d) if the region is a set of faces, without a volume; otherwise None."""
        return None

    @property
    def flat(self) -> bool:
        """True if a part is a line or surface, which has no inside."""
        return any(region.flat for region in self.parts)

    @property
    def from_file(self) -> bool:
        return any(region.from_file for region in self.parts)

    @property
    def volume(self) -> float | None:
        """Volume in the domain; None if it is not known."""
        return None

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Return the mask (n,) of `x` (n, >= d) in or on the shape, ignoring `exterior`."""
        raise NotImplementedError

    def inside(self, x: np.ndarray) -> np.ndarray:
        """Return the mask (n,) of positions `x` (n, >= d) in the region."""
        inside = self.contains(x)
        return ~inside if self.exterior else inside

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth (n,) of `x` (n, >= d), negative outside, ignoring `exterior`.

        Depths may be underestimated and cut off at `reach`, but must be linear near plane parts of
        the surface. The default tests `contains` along the axes, and misses thinner shapes.
        """
        d = self.dimension
        reach *= math.sqrt(d)
        inside = self.contains(x)
        near = np.full((len(x), 2 * d), reach)
        for k, way in enumerate(np.concatenate([np.eye(d), -np.eye(d)])):
            other = np.flatnonzero(self.contains(x[:, :d] + reach * way) != inside)
            low, high = np.zeros(len(other)), np.full(len(other), reach)
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                same = self.contains(x[other, :d] + middle[:, None] * way) == inside[other]
                low, high = np.where(same, middle, low), np.where(same, high, middle)
            near[other, k] = high
        return np.where(inside, 1, -1) * near.min(axis=1) / math.sqrt(d)

    def coincides(self, other: Any, x: np.ndarray) -> np.ndarray | None:
        """Return the mask (n,) of positions where both surfaces coincide, or None if unknown."""
        return None

    def shape(self) -> Any:
        """Return this shape for `kernels.surfaces.depth`, or None if it has no kernel."""
        return None

    def outline(self) -> Any:
        shape = self.shape()
        return Outside(shape) if self.exterior and shape is not None else shape

    def depth(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth (n,) of `x` in the region, as `distance` does, but with `exterior`."""
        depth = self.distance(x, reach)
        return -depth if self.exterior else depth


def split_exterior(arguments: Sequence[Argument]) -> tuple[Sequence[Argument], bool]:
    if arguments and arguments[-1].word() == EXTERIOR:
        return arguments[:-1], True
    return arguments, False


def check_order(lo: float, hi: float, names: Sequence[str], argument: int) -> None:
    """Raise ScriptError if a lower end, argument number `argument`, is above its upper end."""
    if lo > hi:
        raise ScriptError(
            f"{names[argument]} = {lo:g} is above {names[argument + 1]} = {hi:g}",
            argument=argument,
            expected=f"{names[argument]} <= {names[argument + 1]}",
        )


def check_radius(radius: float, **where: Any) -> None:
    if radius <= 0:
        raise ScriptError(f"R = {radius:g} must be above 0", expected="a radius above 0", **where)


def below(x: np.ndarray, centre: Sequence[float], axes: Sequence[int], radius: float):
    square = np.zeros(len(x))
    for axis, middle in zip(axes, centre, strict=True):
        square += (x[:, axis] - middle) ** 2
    return radius - np.sqrt(square)
