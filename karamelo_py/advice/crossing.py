"""Stress that is lost with a linear basis when stressed material moves through the grid.

The strain rate of a point jumps where it crosses a cell face. In the updated frame, pressure falls
by 10 to 35 % per cell, at any speed and strain; with GIMP and splines by 0 to 0.3 %.
"""

from collections.abc import Iterator, Sequence
from math import exp
from typing import NamedTuple

import numpy as np

from karamelo_py.advice.basics import BasicFacts
from karamelo_py.advice.bodies import sides
from karamelo_py.language.rules import code_of
from karamelo_py.points.basis.linear import CROSSING, CURE, PER_CELL, WARNED_LOSS
from karamelo_py.points.laws import law_kind, law_traits, specific_volume
from karamelo_py.run import stable_step
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.run.listening import when

STRESSED = 0.1  # stored fraction of the initial energy below which a body counts as unstressed
OF_ENERGY = 0.1  # lost fraction of the energy without drift below which there is no warning
LOADED = 0.5  # fraction of the energy; loads that supply more maintain the stress


class Crossing(NamedTuple):
    cells: float
    speed: float

    @property
    def lost(self) -> float:
        return 1 - exp(-PER_CELL * self.cells)

    @property
    def percent(self) -> float:
        return 100 * self.lost


def loses(facts: BasicFacts) -> bool:
    """Return True if the scene loses stress; gases and liquids have separate rules."""
    laws = [solid.material.law for solid in facts.hub.solids.values()]
    flows = (any(law_traits(kind).any_speed for kind in law_kind(law)) for law in laws)
    explicit = not facts.scheme.traits.implicit
    return explicit and facts.moves and facts.linear and not any(flows)


def expected(facts: BasicFacts) -> Crossing:
    most = Crossing(0.0, 0.0)
    if not (facts.waves > 0 and loses(facts)):
        return most
    for speed, lasting in (*_struck(facts), *_stressed(facts)):
        most = max(most, Crossing(speed * lasting / facts.spacing, speed))
    return most


def _stressed(facts: BasicFacts) -> Iterator[tuple[float, float]]:
    points = facts.simulation.points
    stored = points.total("stored")
    if facts.simulation.step or not stored > 0:
        return
    speeds = [float(np.linalg.norm(motion.velocity)) for motion in facts.motions]
    drift = sum(m.mass * v * v / 2 for m, v in zip(facts.motions, speeds, strict=True))
    if stored > STRESSED * (stored + points.total("kinetic") - drift):
        yield max(speeds), facts.duration


def _struck(facts: BasicFacts) -> Iterator[tuple[float, float]]:
    """Yield speed and duration of the longest path of each solid that meets another solid.

    Stressed material moves at (z1 v1 + z2 v2)/(z1 + z2), with the impedances z = rho c, until waves
    have returned through the thinner solid.
    """
    bodies = [b for b in facts.bodies if not b.solid.rigid]
    if not bodies:
        return
    c = np.array([stable_step.elastic_speed(facts.simulation, body.solid)[0] for body in bodies])
    z = c / np.array([float(specific_volume(body.solid.material.law)) for body in bodies])
    boxes = boxes_of([body.motion for body in bodies])
    lengths = np.array([sides(body) for body in bodies])
    for a, (motion, solid) in enumerate(bodies):
        begins = meetings(motion, boxes, solid.h)
        b, k = np.nonzero((begins < facts.duration) & (z[a] + z > 0)[:, None])
        if not len(b):
            continue
        v = z[a] * motion.velocity[k] + z[b] * boxes.velocity[b, k]
        through = np.minimum(2 * lengths[a, k] / c[a], 2 * lengths[b, k] / c[b])
        speeds = np.abs(v) / (z[a] + z[b])
        lasting = np.minimum(facts.duration - begins[b, k], through)
        longest = np.lexsort((speeds, speeds * lasting))[-1]
        yield float(speeds[longest]), float(lasting[longest])


class BodyBoxes(NamedTuple):
    centre: np.ndarray
    velocity: np.ndarray
    low: np.ndarray
    high: np.ndarray


def boxes_of(motions: Sequence[BodyMotion]) -> BodyBoxes:
    return BodyBoxes(*(np.array([getattr(m, name) for m in motions]) for name in BodyBoxes._fields))


def meetings(motion: BodyMotion, boxes: BodyBoxes, h: float) -> np.ndarray:
    """Return the times (n, d) until a body is within a cell of each box ahead, or inf."""
    faster, gap = motion.velocity - boxes.velocity, boxes.low - motion.high - h
    ahead = (faster > 0) & (boxes.centre > motion.centre)
    times = np.full(ahead.shape, np.inf)
    n, k = np.nonzero(ahead)
    time = np.maximum(gap[n, k], 0.0) / faster[n, k]
    way, other_way = time[:, None] * motion.velocity, time[:, None] * boxes.velocity[n]
    apart = np.maximum(
        boxes.low[n] + other_way - motion.high - way, motion.low + way - boxes.high[n] - other_way
    )
    apart[np.arange(len(n)), k] = 0
    meets = ~(apart > 1.001 * h).any(axis=1)
    times[n[meets], k[meets]] = time[meets]
    return times


def measured(facts: BasicFacts) -> Crossing:
    energy = facts.simulation.control.energy[0]
    matters = energy.watch_energy and energy.lost > OF_ENERGY and loses(facts)
    loaded = energy.supplied > LOADED * energy.largest_energy
    return Crossing(float(energy.crossed) if matters and not loaded else 0.0, 0.0)


def words_at_end(facts: BasicFacts) -> dict[str, str]:
    crossing, hub = measured(facts), facts.hub
    if crossing.lost <= WARNED_LOSS:
        return {}
    path = f"stressed material moved through {crossing.cells:.2g} cells"
    loss = f"about {crossing.percent:.0f} % of its pressure is lost on average, half at places"
    if hub.update.first_time(CROSSING):
        hub.warn(
            f"{CROSSING}: {path}, {loss} ({when(facts.simulation)})",
            mark=hub.update.method.mark,
            hint=CURE,
            code=code_of(CROSSING),
            cause="points crossing cells: the gradient of a linear basis is discontinuous",
        )
    return {"stress": f"{path}: {loss}"}
