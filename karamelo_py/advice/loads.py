"""Directions in which the loads of a scene act, and its symmetry planes."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.basics import is_zero
from karamelo_py.language.rules import Restrictions
from karamelo_py.points.basis import support
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.run.lower.build import features
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid

Words = Iterator[tuple[str, str]]  # reason, and what to write instead
AXES = "xyz"


class Roller(NamedTuple):
    """A symmetry plane at an end of all bodies, where a fix holds only the normal velocity."""

    at: float
    side: int  # 1: bodies lie above the plane, -1: below it
    fix: Fix


def positions(hub: Hub, nodes: np.ndarray) -> np.ndarray:
    """Return the positions (n, d) of nodes of all lattices."""
    of = [nodes[(nodes >= a.first) & (nodes < a.first + a.node_count)] for a in hub.lattices]
    parts = zip(hub.lattices, of, strict=True)
    return np.concatenate([lattice.positions(some) for lattice, some in parts])


def extent(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest corner (3,) of the box around all solids."""
    return np.min([one.lo for one in solids], axis=0), np.max([one.hi for one in solids], axis=0)


def rollers(hub: Hub) -> dict[int, Roller]:
    """Return the symmetry planes by direction, without directions that have planes at both ends."""
    planes: dict[int, Roller] = {}
    solids = [solid for solid in hub.solids.values() if solid.count]
    if not solids:
        return planes
    lo, hi = extent(solids)
    small, twice = hub.domain.tolerance, set()
    for fix in hub.fixes.values():
        directions = [k for k, formula in enumerate(fix.formulas) if formula is not None]
        rubs = fix.wall_friction is not None
        if not fix.prescribes_velocity or rubs or len(directions) != 1 or fix.group.all:
            continue
        k = directions[0]
        x = positions(hub, fix.nodes)[:, k]
        whole = sum(int(np.prod(one.shape)) // one.shape[k] for one in hub.lattices)
        for end, side in ((lo[k], 1), (hi[k], -1)):
            beyond = (side * (x - end) < small).all()
            filled = np.count_nonzero(np.abs(x - end) < small) == whole
            if is_zero(fix.formulas[k]) and beyond and filled:
                twice |= {k} & planes.keys()
                planes[k] = Roller(float(end) + 0.0, side, fix)
    return {k: roller for k, roller in planes.items() if k not in twice}


def acting(hub: Hub) -> list[Fix]:
    return [fix for fix in hub.fixes.values() if fix.hooks() or fix.for_method]


def given(fix: Fix) -> tuple:
    """Return the formulas of a fix; NaN if the fix has none, as its effect is then unknown."""
    return tuple(fix.formulas) or fix.components or (np.nan,) * 3


def depends(formula: Any, axes: str) -> bool:
    if formula is None:
        return False
    if not hasattr(formula, "names"):
        return True
    return any(name in formula.names for axis in axes for name in (axis, axis + "0"))


def alike(hub: Hub, fix: Fix, key: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Return True if a fix's group has all or none of the points (nodes) with equal `key`."""
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
        _, cell = np.unique(cells(key(x), hub.domain.h), axis=0, return_inverse=True)
        selected = np.bincount(cell, np.isin(first + np.arange(len(x)), members))
        if ((selected > 0) & (selected < np.bincount(cell))).any():
            return False
    return True


def acts_alike(hub: Hub, rest: list[int]) -> bool:
    for fix in acting(hub):
        smooth_wall = fix.wall_friction is None and all(given(fix)[j] is None for j in rest)
        if not smooth_wall and not alike(hub, fix, lambda x: x[:, rest]):
            return False
    return True


def cost(hub: Hub, points: float, d: int, longer: float = 1.0) -> str:
    """Describe the cost of a scene relative to its cost in `d` dimensions.

    The cost of a point is proportional to its number of nodes; in `d` dimensions, steps are
    `longer` by this factor.
    """
    basis, kin = hub.update.method.basis, hub.domain.kin
    nodes = support(basis, kin) / support(basis, KINEMATICS[d]())
    return f" (at this cell size about {points * nodes * longer:.2g} times the cost)"


def to_change(hub: Hub, restrictions: Restrictions) -> str:
    """Describe the choices of a scene that another model does not support."""
    refused = [feature for feature in features(hub) if restrictions.exclude(feature)]
    return "".join(
        f"; not with {one.words} (instead: {restrictions.instead_of(one)})" for one in refused
    )


def cells(x: np.ndarray, h: float) -> np.ndarray:
    return np.rint(x * (1e6 / h)).astype(np.int64)
