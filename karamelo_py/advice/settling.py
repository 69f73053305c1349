"""Displacement of soft elastic bodies by a weight that acts from the first step.

Stressed points lose stress where they cross the cells of linear basis functions. A body that
vibrates under a sudden load crosses them again and again, and the load pushes it further down,
although reactions are right: by 19, 28, 67 and 165 % for a displacement at rest of 0.26, 0.32, 0.64
and 1.24 cells (FLIP 0.9; cpgimp and splines within 7 %, a load that grows over 7 periods 1 and 3 %
at 0.26 and 0.32 cells).
"""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.bodies import fixes_at, lattice_at, sides, yields
from karamelo_py.advice.crossing import loses
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import BodyMotion

CELLS = 0.25  # of displacement at rest: with less, hardly a point crosses a cell


class Settling(NamedTuple):
    """The body whose weight, with what lies on it, moves its points through most cells."""

    name: str = ""
    strain: float = 0.0  # mean, at rest
    cells: float = 0.0  # displacement of its free end at rest, over the cell size


def expected(scene: Any) -> Settling:
    """Estimate how far bodies that are at rest will settle on what holds them.

    A column of the length L, clamped at one end, with m_1 on its mass m, moves by
    g L^2/c^2 (1/2 + m_1/m) at its other end; c is the speed of longitudinal waves.
    """
    most = Settling()
    if scene.simulation.step or not (scene.waves > 0 and loses(scene)):
        return most
    solids = list(scene.hub.solids.values())
    g = max(scene.weights, key=np.linalg.norm, default=np.zeros(scene.d))
    k = int(np.abs(g).argmax())
    for one in scene.motions if g[k] else ():
        solid = solids[one.number]
        c = timestep.elastic_speed(scene.simulation, solid)[0]
        if yields(solid.material.whole) or not (c > 0 and _clamped(scene, one, k)):
            continue
        length = float(sides(one, solid)[k])
        carried = sum(other.mass for other in scene.motions if _rests(other, one, g, k, solid.h))
        if scene.duration * c < 4 * length:
            continue
        strain = abs(g[k]) * length / c**2 * (0.5 + carried / one.mass)
        cells = strain * length / solid.h
        most = max(most, Settling(solid.id, strain, cells), key=lambda found: found.cells)
    return most if most.cells > CELLS else Settling()


def _rests(other: BodyMotion, one: BodyMotion, g: np.ndarray, k: int, h: float) -> bool:
    """Tell whether another body lies within a cell of one, on the side that its weight presses."""
    gap = other.low - one.high if g[k] < 0 else one.low - other.high
    apart = np.maximum(other.low - one.high, one.low - other.high)
    return -h < gap[k] < h and bool((np.delete(apart, k) < 0).all())


def _clamped(scene: Any, one: BodyMotion, k: int) -> bool:
    """Tell whether fixes hold nodes in direction k at one end of a body, and nowhere else."""
    lattice = lattice_at(scene, one)
    at = fixes_at(scene, one, lattice)
    held = [x[:, k] for fix, x in at if fix.formulas[k] is not None]
    places = np.concatenate(held) if held else np.zeros(0)
    if not len(places):
        return False
    return bool(places.max() < one.low[k] + lattice.h or places.min() > one.high[k] - lattice.h)
