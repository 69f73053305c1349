"""Thin bodies, and bodies that begin next to each other, as rules judge them before a run."""

from itertools import combinations
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
    for one in scene.motions:
        solid = list(scene.hub.solids.values())[one.number]
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
    for a, b in combinations(free, 2):
        one, two = solids[a.number], solids[b.number]
        gaps = np.maximum(two.lo - one.hi, one.lo - two.hi)
        axis = int(np.argmax(gaps))
        beside = np.delete(gaps + 0.5 * np.minimum(one.hi - one.lo, two.hi - two.lo), axis)
        apart = (b.velocity - a.velocity)[axis] * np.sign(b.centre[axis] - a.centre[axis])
        near = -1e-6 * h < gaps[axis] < (1 - 1e-6) * h and (beside <= 0).all()
        if near and apart > 1e-6 * scene.waves:
            cells = max(float(gaps[axis]) / h, 0.0)
            return {"one": one.id, "two": two.id, "cells": cells, "speed": apart}
    return None
