"""Region styles block, cylinder, sphere, plane; combinations."""

import math
from collections.abc import Sequence

import numpy as np

from karamelo_py.kernels.surfaces import Common, Convex, HalfSpace, Joined, Outside
from karamelo_py.language.by_dimension import Forms
from karamelo_py.language.signature import Argument
from karamelo_py.scene import region
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

_NAMES = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")


class Primitive(region.Region):
    """Base of shapes that are bounded by planes along some axes and round in the other axes."""

    slabs: Sequence[tuple] = ()  # (axis, lower end, upper end)
    across: Sequence[int] = ()  # axes across which the shape is round
    centre: Sequence[float] = ()
    radius: float

    @property
    def aligned(self) -> bool:
        return not self.across or self.dimension == 1

    @property
    def volume(self) -> float | None:
        if self.exterior or self.unknown:
            return None
        sides = (self.hi - self.lo)[: self.dimension]
        if not self.across:
            return float(np.prod(sides))
        if (sides < (self.box_hi - self.box_lo)[: self.dimension]).take(self.across).any():
            return None  # no volume: the domain cuts the shape
        n = len(self.across)
        ball = math.pi ** (n / 2) / math.gamma(n / 2 + 1) * self.radius**n
        return ball * math.prod(float(sides[axis]) for axis, *_ in self.slabs)

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.distance(x, np.inf) >= -self.tolerance

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        depth = np.full(len(x), reach)
        if self.across:
            depth = region.below(x, self.centre, self.across, self.radius)
        for axis, lo, hi in self.slabs:
            np.minimum(depth, x[:, axis] - lo, out=depth)
            np.minimum(depth, hi - x[:, axis], out=depth)
        return depth

    def shape(self) -> Convex | HalfSpace:
        d = self.dimension
        planes = [plane for slab in self.slabs for plane in _between(d, *slab)]
        across, centre = np.zeros((2, d))
        across[list(self.across)] = 1
        centre[list(self.across)] = self.centre
        radius = float(self.radius) if len(self.across) else math.inf
        return Convex(np.array(planes).reshape(-1, d + 1), across, centre, radius)


def _between(d: int, axis: int, lo: float, hi: float) -> list[np.ndarray]:
    """Return the planes (d + 1,) of a slab, as in `Convex`; open ends have none."""
    normal = np.eye(d)[axis]
    return [np.append(n, at) for n, at in ((normal, lo), (-normal, -hi)) if math.isfinite(at)]


