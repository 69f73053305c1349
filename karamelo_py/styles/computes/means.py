"""Computes of means, extremes, quantiles, and values at a position."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import In, Positive
from karamelo_py.output.fields import check_columns
from karamelo_py.output.point_table import COMPONENTS, PointTable
from karamelo_py.output.units import LENGTH, TEMPERATURE, VELOCITY
from karamelo_py.scene.group import AnyGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError


class Mean(Compute):
    empty = 0.0

    def sums(self) -> Sequence[float]:
        return self.hub.fields.added_up(self)

    def refresh(self) -> None:
        weight, *totals = self.sums()
        self.publish_all(*(total / weight if weight > 0 else self.empty for total in totals))


class AverageVelocity(Mean):
    """Measure the unweighted mean velocity of points; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(v, average_velocity, all)
    log_modify(custom, time, v_x)
    """

    published = ("x", "y", "z")
    unit = VELOCITY

    def terms(self, points: PointTable) -> list[np.ndarray]:
        return [np.ones(points.count), *points.velocity.T]


class AverageStress(Mean):
    """Measure the mean Cauchy stress, published as ID_11, ID_22, ID_33, ID_12, ID_13, ID_23.

    Example
    -------
    compute(s, average_stress, all)
    log_modify(custom, time, s_11, s_12)

    Notes
    -----
    The mean is over the present volume, sum V sigma / sum V, or 0 without points. For a body at
    rest it depends only on the forces on its surface.

    See Also
    --------
    strain_energy, average_velocity
    """

    published = COMPONENTS

    def terms(self, points: PointTable) -> list[np.ndarray]:
        volume = points.particle("volume")
        return [volume, *(volume * points.particle("s" + c) for c in COMPONENTS)]


class AverageTemperature(Mean):
    """Measure the mean temperature of a group of points; published as ID.

    The mean is weighted by mass; points without a temperature count as 0. At least one material
    must have a temperature.

    Example
    -------
    compute(warmth, average_temperature, all)
    log_modify(custom, time, warmth)

    See Also
    --------
    max_plastic_strain, temperature plastic_work
    """

    published = ("",)
    columns = ("T",)
    unit = TEMPERATURE

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        if hub.materials and "T" in hub.fields.absent_at_points():
            raise ScriptError(
                "no material of the scene has a temperature",
                expected="a temperature in material(ID, eos-strength, ...), or a "
                "thermo-mechanical method",
            )

    def terms(self, points: PointTable) -> list[np.ndarray]:
        mass = points.particle("mass")
        return [mass, mass * points.particle("T")]


class MaxPlasticStrain(Compute):
    """Measure the largest equivalent plastic strain and temperature of a group of points.

    The values are published as ID_Epmax and ID_Tmax. A value is 0 if no material has a yield
    strength or a temperature.

    Example
    -------
    compute(worst, max_plastic_strain, all)
    log_modify(custom, time, worst_Epmax)

    See Also
    --------
    strength plastic
    """

    published = ("Epmax", "Tmax")

    def refresh(self) -> None:
        self.publish_all(*np.max(self.hub.fields.each(self, "largest"), axis=0))

    def largest(self, points: PointTable) -> list[float]:
        return [points.particle(name).max(initial=0) for name in ("ep", "T")]


class CenterOfMass(Mean):
    """Measure the centre of mass, published as ID_x, ID_y, ID_z; 0 for a group without mass.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all`` points. Nodes have the mass mapped from the points.

    Example
    -------
    compute(middle, center_of_mass, ball)
    log_modify(custom, time, middle_x, middle_y)

    See Also
    --------
    xcm, max_position, average_velocity
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: AnyGroup):
        super().__init__(hub, group)

    def sums(self) -> Sequence[float]:
        on_points = isinstance(self.group, ParticleGroup)
        return super().sums() if on_points else self.hub.simulation.nodes.mass_of(self.group)

    def terms(self, points: PointTable) -> list[np.ndarray]:
        mass = points.mass.astype(float)
        return [mass, *(mass * points.position.T)]


