"""Displacement of soft elastic bodies by a weight that acts from the first step.

A body that vibrates under a sudden load crosses cells of a linear basis repeatedly, loses stress
and sinks further: by 19, 28, 67 and 165 % for a displacement at rest of 0.26, 0.32, 0.64 and 1.24
cells (FLIP 0.9; cpgimp and splines within 7 %; a load that grows over 7 periods 1 and 3 % at 0.26
and 0.32 cells). Reactions are right.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.advice.basics import BasicFacts, Body
from karamelo_py.advice.bodies import fixes_at, lattice_at, sides, yields
from karamelo_py.advice.crossing import loses
from karamelo_py.run import stable_step
from karamelo_py.run.body_motion import BodyMotion

CELLS = 0.25  # displacement at rest: below, hardly a point crosses a cell


class Settling(NamedTuple):
    name: str = ""
    strain: float = 0.0  # mean, at rest
    cells: float = 0.0  # of the free end at rest, over the cell size


def expected(facts: BasicFacts) -> Settling:
    """Displacement of bodies that settle by their weight.

    The free end of a clamped column of length L and mass m, loaded by m_1, moves by g L^2/c^2 (1/2
    + m_1/m), with the speed c of longitudinal waves.
    """
    most = Settling()
    if facts.simulation.step or not (facts.waves > 0 and loses(facts)):
        return most
    g = max(facts.weights, key=np.linalg.norm, default=np.zeros(facts.d))
    k = int(np.abs(g).argmax())
    for body in facts.bodies if g[k] else ():
        motion, solid = body
        c = stable_step.elastic_speed(facts.simulation, solid)[0]
        if yields(solid.material.whole) or not (c > 0 and _clamped(facts, body, k)):
            continue
        length = float(sides(body)[k])
        down = g[k] < 0
        load = sum(o.mass for o in facts.motions if _rests(o, motion, k, solid.h, down=down))
        if facts.duration * c < 4 * length:
            continue
        strain = abs(g[k]) * length / c**2 * (0.5 + load / motion.mass)
        cells = strain * length / solid.h
        most = max(most, Settling(solid.id, strain, cells), key=lambda each: each.cells)
    return most if most.cells > CELLS else Settling()


def _rests(other: BodyMotion, motion: BodyMotion, k: int, h: float, *, down: bool) -> bool:
    """`other` lies within a cell of a body along k, on its pressed side."""
    gap = other.low - motion.high if down else motion.low - other.high
    apart = np.maximum(other.low - motion.high, motion.low - other.high)
    return -h < gap[k] < h and bool((np.delete(apart, k) < 0).all())


def _clamped(facts: BasicFacts, body: Body, k: int) -> bool:
    """Fixes hold a body along k at one end only."""
    h = lattice_at(facts, body).h
    ends = [x[:, k] for fix, x in fixes_at(facts, body) if fix.formulas[k] is not None]
    x = np.concatenate(ends) if ends else np.zeros(0)
    if not len(x):
        return False
    return bool(x.max() < body.motion.low[k] + h or x.min() > body.motion.high[k] - h)