class BlockRegion(Primitive):
    """A box with faces normal to the axes, including its faces.

    Parameters
    ----------
    bounds
        In 1D ``xlo, xhi``; in 2D ``xlo, xhi, ylo, yhi``; in 3D ``xlo, xhi, ylo, yhi, zlo, zhi``.
        Each is a number, or ``INF`` (or ``EDGE``) for the edge of the domain. Equal numbers make a
        plane, a line or a point, for groups of nodes. With ``exterior`` as the last argument:
        everything outside.

    Example
    -------
    region(bar, block, 0, 1, 0, 0.2)
    region(left, block, 0, 0, INF, INF)
    region(rest, block, 0.2, 0.8, 0.2, 0.8, exterior)

    See Also
    --------
    cylinder, sphere
    """

    syntax = "xlo, xhi[, ylo, yhi[, zlo, zhi]][, exterior]"
    forms = Forms(
        "region(ID, block, {names}[, exterior])",
        {dimension: _NAMES[: 2 * dimension] for dimension in (1, 2, 3)},
        open_ends={name: -math.inf if name.endswith("lo") else math.inf for name in _NAMES},
    )

    def __init__(self, hub: Hub, *bounds: Argument):
        numbers, exterior = region.split_exterior(bounds)
        ends = tuple(self.forms.read(hub, numbers, hub.require_domain().dimension).values())
        self.slabs = [(k // 2, *ends[k : k + 2]) for k in range(0, len(ends), 2)]
        for axis, *slab in self.slabs:
            region.check_order(*slab, _NAMES, 2 * axis)
        super().__init__(hub, ends[::2], ends[1::2], exterior=exterior)


class Cylinder(Primitive):
    """A disk in 2D, or a cylinder along one of the axes in 3D, including its surface.

    Parameters
    ----------
    shape
        In 2D ``xc, yc, R``: centre and radius. In 3D ``axis, c1, c2, R, lo, hi``: the word x, y or
        z, the centre in the other directions (in the order x, y, z), the radius, and the ends,
        which may be ``INF`` (or ``EDGE``). ``exterior`` as the last argument: everything outside.

    Example
    -------
    region(disk, cylinder, -0.3, -0.3, 0.2)

    Notes
    -----
    In 3D: ``region(rod, cylinder, z, 0, 0, 0.1, INF, 0.5)``.

    See Also
    --------
    block, sphere
    """

    syntax = "xc, yc, R | axis, c1, c2, R, lo, hi[, exterior]"
    forms = Forms(
        "region(ID, cylinder, {names}[, exterior])",
        {2: ("xc", "yc", "R"), 3: ("axis", "c1", "c2", "R", "lo", "hi")},
        words={"axis": ("x", "y", "z")},
        open_ends={"lo": -math.inf, "hi": math.inf},
    )

    def __init__(self, hub: Hub, *shape: Argument):
        numbers, exterior = region.split_exterior(shape)
        dimension = hub.require_domain().dimension
        values = self.forms.read(hub, numbers, dimension)
        names = tuple(values)
        self.radius = values["R"]
        region.check_radius(self.radius, argument=names.index("R"))
        along = "xyz".index(values["axis"]) if dimension == 3 else None
        self.across = tuple(axis for axis in range(dimension) if axis != along)
        self.centre = tuple(values[name] for name in names if name in ("xc", "yc", "c1", "c2"))
        lo, hi = np.empty(dimension), np.empty(dimension)
        for axis, middle in zip(self.across, self.centre, strict=True):
            lo[axis], hi[axis] = middle - self.radius, middle + self.radius
        if along is not None:
            ends = values["lo"], values["hi"]
            region.check_order(*ends, names, names.index("lo"))
            lo[along], hi[along] = ends
            self.slabs = [(along, *ends)]
        super().__init__(hub, lo, hi, exterior=exterior)


class Sphere(Primitive):
    """A sphere in 3D, a disk in 2D, or an interval in 1D, including its surface.

    Parameters
    ----------
    shape
        Centre and radius: in 1D ``x, R``; in 2D ``x, y, R``; in 3D ``x, y, z, R``. With
        ``exterior`` as the last argument: everything outside.

    Example
    -------
    region(ball, sphere, 0.1, 0.1, 0.05)

    See Also
    --------
    block, cylinder
    """

    syntax = "x[, y[, z]], R[, exterior]"
    forms = Forms(
        "region(ID, sphere, {names}[, exterior])",
        {1: ("x", "R"), 2: ("x", "y", "R"), 3: ("x", "y", "z", "R")},
    )

    def __init__(self, hub: Hub, *shape: Argument):
        numbers, exterior = region.split_exterior(shape)
        d = hub.require_domain().dimension
        *centre, self.radius = self.forms.read(hub, numbers, d).values()
        region.check_radius(self.radius, argument=len(centre))
        middle = np.array(centre)
        self.across, self.centre = range(len(centre)), middle
        lo, hi = middle - self.radius, middle + self.radius
        super().__init__(hub, lo, hi, exterior=exterior)


class Plane(Primitive):
    """All positions on one side of a plane (in 2D of a line), including the plane.

    Parameters
    ----------
    plane
        A position on the plane, and a normal of any length that points into the region: in 2D ``x,
        y, nx, ny``; in 3D ``x, y, z, nx, ny, nz``. With ``exterior`` as the last argument, the
        other side is selected.

    Example
    -------
    region(slope, plane, 0, 1, sin(radians(-20)), -cos(radians(20)))

    Notes
    -----
    The region extends to the edges of the domain. For bodies with inclined faces, intersect planes.

    See Also
    --------
    block, intersection
    """

    syntax = "x, y[, z], nx, ny[, nz][, exterior]"
    forms = Forms(
        "region(ID, plane, {names}[, exterior])",
        {2: ("x", "y", "nx", "ny"), 3: ("x", "y", "z", "nx", "ny", "nz")},
    )

    @property
    def volume(self) -> None:
        """None, since the volume depends on where the domain cuts the half-space."""

    def __init__(self, hub: Hub, *plane: Argument):
        numbers, exterior = region.split_exterior(plane)
        d = hub.require_domain().dimension
        values = np.array([*self.forms.read(hub, numbers, d).values()])
        self.middle, normal = values[:d], values[d:]
        length = np.linalg.norm(normal)
        if length == 0:
            message = "the normal of the plane is zero"
            raise ScriptError(message, mark=numbers[d].mark, expected="a normal that is not zero")
        self.normal = normal / (length or 1)
        super().__init__(hub, np.full(d, -np.inf), np.full(d, np.inf), exterior=exterior)
        self.unknown |= bool(np.isnan(values).any())

    @property
    def aligned(self) -> bool:
        return np.count_nonzero(self.normal) == 1

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        depth = np.zeros(len(x))
        for k, (middle, along) in enumerate(zip(self.middle, self.normal, strict=True)):
            depth += along * (x[:, k] - middle)
        return depth

    def shape(self) -> HalfSpace:
        return HalfSpace(self.normal, float(self.normal @ self.middle))


class Union(region.Region):
    """All positions in at least one of two or more regions.

    Parameters
    ----------
    first, second, more
        IDs of regions. A region that was defined with ``exterior`` is everything outside its shape.

    Example
    -------
    region(a, block, 0, 1, 0, 0.2)
    region(b, block, 0, 0.2, 0, 1)
    region(angle, union, a, b)

    See Also
    --------
    intersection, difference
    """

    joined, low, high = np.logical_or, np.minimum, np.maximum
    kind: type = Joined

    def __init__(self, hub: Hub, first: region.Region, second: region.Region, *more: region.Region):
        parts = (first, second, *more)
        used = slice(0, hub.require_domain().dimension)
        super().__init__(
            hub,
            self.low.reduce([operand.box_lo[used] for operand in parts]),
            self.high.reduce([operand.box_hi[used] for operand in parts]),
            parts=parts,
        )

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.joined.reduce([operand.inside(x) for operand in self.parts])

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        return self.high.reduce([operand.depth(x, reach) for operand in self.parts])

    def shape(self) -> Joined | Common | None:
        parts = outlines(self.parts)
        return None if parts is None else self.kind(parts)


class Intersection(Union):
    """All positions in each of two or more regions.

    Example
    -------
    region(disk, cylinder, 0, 0, 0.2)
    region(above, block, INF, INF, 0, INF)
    region(half, intersection, disk, above)

    See Also
    --------
    union, difference
    """

    joined, low, high = np.logical_and, np.maximum, np.minimum
    kind = Common


class Difference(region.Region):
    """All positions in the first region that are not in the other regions.

    Parameters
    ----------
    first
        ID of the region to cut from.
    second, more
        IDs of the regions to remove, surfaces included.

    Example
    -------
    region(plate, block, -1, 1, -1, 1)
    region(hole, cylinder, 0, 0, 0.2)
    region(sheet, difference, plate, hole)

    See Also
    --------
    union, intersection
    """

    def __init__(self, hub: Hub, first: region.Region, second: region.Region, *more: region.Region):
        used, parts = slice(0, hub.require_domain().dimension), (first, second, *more)
        super().__init__(hub, first.box_lo[used], first.box_hi[used], parts=parts)

    def contains(self, x: np.ndarray) -> np.ndarray:
        first, *others = self.parts
        return first.inside(x) & ~np.logical_or.reduce([operand.inside(x) for operand in others])

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        first, *others = (operand.depth(x, reach) for operand in self.parts)
        depth = np.minimum(first, -np.maximum.reduce(others))
        for operand in self.parts[1:]:
            same = self.parts[0].coincides(operand, x)
            if same is not None:  # nothing is left, and clipping would search for a thin sheet
                depth[same] = np.minimum(depth[same], -reach)
        return depth

    def shape(self) -> Common | None:
        parts = outlines(self.parts)
        return None if parts is None else Common((parts[0], *map(Outside, parts[1:])))


def outlines(parts: Sequence[region.Region]) -> tuple | None:
    shapes = [operand.outline() for operand in parts]
    return None if any(one is None for one in shapes) else tuple(shapes)
