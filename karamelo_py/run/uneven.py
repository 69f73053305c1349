"""A light body next to a heavy and stiff one on the same grid.

A node at which nearly all mass is light may feel a heavy point, whose stiffness acts on that mass:
for the node, the step is too long by sqrt(rho_heavy / rho_light).
"""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.laws import specific_volume
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import BodyMotion, rings
from karamelo_py.run.crossing import BodyBoxes, boxes_of, meetings

# c dt/h of the heavy body times sqrt(rho_heavy / rho_light). Two blocks that vibrate, with usl and
# a linear basis, 1 to 3 points per cell: 3.2 and 5.9 break within 3000 steps, 1.9 does not.
BREAKS, HOLDS = 2.5, 1.9
STEPS = 500  # the first of them broke after 800


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


def expected(scene: Any) -> Uneven:
    """Find a pair of elastic bodies that touch, or will meet, with too long a step; else none."""
    most, simulation = Uneven(), scene.simulation
    lasting = simulation.dt * STEPS < scene.duration
    if not (scene.moves and scene.linear and scene.waves > 0 and lasting):
        return most
    solids = list(scene.hub.solids.values())
    bodies = [one for one in scene.motions if rings(solids[one.number].material.whole)]
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
    # Reflected, what is behind lies ahead.
    behind = one._replace(centre=-one.centre, velocity=-one.velocity, low=-one.high, high=-one.low)
    others = BodyBoxes(-boxes.centre, -boxes.velocity, -boxes.high, -boxes.low)
    first = np.minimum(meetings(one, boxes, h), meetings(behind, others, h)).min(axis=1)
    return touching | (first < scene.duration)
