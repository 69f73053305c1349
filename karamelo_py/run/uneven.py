"""A light body next to a heavy and stiff one on the same grid.

A node at which nearly all mass is light may feel a heavy point, whose stiffness acts on that mass:
for the node, the step is too long by sqrt(rho_heavy / rho_light).
"""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.laws import specific_volume
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import BodyMotion, rings
from karamelo_py.run.crossing import meeting

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
    for a in scene.motions:
        for b in scene.motions:
            heavy, light = solids[a.number], solids[b.number]
            lattices = {scene.method.lattice_of(scene.hub, solid) for solid in (heavy, light)}
            laws = heavy.material.law, light.material.law
            if a is b or len(lattices) > 1 or not all(map(rings, laws)):
                continue
            ratio = float(specific_volume(laws[1]) / specific_volume(laws[0]))
            c = timestep.elastic_speed(simulation, heavy)[0]
            courant = c * simulation.dt / heavy.h * sqrt(max(ratio, 1.0))
            if ratio > 1 and courant > max(BREAKS, most.courant) and _touch(scene, a, b, heavy.h):
                most = Uneven(heavy.id, light.id, ratio, courant)
    return most


def _touch(scene: Any, a: BodyMotion, b: BodyMotion, h: float) -> bool:
    """Tell whether bodies lie within a cell of each other, or meet before the run ends."""
    if (np.maximum(a.low - b.high, b.low - a.high) < h).all():
        return True
    meets = (meeting(*pair, k, h) for pair in ((a, b), (b, a)) for k in range(scene.d))
    return min(meets, default=inf) < scene.duration
