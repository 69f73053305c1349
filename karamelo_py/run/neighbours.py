"""Thin bodies, and bodies that begin next to each other, as rules judge them before a run."""

from typing import Any

import numpy as np

from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.run.body_motion import held
from karamelo_py.scene.solid import Solid

SLENDER = 4.0  # times its thickness, from where on a body bends


def _one_row(solid: Solid, axis: int) -> bool:
    """Tell whether all points of a solid lie in one row, across an axis."""
    ends = [(x[:, axis].min(), x[:, axis].max()) for _, x in solid.pieces() if len(x)]
    low, high = np.min(ends, axis=0)[0], np.max(ends, axis=0)[1]
    return bool(high - low < 1e-6 * solid.h)


def bent_row(scene: Any) -> dict[str, Any] | None:
    """Find a slender elastic body of one row of points that its weight bends between supports."""
    if scene.d == 1 or scene.simulation.implicit or scene.hub.domain.axisymmetric:
        return None
    solids = list(scene.hub.solids.values())
    for one in scene.motions:
        solid = solids[one.number]
        sides = solid.hi - solid.lo
        axis = int(np.argmin(sides))
        slender = sides.max() > max(SLENDER * sides[axis], 2 * solid.h)
        if solid not in scene.elastic or not slender or not _one_row(solid, axis):
            continue
        if any(g[axis] != 0 for g in scene.weights) and held(scene, one).any():
            return {"solid": solid.id, "cells": sides[axis] / solid.h, "place": solid.place}
    return None


def parting(scene: Any) -> dict[str, Any] | None:
    """Find two bodies on one grid that begin within a cell of each other, and move apart."""
    method = scene.method
    if not scene.moves or method.own_grids or method.fields_per_solid:
        return None
    solids, h = list(scene.hub.solids.values()), scene.hub.domain.h
    free = [
        m for m in scene.motions if not can(solids[m.number].material.law, constrained_velocity)
    ]
    lo, hi = (np.array([getattr(solids[m.number], end) for m in free]) for end in ("lo", "hi"))
    for a, body in enumerate(free[:-1]):
        ahead = slice(a + 1, None)
        gaps = np.maximum(lo[ahead] - hi[a], lo[a] - hi[ahead])
        axes = gaps.argmax(axis=1)
        across = gaps + 0.5 * np.minimum(hi[a] - lo[a], hi[ahead] - lo[ahead])
        rows = np.arange(len(gaps))
        across[rows, axes], widest = -np.inf, gaps[rows, axes]
        near = (-1e-6 * h < widest) & (widest < (1 - 1e-6) * h) & (across <= 0).all(axis=1)
        for k in np.flatnonzero(near):
            other, axis = free[a + 1 + k], axes[k]
            apart = other.velocity - body.velocity
            speed = apart[axis] * np.sign(other.centre[axis] - body.centre[axis])
            if speed > 1e-6 * scene.waves:
                one, two = solids[body.number].id, solids[other.number].id
                cells = max(float(widest[k]) / h, 0.0)
                return {"one": one, "two": two, "cells": cells, "speed": speed}
    return None
