"""Suggestions for bodies around an axis or centre, whole or cut by symmetry planes."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from karamelo_py.advice.loads import (
    AXES,
    Roller,
    Words,
    acting,
    alike,
    cells,
    cost,
    depends,
    extent,
    given,
    positions,
    to_change,
)
from karamelo_py.points.laws import can, is_round
from karamelo_py.scene.domain import TWIST, Domain
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.values import TIME

SAMPLES = 4000  # positions tested to find whether a shape is round
SAME = 1e-9  # relative difference of loads that are equal around an axis
WIDE = 1.5  # radius of a square plate / radius of the body on it
ROTATING = "velocity_nodes", "initial_velocity_particles"


class Middle(NamedTuple):
    """A centre, or an axis `along` through it; `across` are the other directions."""

    across: list[int]
    centre: np.ndarray  # (3,) position
    sides: np.ndarray  # (3,): 1 or -1 in directions with a symmetry plane, otherwise 0
    lo: np.ndarray
    hi: np.ndarray

    @property
    def along(self) -> list[int]:
        return [axis for axis in range(3) if axis not in self.across]

    def apart(self, solid: Solid) -> np.ndarray:
        """Return the distances (2, k) of a solid's ends from the centre, normal to the axis."""
        return np.abs(np.stack([solid.lo, solid.hi]) - self.centre)[:, self.across]

    def radius(self, x: np.ndarray) -> np.ndarray:
        return np.linalg.norm((x - self.centre)[:, self.across], axis=1)

    def key(self, x: np.ndarray) -> np.ndarray:
        """Return coordinates (n, 1 or 2) that a rotation does not change."""
        return np.column_stack([self.radius(x), x[:, self.along]])


def round_bodies(hub: Hub, held: dict[int, Roller]) -> Words:
    domain, solids = hub.domain, [solid for solid in hub.solids.values() if solid.count]
    if domain.dimension != 3 or not solids:
        return
    if any(can(solid.material.whole, is_round) for solid in solids):
        return  # a law with directions is not symmetric
    lo, hi = extent(solids)
    centre, sides = (lo + hi) / 2, np.zeros(3)
    for k, roller in held.items():
        centre[k], sides[k] = roller.at, roller.side
    for across in ([0, 1, 2], [0, 1], [0, 2], [1, 2]):
        middle = Middle(across, centre, sides, lo, hi)
        squares = _squares(domain, solids, middle)
        if squares is None:
            continue
        through = [held[k].fix for k in across if k in held]
        others = [fix for fix in acting(hub) if fix not in through]
        if len(across) == 3:
            if all(_acts_from_centre(hub, fix, middle) for fix in others):
                yield _sphere(hub, solids, middle)
                return
            continue
        suggestions = list(_cylinder(hub, solids, middle, others, squares))
        yield from suggestions
        if suggestions:
            return


def _squares(domain: Domain, solids: list[Solid], middle: Middle) -> list[str] | None:
    """Return solids that are square plates under round ones; None if others are not round."""
    reach = [float(middle.apart(solid).max()) for solid in solids]
    round_ = [
        _is_round(solid.region, domain.contains, middle, far)
        for solid, far in zip(solids, reach, strict=True)
    ]
    if not any(round_):
        return None
    most = max(far for far, one in zip(reach, round_, strict=True) if one)
    squares = []
    for solid, one in zip(solids, round_, strict=True):
        if one:
            continue
        apart = middle.apart(solid)
        free = apart[:, middle.sides[middle.across] == 0]
        inner = min([*free.ravel(), *apart.max(axis=0)])
        whole = len(middle.across) == 2 and inner >= WIDE * most
        if not whole or not _is_round(solid.region, domain.contains, middle, 0.99 * inner):
            return None
        squares.append(solid.id)
    return squares


