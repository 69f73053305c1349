"""Displacement of soft elastic bodies due to weight that acts from the first step.

Points of a vibrating body cross cell faces repeatedly. With a linear basis the body then sinks too
far: for a displacement at rest of 0.26, 0.32, 0.64 and 1.24 cells by 19, 28, 67 and 165 % (FLIP
0.9). If the load grows over 7 periods, the error is 1 and 3 % at 0.26 and 0.32 cells; with cpgimp
and splines it is at most 7 %. Reactions are correct.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.advice.basics import BasicFacts, Body
from karamelo_py.advice.bodies import fixes_at, lattice_at, sides, yields
from karamelo_py.advice.crossing import loses
from karamelo_py.run import stable_step
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.script.expressions import Expression

CELLS = 0.25  # displacement in cells below which few points cross a cell face


class Settling(NamedTuple):
    name: str = ""
    strain: float = 0.0  # mean strain at rest
    cells: float = 0.0  # displacement of the free end at rest / cell size


def expected(facts: BasicFacts) -> Settling:
    """Predict how far bodies settle under their weight.

    The free end of a clamped column moves by g L^2/c^2 (1/2 + m_1/m), where L is its length, m its
    mass, m_1 the mass on top of it and c the speed of longitudinal waves.
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
    gap = other.low - motion.high if down else motion.low - other.high
    apart = np.maximum(other.low - motion.high, motion.low - other.high)
    return -h < gap[k] < h and bool((np.delete(apart, k) < 0).all())


def _clamped(facts: BasicFacts, body: Body, k: int) -> bool:
    h = lattice_at(facts, body).h
    ends = [x[:, k] for fix, x in fixes_at(facts, body) if fix.formulas[k] is not None]
    x = np.concatenate(ends) if ends else np.zeros(0)
    if not len(x):
        return False
    return bool(x.max() < body.motion.low[k] + h or x.min() > body.motion.high[k] - h)


def driven(facts: BasicFacts) -> Settling:
    most = Settling()
    for body in facts.bodies if facts.moves and facts.scheme.traits.inertia else ():
        fixes = [(f, x) for f, x in fixes_at(facts, body) if len(x) and body.solid in facts.elastic]
        for k in range(facts.d):
            ways = [_way(facts, fix.formulas[k], x) for fix, x in fixes if fix.formulas[k]]
            cells = np.ptp(ways, axis=0).max() / body.solid.h if ways else 0.0
            most = max(most, Settling(body.solid.id, 0.0, cells), key=lambda each: each.cells)
    return most if most.cells > CELLS else Settling()


def _way(facts: BasicFacts, formula: Expression, x: np.ndarray) -> np.ndarray:
    values, now, speeds = facts.hub.values, facts.hub.update.time, np.zeros(16)
    for n in range(16):
        values.set("time", now + facts.duration * (n + 0.5) / 16)
        (speeds[n],) = formula.evaluate_points(values, x.mean(axis=0, keepdims=True))
    values.set("time", now)
    return np.cumsum(speeds) * facts.duration / 16
