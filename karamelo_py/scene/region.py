"""Base class of regions: an inside test, a bounding box, and an optional inversion."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.surfaces import Outside
from karamelo_py.language.arguments import Named
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.scene.domain import require_domain
from karamelo_py.script.errors import ScriptError

EXTERIOR = "exterior"
HALVINGS = 12  # bisections along a line that crosses a surface


class Region(Named):
    """Base of region styles, which override `contains`.

    `lo` and `hi` are corners of a bounding box, one number per dimension, infinite if open. An
    `exterior` region is the outside of the shape; `parts` are regions that it is made of.
    """

    radius = 0.0
    axis: Any = None  # of a cylinder in 3D: its direction, and its two middle coordinates
    skin: Any = None  # the surface of a region from a file
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
        self.domain = require_domain(hub)
        self.exterior = exterior
        self.dimension = dimension = self.domain.dimension
        self.parts = tuple(parts)
        # Its position depends on results that a rehearsal does not have.
        self.unknown: bool = bool(np.isnan([*lo, *hi]).any()) or any(p.unknown for p in self.parts)
        # Bounding box, infinite if open; 0 in unused directions.
        self.box_lo, self.box_hi = np.zeros((2, 3))
        self.box_lo[:dimension] = -np.inf if exterior else lo
        self.box_hi[:dimension] = np.inf if exterior else hi

    @property
    def tolerance(self) -> float:
        """Distance outside a face at which a point still counts as inside, for round-off."""
        return self.domain.tolerance

    @property
    def lo(self) -> np.ndarray:
        """Lower corner (3,) of the part in the domain."""
        return np.clip(self.box_lo, self.domain.lo, self.domain.hi)

    @property
    def hi(self) -> np.ndarray:
        """Upper corner (3,) of the part in the domain."""
        return np.clip(self.box_hi, self.domain.lo, self.domain.hi)

    @property
    def aligned(self) -> bool:
        """True if all faces are known to be parallel to the axes."""
        return bool(self.parts) and all(part.aligned for part in self.parts)

    @property
    def flat(self) -> bool:
        """True if it or one of its parts consists of lines or surfaces, without an inside."""
        return any(part.flat for part in self.parts)

    @property
    def from_file(self) -> bool:
        """True if it or one of its parts comes from a file."""
        return any(part.from_file for part in self.parts)

    @property
    def volume(self) -> float | None:
        """Length, area or volume of the part in the domain; None if unknown."""
        return None

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Test which positions `x` (n, >= dimension) are in or on the shape itself: (n,) bool."""
        raise NotImplementedError

    def inside(self, x: np.ndarray) -> np.ndarray:
        """Test which positions `x` (n, >= dimension) belong to the region: (n,) bool."""
        inside = self.contains(x)
        return ~inside if self.exterior else inside

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions `x` (n, >= dimension) in the shape, negative outside: (n,).

        A lower bound of the distance to the surface, up to `reach`; linear in `x` near plane parts
        of the surface. Ignores `exterior`. The default uses `contains` along the axes, and misses
        what is thinner than `reach`.
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

    def shape(self) -> Any:
        """Return what `kernels.surfaces.depth` takes for `distance` (no `exterior`), or None."""
        return None

    def outline(self) -> Any:
        """The same for `depth`."""
        shape = self.shape()
        return Outside(shape) if self.exterior and shape is not None else shape

    def depth(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions in the region, see `distance`: (n,)."""
        depth = self.distance(x, reach)
        return -depth if self.exterior else depth


def split_exterior(arguments: Sequence[Argument]) -> tuple[Sequence[Argument], bool]:
    """Split off a final word ``exterior``: the other arguments, and whether it was there."""
    if arguments and arguments[-1].word() == EXTERIOR:
        return arguments[:-1], True
    return arguments, False


def check_order(lo: float, hi: float, names: Sequence[str], argument: int) -> None:
    """Refuse a lower end (`argument` is its number) above the upper end, the next argument."""
    if lo > hi:
        raise ScriptError(
            f"{names[argument]} = {lo:g} is above {names[argument + 1]} = {hi:g}",
            argument=argument,
            expected=f"{names[argument]} <= {names[argument + 1]}",
        )


def check_radius(radius: float, **where: Any) -> None:
    """Refuse a radius that is not positive; `where` gives the place."""
    if radius <= 0:
        raise ScriptError(f"R = {radius:g} must be above 0", expected="a radius above 0", **where)


def below(x: np.ndarray, centre: Sequence[float], axes: Sequence[int], radius: float):
    """Return the depth of positions below the surface of a ball or cylinder: (n,)."""
    square = np.zeros(len(x))
    for axis, middle in zip(axes, centre, strict=True):
        square += (x[:, axis] - middle) ** 2
    return radius - np.sqrt(square)