def _is_round(region: Region | None, here: Callable, middle: Middle, reach: float) -> bool:
    """Return True if positions of equal radius are all in a region, or all outside it."""
    if region is None:
        return False
    rng = np.random.default_rng(1)
    r = 1.01 * reach * rng.random(SAMPLES)
    at = middle.lo + (middle.hi - middle.lo) * rng.random((SAMPLES, 3))
    masks = []
    for _ in range(2):
        way = rng.normal(size=(SAMPLES, len(middle.across)))
        sides = middle.sides[middle.across]
        way = np.where(sides == 0, way, sides * np.abs(way))
        x = at.copy()
        x[:, middle.across] = middle.centre[middle.across] + (
            r[:, None] * way / np.linalg.norm(way, axis=1, keepdims=True)
        )
        masks.append(region.inside(x) & (here(x) | (r > reach)))
    return bool((masks[0] == masks[1]).all())


def _places_of(hub: Hub, fix: Fix) -> np.ndarray:
    if isinstance(fix.group, NodeGroup):
        return positions(hub, fix.nodes)
    return np.concatenate([solid.x0 for solid in hub.solids.values()])


def _values(hub: Hub, fix: Fix, axes: list[int], x: np.ndarray) -> np.ndarray:
    """Return the values (n, k) of a fix along `axes` at time 1; at the start they may be 0."""
    time, hub.values.array[TIME] = hub.values.array[TIME], 1.0
    columns = [given(fix)[axis].evaluate_points(hub.values, x, x) for axis in axes]
    hub.values.array[TIME] = time
    return np.stack(columns, axis=1)


def _radial(hub: Hub, fix: Fix, middle: Middle) -> bool:
    """Return True if the values of a fix are radial, and depend on `key` only."""
    formulas = [given(fix)[axis] for axis in middle.across]
    if all(formula is None for formula in formulas):
        return True
    if not all(hasattr(formula, "names") for formula in formulas):
        return False
    x = _places_of(hub, fix)
    values, r = _values(hub, fix, middle.across, x), middle.radius(x)
    arm = (x - middle.centre)[:, middle.across]
    size = np.where(r > 1e-9 * hub.domain.h, r, 1.0)
    outwards = (arm * values).sum(axis=1) / size
    rest = values - arm * (outwards / size)[:, None]
    small = SAME * (np.abs(values).max(initial=0.0) or 1.0)
    return bool((np.abs(rest) <= small).all()) and _is_even(hub, middle, x, outwards, small)


def _is_even(hub: Hub, middle: Middle, x: np.ndarray, values: np.ndarray, small: float) -> bool:
    """Return True if `values` (n,) are equal at all positions with the same radius and height."""
    _, same = np.unique(cells(middle.key(x), hub.domain.h), axis=0, return_inverse=True)
    most = np.full(same.max(initial=-1) + 1, -np.inf)
    np.maximum.at(most, same, values)
    return bool((values >= most[same] - small).all())


def _acts_from_centre(hub: Hub, fix: Fix, middle: Middle) -> bool:
    """Return True if a fix acts symmetrically around the middle, by a pressure or radially."""
    if fix.pressure is not None:
        return not depends(fix.pressure, AXES)
    return len(given(fix)) > 2 and _radial(hub, fix, middle) and alike(hub, fix, middle.key)


def _points_by_radius(solids: list[Solid], middle: Middle) -> float:
    """Return (number of points of the bodies) / (number of points in their section)."""
    many = 0.0
    for solid in solids:
        size = solid.h / (solid.ppc or 1)
        r = np.maximum(middle.radius(solid.x0), size / 2)
        power = len(middle.across) - 1
        part = 0.5 ** np.count_nonzero(middle.sides[middle.across])
        around = part * 2 * np.pi * power * (r / size) ** power
        many += float((1 / around).sum())
    return sum(solid.count for solid in solids) / many


