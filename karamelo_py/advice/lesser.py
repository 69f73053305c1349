"""Suggestions of `check`: fewer dimensions, or half of the body."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from karamelo_py.advice.basics import is_zero
from karamelo_py.points.kinematics import free_from
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.laws import law_parts, law_traits
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.script.values import TIME

Words = Iterator[tuple[str, str]]  # reason, what to write instead

AXES = "xyz"
NO_LAYERS = 0, (0.0, 0.0)
THIN = 0.2  # thickness over the smallest width of a plate in plane stress


def lesser_models(hub: Hub, _: object = None) -> Words:
    for rule in (_flat, _thin, _round, _mirrored):
        yield from rule(hub)


def _acting(hub: Hub) -> list[Fix]:
    return [fix for fix in hub.fixes.values() if fix.hooks() or fix.for_method]


def _given(fix: Fix) -> tuple:
    """Formulas of a fix; NaN without any, as its effect is unknown."""
    return tuple(fix.formulas) or fix.components or (np.nan,) * 3


def _depends(formula: Any, axes: str) -> bool:
    if formula is None:
        return False
    if not hasattr(formula, "names"):
        return True
    return any(name in formula.names for axis in axes for name in (axis, axis + "0"))


def _alike(hub: Hub, fix: Fix, key: Callable[[np.ndarray], np.ndarray]) -> bool:
    """True if a group has all or no points (nodes) of equal `key`."""
    group, within = fix.group, fix.points_within()
    if group is None or (group.all and within is None):
        return group is not None
    if isinstance(group, NodeGroup):
        groups = [(lattice.first, lattice.positions()) for lattice in hub.lattices]
        members = fix.nodes
    else:
        groups = [(solid.first_id, solid.x0) for solid in hub.solids.values() if solid.count]
        members = group.members if within is None else within
    for first, x in groups:
        keys = np.rint(key(x) * (1e6 / hub.domain.h)).astype(np.int64)
        _, cell = np.unique(keys, axis=0, return_inverse=True)
        selected = np.bincount(cell, np.isin(first + np.arange(len(x)), members))
        if ((selected > 0) & (selected < np.bincount(cell))).any():
            return False
    return True


def _flat(hub: Hub) -> Words:
    domain = hub.domain
    d = domain.dimension
    if d == 1 or len(hub.lattices) > 1 or isinstance(domain.kin, Twisted) or domain.across:
        return
    round_ = domain.kin.hoops > 0
    whole = "thickness" if d == 3 else "length" if round_ else "cross-section"
    for k in range(free_from(domain.kin), d):
        rest = [axis for axis in range(d) if axis != k]
        layers, faces = _layers(hub, k, rest) if _moves_nothing(hub, k, rest) else NO_LAYERS
        if layers and not _faces_held(hub, k, *faces):
            continue
        # A radial scene costs as much per point: two layers waste nothing.
        if layers > (2 if round_ else 0) and _acts_alike(hub, rest):
            ends = [f"{domain.lo[axis]:g}, {domain.hi[axis]:g}" for axis in rest]
            axes = " and ".join(AXES[axis] for axis in rest)
            renamed = "" if k == d - 1 else f", with {axes} called {' and '.join(AXES[: d - 1])}"
            yield (
                f"all solids are uniform along {AXES[k]}, and nothing moves in this direction: "
                f"{layers} times "
                f"the points of {'plane strain' if d == 3 else 'a line'}, which has the forces and "
                f"energies of a {whole} of 1",
                f"dimension({d - 1}, {', '.join(ends)}, {domain.h:g}){renamed}"
                + (", and cylindrical(true)" if round_ else ""),
            )
            return


def _thin(hub: Hub) -> Words:
    domain = hub.domain
    laws = [law for solid in hub.solids.values() for law in law_parts(solid.material.whole)]
    if domain.dimension < 3 or len(hub.lattices) > 1 or any(law_traits(p).flows for p in laws):
        return
    for k in range(3):
        rest = [axis for axis in range(3) if axis != k]
        layers, (low, high) = _layers(hub, k, rest) if _moves_nothing(hub, k, rest) else NO_LAYERS
        thickness = (high - low) * domain.h
        wide = min(np.ptp(solid.x0[:, rest], axis=0).min() for solid in hub.solids.values())
        wide += thickness / max(layers, 1)  # from points to edges
        if not layers or thickness > THIN * wide or _is_led(hub, k) or not _acts_alike(hub, rest):
            continue
        ends = [f"{domain.lo[axis]:g}, {domain.hi[axis]:g}" for axis in rest]
        axes = " and ".join(AXES[axis] for axis in rest)
        renamed = "" if k == 2 else f", with {axes} called x and y"
        yield (
            f"a plate with free faces, and nothing acts along {AXES[k]}: {layers} times the points "
            "of plane stress, with the same energies to some per cent",
            f"dimension(2, {', '.join(ends)}, {domain.h:g}) and plane_stress(true, "
            f"thickness={thickness:g}){renamed}",
        )
        return


def _is_led(hub: Hub, k: int) -> bool:
    led = (fix.formulas for fix in hub.fixes.values() if fix.prescribes_velocity)
    return any(len(formulas) <= k or formulas[k] is not None for formulas in led)


def _moves_nothing(hub: Hub, k: int, rest: list[int]) -> bool:
    for fix in _acting(hub):
        formulas = _given(fix)
        if len(formulas) <= len(rest) or not is_zero(formulas[k]):
            return False
        if any(_depends(act, AXES[k]) for act in (*(formulas[j] for j in rest), fix.wall_friction)):
            return False
    return True


def _acts_alike(hub: Hub, rest: list[int]) -> bool:
    for fix in _acting(hub):
        smooth_wall = fix.wall_friction is None and all(_given(fix)[j] is None for j in rest)
        if not smooth_wall and not _alike(hub, fix, lambda x: x[:, rest]):
            return False
    return True


def _layers(hub: Hub, k: int, rest: list[int]) -> tuple[int, tuple[float, float]]:
    """Return the number of equal layers across k and their ends in cells, or `NO_LAYERS`."""
    most, ends = 0, set()
    for solid in hub.solids.values():
        if not solid.count:
            continue
        cells = np.rint(solid.x0 * (1e6 / solid.h)).astype(np.int64)
        across, counts = np.unique(cells[:, k], return_counts=True)
        columns = np.unique(cells[:, rest], axis=0)
        if len(set(counts)) > 1 or len(columns) * len(across) != len(cells):
            return NO_LAYERS
        most = max(most, len(across))
        first, last = solid.x0[:, k].min(), solid.x0[:, k].max()
        apart = len(across) - 1
        half = (last - first) / apart / 2 if apart else solid.h / (solid.ppc or 1) / 2
        ends.add((round((first - half) / solid.h, 6), round((last + half) / solid.h, 6)))
    return (most, ends.pop()) if len(ends) == 1 else NO_LAYERS


def _faces_held(hub: Hub, k: int, low: float, high: float) -> bool:
    lattice = hub.lattices[0]
    fixed = np.zeros(lattice.shape, np.bool_)
    for fix in hub.fixes.values():
        if fix.prescribes_velocity and len(fix.formulas) > k and fix.formulas[k] is not None:
            fixed.ravel()[fix.nodes - lattice.first] = is_zero(fix.formulas[k])
    if fixed.all():
        return True
    planes = [(end * lattice.h - lattice.lo[k]) / lattice.spacing for end in (low, high)]
    if any(abs(plane - round(plane)) > 1e-4 for plane in planes):
        return False
    numbers = [round(plane) for plane in planes]
    inside = all(0 <= number < lattice.shape[k] for number in numbers)
    return inside and bool(fixed.take(numbers, axis=k).all())


def _round(hub: Hub) -> Words:
    if hub.domain.dimension != 3:
        return
    regions = [solid.region for solid in hub.solids.values() if solid.region is not None]
    axes = {region.axis for region in regions}
    if len(axes) != 1 or None in axes or len(regions) < len(hub.solids):
        return
    along, middle = axes.pop()
    across = [axis for axis in range(3) if axis != along]
    centre = np.zeros(3)
    centre[across] = middle

    def turned(x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm((x - centre)[:, across], axis=1)
        return np.stack([r, x[:, along]], axis=1)

    twists, lines = False, []
    for fix in _acting(hub):
        if fix.friction is not None:
            continue  # contact forces are the same around the axis
        act = _given(fix)
        if len(act) < 3 or _depends(act[along], "".join(AXES[axis] for axis in across)):
            return
        if not all(is_zero(act[axis]) for axis in across):
            omega = _angular_velocity(hub, fix, across, centre)
            if omega is None:
                return
            twists = True
            lines.append(_line_of_rotation(fix, omega))
        elif fix.prescribes_velocity:
            lines.append(_line_of_rotation(fix, "0"))
        if not _alike(hub, fix, turned):
            return
    radius = max(region.radius for region in regions)
    lo, hi = hub.domain.lo[along], hub.domain.hi[along]
    h = hub.domain.h
    line = (
        f"dimension(2, 0, {max(hub.domain.hi[axis] for axis in across):g}, {lo:g}, {hi:g}, {h:g})"
    )
    times = f"{np.pi * radius / h:.3g} times the points of the plane of radius and axis"
    if twists:
        yield (
            f"cylinders about one axis, which rotate and twist about it: about {times}",
            f"{line} and axisymmetric(true, twist=true), y along the axis, and for the velocities "
            f"around it {', '.join(lines)}",
        )
        return
    yield (
        f"cylinders about one axis, and nothing acts around it: about {times}",
        f"{line} and axisymmetric(true), y along the axis, and the nodes at x = 0 held in x",
    )


ROTATING = "velocity_nodes", "initial_velocity_particles"


def _line_of_rotation(fix: Fix, omega: str) -> str:
    ID, group = fix.id, "all" if fix.group.all else fix.group.id
    if isinstance(fix.group, NodeGroup):
        return f"fix({ID}_around, angular_velocity_nodes, {group}, {omega})"
    return f"fix({ID}, initial_velocity_particles, {group}, 0, 0, {omega}*x)"


def _angular_velocity(hub: Hub, fix: Fix, across: list[int], centre: np.ndarray) -> str | None:
    """Angular velocity of a fix; None if its velocities are not a rotation."""
    formulas = [fix.formulas[axis] for axis in across]
    if fix.style not in ROTATING or any(one is None for one in formulas):
        return None
    if isinstance(fix.group, NodeGroup):
        x = np.concatenate([lattice.positions() for lattice in hub.lattices])
        x = x[np.isin(np.arange(len(x)), fix.nodes)]
    else:
        x = np.concatenate([solid.x0 for solid in hub.solids.values()])
    time, hub.values.array[TIME] = hub.values.array[TIME], 1.0  # a rotation may begin from rest
    first, second = (one.evaluate_points(hub.values, x) for one in formulas)
    hub.values.array[TIME] = time
    r = (x - centre)[:, across]
    square = np.maximum((r * r).sum(axis=1), 1e-18 * hub.domain.h**2)
    omega = (r[:, 0] * second - r[:, 1] * first) / square
    apart = np.hypot(first + omega * r[:, 1], second - omega * r[:, 0])
    keys = np.rint(
        np.stack([np.sqrt(square), *np.delete(x, across, axis=1).T]) * (1e6 / hub.domain.h)
    )
    _, alike = np.unique(keys, axis=1, return_inverse=True)
    most = np.full(alike.max(initial=-1) + 1, -np.inf)
    np.maximum.at(most, alike, omega)
    scale = 1e-9 * np.abs(omega).max(initial=0.0)
    same = (apart <= scale * np.sqrt(square)).all() and (omega >= most[alike] - scale).all()
    if not same:
        return None
    off = omega[square > 1e-12 * hub.domain.h**2]
    constant = not any("time" in one.names for one in formulas) and np.ptp(off) <= 2 * scale
    return f"{off[0]:.6g}" if constant else "omega"


def _mirrored(hub: Hub) -> Words:
    domain, solids = hub.domain, [solid for solid in hub.solids.values() if solid.count]
    if len(hub.lattices) > 1 or not _acting(hub):
        return
    if not all(solid.region for solid in solids):
        return  # they may have velocities
    for k in range(free_from(domain.kin), domain.dimension):
        ends = [(solid.x0[:, k].min(), solid.x0[:, k].max()) for solid in solids]
        middle = (min(low for low, _ in ends) + max(high for _, high in ends)) / 2
        middle = round(middle / domain.h, 9) * domain.h + 0.0
        cells = (middle - domain.lo[k]) / domain.h
        rest = [axis for axis in range(domain.dimension) if axis != k]
        if abs(cells - round(cells)) > 1e-6 or not all(_given_alike(hub, k, rest)):
            continue

        def sides(x: np.ndarray, k: int = k, middle: float = middle) -> np.ndarray:
            folded = x.copy()
            folded[:, k] = np.abs(x[:, k] - middle)
            return folded

        if all(_both_sides(solid, sides) for solid in solids) and all(
            _alike(hub, fix, sides) for fix in _acting(hub)
        ):
            yield (
                f"the scene is symmetric about {AXES[k]} = {middle:g}: twice the points (unless "
                "it may buckle or break unevenly); energies are halved, and bases "
                "wider than linear change results by some per cent on coarse grids",
                f"half of it, and the nodes at {AXES[k]} = {middle:g} held in {AXES[k]}",
            )
            return


def _given_alike(hub: Hub, k: int, rest: list[int]) -> Iterator[bool]:
    for fix in _acting(hub):
        formulas = _given(fix)
        rest_formulas = [formulas[j] for j in rest if j < len(formulas)]
        yield (len(formulas) <= k or is_zero(formulas[k])) and not any(
            _depends(act, AXES[k]) for act in (*rest_formulas, fix.wall_friction)
        )


def _both_sides(solid: Solid, sides: Callable[[np.ndarray], np.ndarray]) -> bool:
    cells = np.rint(sides(solid.x0) * (1e6 / solid.h)).astype(np.int64)
    return bool((np.unique(cells, axis=0, return_counts=True)[1] == 2).all())
