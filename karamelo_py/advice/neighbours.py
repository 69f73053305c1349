"""Slender and neighbouring bodies, for rules before a run."""

from typing import Any

import numpy as np

from karamelo_py.advice.basics import BasicFacts
from karamelo_py.advice.bodies import fixed_directions
from karamelo_py.scene.solid import Solid

SLENDER = 4.0  # length over thickness above which a body bends


def _one_row(solid: Solid, axis: int) -> bool:
    ends = [(x[:, axis].min(), x[:, axis].max()) for _, x in solid.pieces() if len(x)]
    low, high = np.min(ends, axis=0)[0], np.max(ends, axis=0)[1]
    return bool(high - low < 1e-6 * solid.h)


def bent_row(facts: BasicFacts) -> dict[str, Any] | None:
    """Describe a slender elastic body, one row of points, that its weight bends; else None."""
    if facts.d == 1 or facts.simulation.implicit or facts.hub.domain.kin.hoops:
        return None
    for body in facts.bodies:
        solid = body.solid
        sides = solid.hi - solid.lo
        axis = int(np.argmin(sides))
        slender = sides.max() > max(SLENDER * sides[axis], 2 * solid.h)
        if solid not in facts.elastic or not slender or not _one_row(solid, axis):
            continue
        if any(g[axis] != 0 for g in facts.weights) and fixed_directions(facts, body).any():
            return {"solid": solid.id, "cells": sides[axis] / solid.h, "mark": solid.mark}
    return None


def parting(facts: BasicFacts) -> dict[str, Any] | None:
    """Describe bodies on one grid that start within a cell of each other and separate; else
    None."""
    method, h = facts.method, facts.hub.domain.h
    if not facts.moves or method.own_grids or method.fields_per_solid:
        return None
    free = [b for b in facts.bodies if not b.solid.rigid]
    lo, hi = (np.array([getattr(b.solid, end) for b in free]) for end in ("lo", "hi"))
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
            apart = (other.motion.velocity - body.motion.velocity)[axis]
            speed = apart * np.sign(other.motion.centre[axis] - body.motion.centre[axis])
            if speed > 1e-6 * facts.waves:
                cells = max(float(widest[k]) / h, 0.0)
                ids = {"one": body.solid.id, "two": other.solid.id}
                return {**ids, "cells": cells, "speed": speed}
    return None