class MaxPosition(Compute):
    """Measure the largest coordinate in each direction; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(front, max_position, water)
    log_modify(custom, time, front_x)

    See Also
    --------
    min_position, position_quantile
    """

    published = ("x", "y", "z")
    unit = LENGTH
    extreme = staticmethod(np.max)

    def refresh(self) -> None:
        extremes = self.hub.fields.each(self, "furthest")
        self.publish_components(self.extreme(extremes, axis=0) if extremes else np.zeros(3))

    def furthest(self, points: PointTable) -> np.ndarray | None:
        return self.extreme(points.position, axis=0) if points.count else None


class MinPosition(MaxPosition):
    """Measure the smallest coordinate in each direction; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(back, min_position, water)
    log_modify(custom, time, back_x)

    See Also
    --------
    max_position, position_quantile
    """

    extreme = staticmethod(np.min)


BITS = 8  # number of bits of a coordinate examined at a time
SIGN = np.uint64(1 << 63)


class PositionQuantile(Compute):
    """Measure the coordinate below which a fraction of the mass lies, in each direction.

    Publishes ID_x, ID_y, ID_z. Unlike max_position, it ignores a few points far ahead.

    Parameters
    ----------
    fraction
        Fraction of the mass, from 0 (the lowest point) to 1 (the highest).

    Example
    -------
    compute(front, position_quantile, all, 0.99)
    log_modify(custom, time, front_x)

    See Also
    --------
    min_position, max_position, center_of_mass
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: ParticleGroup, fraction: Annotated[float, In(0, 1)]):
        super().__init__(hub, group)
        self.fraction = fraction

    def refresh(self) -> None:
        d = self.hub.domain.dimension
        # Radix selection by eight bits of the coordinates at a time, from the highest.
        first, below = [0] * d, np.zeros(d)
        for shift in range(64 - BITS, -1, -BITS):
            mass = self.hub.fields.added_up(self, "masses", shift, first).reshape(d, -1)
            if not mass.any():
                self.publish_components(np.zeros(d))
                return
            if shift == 64 - BITS:
                # Allow for round-off: 0.1 of ten equal points is one point.
                wanted = self.fraction * mass.sum(axis=1) * (1 - 1e-12)
            for axis, of_bits in enumerate(mass):
                occupied = np.flatnonzero(of_bits)
                up_to = below[axis] + np.cumsum(of_bits[occupied])
                index = int(np.count_nonzero(up_to < wanted[axis]))
                digit = occupied[min(index, len(occupied) - 1)]
                below[axis] += of_bits[:digit].sum()
                first[axis] = first[axis] << BITS | int(digit)
        self.publish_components(_numbers(np.array(first, np.uint64)))

    def masses(self, points: PointTable, shift: int, first: list[int]) -> tuple:
        terms_by_axis = []
        for axis, begin in enumerate(first):
            bits = _bits(points.position[:, axis].astype(float)) >> np.uint64(shift)
            rows = np.flatnonzero(bits >> np.uint64(BITS) == begin)
            digits = (bits[rows] & np.uint64(2**BITS - 1)).astype(np.int64)
            terms_by_axis.append((digits + axis * 2**BITS, points.mass[rows].astype(float)))
        rows, terms = (np.concatenate(same) for same in zip(*terms_by_axis, strict=True))
        return len(first) * 2**BITS, rows, terms


def _bits(numbers: np.ndarray) -> np.ndarray:
    """Return integers with the same order as the floating-point numbers."""
    bits = (numbers + 0.0).view(np.uint64)  # converts -0 to 0
    return np.where(bits >> np.uint64(63) > 0, ~bits, bits | SIGN)


def _numbers(bits: np.ndarray) -> np.ndarray:
    return np.where(bits >> np.uint64(63) > 0, bits ^ SIGN, ~bits).view(float)


FAR = "no point is near {place}; the nearest, with id {id}, is at a distance of {distance}"
INSIDE = "a position inside the body, or point=... for the point with this id"


class Probe(Mean):
    """Measure columns of the points, such as a stress: means, or values at one point.

    The value is published as ID, or as ID_column if there are several columns. The value is NaN for
    an empty group, and for a point that no longer exists.

    Parameters
    ----------
    column, columns
        Columns of dump particle. By default their volume-weighted mean over the group is measured.
    point
        The id of a point, as in dumps, whose values are measured instead of the mean.
    x, y, z
        A position. At each output, the point of the group closest to it is measured.

    Example
    -------
    compute(p, probe, bar, s11)
    compute(tip, probe, all, y, vy, point=128)
    compute(gauge, probe, water, s22, x=0.5, y=0)
    log_modify(custom, time, p, tip_vy, gauge)
    """

    empty = np.nan
    _has_warned = False

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        column: str,
        *columns: str,
        point: Annotated[int, Positive] | None = None,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
    ):
        super().__init__(hub, group if point is None else ParticleGroup(hub, everything=True))
        self.columns = (column, *columns)
        check_columns(self.columns, hub.fields.particle_names(), first=1)
        self.point = point
        self.at = {axis: c for axis, c in zip("xyz", (x, y, z), strict=True) if c is not None}
        if point is not None and self.at:
            raise ScriptError("a probe is at a point or at a position, not both", argument="point")
        d = hub.domain.dimension
        for axis in "xyz"[d:]:
            if axis in self.at:
                message = f"a {d}D scene has no coordinate {axis}"
                expected = "a position " + ", ".join(f"{name}=..." for name in "xyz"[:d])
                raise ScriptError(message, argument=axis, expected=expected)
        self.published = ("",) if len(self.columns) == 1 else self.columns
        count = sum(solid.count for solid in hub.solids.values())
        if point is not None and all(s.count for s in hub.solids.values()) and 0 < count < point:
            message = f"there is no point {point} yet"
            raise ScriptError(message, argument="point", expected=f"an id from 1 to {count}")

    def refresh(self) -> None:
        if self.point is None and not self.at:
            super().refresh()
            return
        nearest = self.nearest_of_all()
        self.publish_all(*(nearest[2:] if nearest else [self.empty] * len(self.columns)))
        if far := self.far(nearest):
            self.hub.warn(
                f"compute probe '{self.id}': " + FAR.format(**far), mark=self.mark, hint=INSIDE
            )

    def nearest_of_all(self) -> list[float] | None:
        return min(self.hub.fields.each(self, "nearest"), default=None)

    def far(self, nearest: list[float] | None) -> dict[str, str]:
        """Return, once, words about a position more than a cell away from all points."""
        if not self.at or self._has_warned or nearest is None or nearest[0] <= self.hub.domain.h**2:
            return {}
        self._has_warned = True
        place = ", ".join(f"{axis}={c:g}" for axis, c in self.at.items())
        return {"place": place, "id": f"{nearest[1]:.0f}", "distance": f"{nearest[0] ** 0.5:.3g}"}

    def terms(self, points: PointTable) -> list[np.ndarray]:
        volume = points.particle("volume")
        return [volume, *(volume * points.particle(name) for name in self.columns)]

    def nearest(self, points: PointTable) -> list[float] | None:
        """Return distance, id and column values of the chosen or the nearest point."""
        ids = points.particle("id")
        if self.point is not None:
            distance = np.where(ids == self.point, 0.0, np.inf)
        else:
            distance = sum((points.particle(axis) - c) ** 2 for axis, c in self.at.items())
        if not len(ids) or not np.isfinite(least := distance.min()):
            return None
        at = min(np.flatnonzero(distance == least), key=ids.__getitem__)
        return [least, *(float(points.particle(name)[at]) for name in ("id", *self.columns))]


known_failure(
    Probe,
    "compute probe '{part.id}'",
    when=lambda probe, scene: probe.far(probe.nearest_of_all()) if probe.at else {},
    reason=FAR,
    cure=INSIDE,
)
