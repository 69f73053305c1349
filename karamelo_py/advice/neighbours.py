"""Slender and neighbouring bodies, for rules before a run."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.basics import BasicFacts
from karamelo_py.advice.bodies import fixed_directions, vibrating
from karamelo_py.advice.crossing import BodyBoxes, boxes_of, meetings
from karamelo_py.points.laws import specific_volume
from karamelo_py.run import stable_step
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.scene.solid import Solid

SLENDER = 4.0  # length / thickness above which a body bends
# Limits of sqrt(rho_heavy / rho_light) c dt/h, with c of the heavy body. Two vibrating blocks (usl,
# linear basis, 1 to 3 points per cell) fail within 3000 steps at 3.2 and 5.9, but not at 1.9.
BREAKS, HOLDS = 2.5, 1.9
STEPS = 500  # runs with fewer steps give no warning; the earliest failure was after 800 steps


class Uneven(NamedTuple):
    heavy: str = ""
    light: str = ""
    ratio: float = 1.0  # ratio of densities
    courant: float = 0.0  # Courant number at nodes whose mass is mostly light

    @property
    def of_step(self) -> float:
        return HOLDS / self.courant


def _one_row(solid: Solid, axis: int) -> bool:
    ends = [(x[:, axis].min(), x[:, axis].max()) for _, x in solid.pieces() if len(x)]
    low, high = np.min(ends, axis=0)[0], np.max(ends, axis=0)[1]
    return bool(high - low < 1e-6 * solid.h)


def bent_row(facts: BasicFacts) -> dict[str, Any] | None:
    """Return facts of a slender elastic row of points that bends under its weight, or None."""
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
    """Return bodies that start within a cell of each other and then separate, or None."""
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


def uneven(facts: BasicFacts) -> Uneven:
    """Return the touching pair of elastic bodies that limits the step most.

    Because of a heavy point at a node of mostly light mass, the stable step is shorter by the
    factor sqrt(rho_light / rho_heavy).
    """
    most, dt = Uneven(), facts.simulation.steps.later_dt
    if not (facts.moves and facts.linear and facts.waves > 0 and dt * STEPS < facts.duration):
        return most
    bodies = vibrating(facts)
    if not bodies:
        return most
    lattices = np.array([facts.method.lattice_of(facts.hub, body.solid) for body in bodies])
    volumes = np.array([float(specific_volume(body.solid.material.law)) for body in bodies])
    boxes = boxes_of([body.motion for body in bodies])
    for a, (motion, heavy) in enumerate(bodies):
        ratio = np.where(lattices == lattices[a], volumes / volumes[a], 0.0)
        if not ratio.max() > 1:
            continue
        c = stable_step.elastic_speed(facts.simulation, heavy)[0]
        courant = c * dt / heavy.h * np.sqrt(np.maximum(ratio, 1.0))
        near = np.flatnonzero((ratio > 1) & (courant > max(BREAKS, most.courant)))
        chosen = BodyBoxes(*(array[near] for array in boxes))
        near = near[_touch(motion, chosen, heavy.h, facts.duration)]
        if len(near):
            b = near[courant[near].argmax()]
            most = Uneven(heavy.id, bodies[b].solid.id, float(ratio[b]), float(courant[b]))
    return most


def _touch(motion: BodyMotion, boxes: BodyBoxes, h: float, duration: float) -> np.ndarray:
    """Return the mask (n,) of the bodies that a body touches within `duration`."""
    touching = (np.maximum(motion.low - boxes.high, boxes.low - motion.high) < h).all(axis=1)
    # In the mirrored scene, bodies behind a body lie ahead of it.
    mirrored = motion._replace(
        centre=-motion.centre, velocity=-motion.velocity, low=-motion.high, high=-motion.low
    )
    others = BodyBoxes(-boxes.centre, -boxes.velocity, -boxes.high, -boxes.low)
    first = np.minimum(meetings(motion, boxes, h), meetings(mirrored, others, h)).min(axis=1)
    return touching | (first < duration)
