"""Thin bodies, and bodies next to each other, as rules judge them before a run."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.bodies import held, vibrating
from karamelo_py.advice.crossing import BodyBoxes, boxes_of, meetings
from karamelo_py.points.laws import can, constrained_velocity, specific_volume
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.scene.solid import Solid

SLENDER = 4.0  # times its thickness, from where on a body bends
# c dt/h of the heavy body times sqrt(rho_heavy / rho_light). Two blocks that vibrate, with usl and
# a linear basis, 1 to 3 points per cell: 3.2 and 5.9 break within 3000 steps, 1.9 does not.
BREAKS, HOLDS = 2.5, 1.9
STEPS = 500  # the first of them broke after 800


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


class Uneven(NamedTuple):
    """The pair of bodies whose step is furthest from what the light one allows."""

    heavy: str = ""
    light: str = ""
    ratio: float = 1.0  # of densities
    courant: float = 0.0  # at the light nodes

    @property
    def of_step(self) -> float:
        """Return the fraction of the present step that holds."""
        return HOLDS / self.courant


def uneven(scene: Any) -> Uneven:
    """Find a pair of elastic bodies that touch, or will meet, with too long a step; else none.

    A node at which nearly all mass is light may feel a heavy point, whose stiffness acts on that
    mass: for the node, the step is too long by sqrt(rho_heavy / rho_light).
    """
    most, simulation = Uneven(), scene.simulation
    lasting = simulation.dt * STEPS < scene.duration
    if not (scene.moves and scene.linear and scene.waves > 0 and lasting):
        return most
    solids = list(scene.hub.solids.values())
    bodies = [one for one, _ in vibrating(scene)]
    if not bodies:
        return most
    own = [solids[one.number] for one in bodies]
    lattices = np.array([scene.method.lattice_of(scene.hub, solid) for solid in own])
    volumes = np.array([float(specific_volume(solid.material.law)) for solid in own])
    boxes = boxes_of(bodies)
    for a, (one, heavy) in enumerate(zip(bodies, own, strict=True)):
        ratio = np.where(lattices == lattices[a], volumes / volumes[a], 0.0)
        if not ratio.max() > 1:
            continue
        c = timestep.elastic_speed(simulation, heavy)[0]
        courant = c * simulation.dt / heavy.h * np.sqrt(np.maximum(ratio, 1.0))
        near = np.flatnonzero((ratio > 1) & (courant > max(BREAKS, most.courant)))
        near = near[_touch(scene, one, BodyBoxes(*(of[near] for of in boxes)), heavy.h)]
        if len(near):
            b = near[courant[near].argmax()]
            most = Uneven(heavy.id, own[b].id, float(ratio[b]), float(courant[b]))
    return most


def _touch(scene: Any, one: BodyMotion, boxes: BodyBoxes, h: float) -> np.ndarray:
    """Return which bodies lie within a cell of one, or meet it before the run ends, (n,)."""
    touching = (np.maximum(one.low - boxes.high, boxes.low - one.high) < h).all(axis=1)
    # Reflected, so the back is in front.
    behind = one._replace(centre=-one.centre, velocity=-one.velocity, low=-one.high, high=-one.low)
    others = BodyBoxes(-boxes.centre, -boxes.velocity, -boxes.high, -boxes.low)
    first = np.minimum(meetings(one, boxes, h), meetings(behind, others, h)).min(axis=1)
    return touching | (first < scene.duration)