def _sphere(hub: Hub, solids: list[Solid], middle: Middle) -> tuple[str, str]:
    far = max(np.abs(end - middle.centre).max() for end in (hub.domain.lo, hub.domain.hi))
    many = _points_by_radius(solids, middle)
    part = ("", "half ", "quarter ", "eighth of ")[int(np.abs(middle.sides).sum())]
    return (
        f"{part}spheres about one centre, with loads along the radius: about {many:.2g} times "
        f"the points of a line{cost(hub, many, 1)}",
        f"dimension(1, 0, {far:g}, {hub.domain.h:g}) and spherical(true), x the distance from the "
        "centre; masses, forces and energies of a steradian",
    )


def _cylinder(
    hub: Hub, solids: list[Solid], middle: Middle, others: list[Fix], squares: list[str]
) -> Words:
    domain, twists, lines = hub.domain, False, []
    along = middle.along[0]
    named = "".join(AXES[axis] for axis in middle.across)
    for fix in others:
        if fix.friction is not None:
            continue  # contact forces are symmetric around the axis
        if fix.pressure is not None:
            if depends(fix.pressure, named):
                return
            continue
        act = given(fix)
        if len(act) < 3 or depends(act[along], named):
            return
        if not _radial(hub, fix, middle):
            omega = _angular_velocity(hub, fix, middle)
            if omega is None:
                return
            twists = True
            lines.append(_line_of_rotation(fix, omega))
        elif fix.prescribes_velocity and act[middle.across[0]] is not None:
            lines.append(_line_of_rotation(fix, "0"))
        if not alike(hub, fix, middle.key):
            return
    many = _points_by_radius(solids, middle)
    times = f"about {many:.3g} times the points of the plane of radius and axis{cost(hub, many, 2)}"
    lo, hi, h = domain.lo[along], domain.hi[along], domain.h
    far = max(np.abs(end - middle.centre)[middle.across].max() for end in (domain.lo, domain.hi))
    line = f"dimension(2, 0, {far:g}, {lo:g}, {hi:g}, {h:g})"
    plate = f" ({', '.join(squares)} as a round plate, if its corners do not matter)"
    bodies = "cylinders" if not squares else "bodies"
    if twists:
        yield (
            f"{bodies} about one axis, which rotate and twist about it: {times}",
            f"{line} and axisymmetric(true, twist=true), y along the axis, and for the velocities "
            f"around it {', '.join(lines)}" + to_change(hub, TWIST),
        )
        return
    yield (
        f"{bodies} about one axis, and nothing acts around it: {times}",
        f"{line} and axisymmetric(true), y along the axis, and the nodes at x = 0 held in x"
        + plate * bool(squares),
    )


def _line_of_rotation(fix: Fix, omega: str) -> str:
    ID, group = fix.id, "all" if fix.group.all else fix.group.id
    if isinstance(fix.group, NodeGroup):
        return f"fix({ID}_around, angular_velocity_nodes, {group}, {omega})"
    return f"fix({ID}, initial_velocity_particles, {group}, 0, 0, {omega}*x)"


def _angular_velocity(hub: Hub, fix: Fix, middle: Middle) -> str | None:
    """Return the angular velocity of a fix; None if the velocities are no rotation."""
    formulas = [given(fix)[axis] for axis in middle.across]
    if fix.style not in ROTATING or any(one is None for one in formulas):
        return None
    x = _places_of(hub, fix)
    first, second = _values(hub, fix, middle.across, x).T
    r = (x - middle.centre)[:, middle.across]
    square = np.maximum((r * r).sum(axis=1), 1e-18 * hub.domain.h**2)
    omega = (r[:, 0] * second - r[:, 1] * first) / square
    apart = np.hypot(first + omega * r[:, 1], second - omega * r[:, 0])
    scale = 1e-9 * np.abs(omega).max(initial=0.0)
    rotates = (apart <= scale * np.sqrt(square)).all()
    if not rotates or not _is_even(hub, middle, x, omega, scale):
        return None
    off = omega[square > 1e-12 * hub.domain.h**2]
    constant = not any("time" in one.names for one in formulas) and np.ptp(off) <= 2 * scale
    return f"{off[0]:.6g}" if constant else "omega"
