"""Stress that a linear basis loses when stressed material moves through the grid.

The gradient of a linear basis jumps at cell faces. Points that cross them change the strain rates
of cells, and the volumes of points drift away from the available space: in the updated frame,
pressure falls by 10 to 35 % in each cell that stressed material moves through, at any speed and
strain. GIMP and splines lose 0 to 0.3 %.
"""

from collections.abc import Sequence
from math import exp
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.bodies import sides
from karamelo_py.language.rules import code_of
from karamelo_py.points.basis.linear import CROSSING, CURE, PER_CELL, TOLD
from karamelo_py.points.laws import can, constrained_velocity, law_kind, law_traits, specific_volume
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import BodyMotion

STRESSED = 0.1  # of the initial energy: less does not count as initial stress
OF_ENERGY = 0.1  # of the energy besides drift: a smaller loss gives no warning
LOADED = 0.5  # of the energy: if loads supply more, they maintain the stress


class Crossing(NamedTuple):
    """The path of stressed material through the grid."""

    cells: float
    speed: float

    @property
    def lost(self) -> float:
        """Return the fraction of the stress that is lost on the way."""
        return 1 - exp(-PER_CELL * self.cells)

    @property
    def percent(self) -> float:
        return 100 * self.lost


def loses(scene: Any) -> bool:
    """Return True if stress is lost in the scene; gases and liquids have separate rules."""
    laws = [solid.material.law for solid in scene.hub.solids.values()]
    flows = (any(law_traits(kind).any_speed for kind in law_kind(law)) for law in laws)
    explicit = not scene.scheme.traits.implicit
    return explicit and scene.moves and scene.linear and not any(flows)


def expected(scene: Any) -> Crossing:
    """Estimate the remaining path of material under impact or initial stress."""
    most = Crossing(0.0, 0.0)
    if not (scene.waves > 0 and loses(scene)):
        return most
    spacing = float(scene.simulation.control.clock[0].spacing)
    for speed, lasting in (*_struck(scene), *_stressed(scene)):
        most = max(most, Crossing(speed * lasting / spacing, speed))
    return most


def _stressed(scene: Any) -> Any:
    """Yield speed and duration of motions with an initial stress."""
    points, step = scene.simulation.points, scene.simulation.step
    stored = points.total("stored")
    if step or not stored > 0:
        return
    speeds = [float(np.linalg.norm(one.velocity)) for one in scene.motions]
    drift = sum(one.mass * v * v / 2 for one, v in zip(scene.motions, speeds, strict=True))
    if stored > STRESSED * (stored + points.total("kinetic") - drift):
        yield max(speeds), scene.duration


def _struck(scene: Any) -> Any:
    """Yield speed and duration of stressed material for each solid that meets others, at most.

    From acoustic impedances (z = rho c) it moves at (z1 v1 + z2 v2)/(z1 + z2), until waves have
    gone through the thinner solid and returned.
    """
    solids = list(scene.hub.solids.values())
    law_of = {number: solid.material.law for number, solid in enumerate(solids)}
    bodies = [one for one in scene.motions if not can(law_of[one.number], constrained_velocity)]
    if not bodies:
        return
    laws = [law_of[one.number] for one in bodies]
    c = np.array([timestep.elastic_speed(scene.simulation, solids[o.number])[0] for o in bodies])
    z = c / np.array([float(specific_volume(law)) for law in laws])
    boxes = boxes_of(bodies)
    lengths = np.array([sides(one, solids[one.number]) for one in bodies])
    for a, one in enumerate(bodies):
        begins = meetings(one, boxes, solids[one.number].h)
        b, k = np.nonzero((begins < scene.duration) & (z[a] + z > 0)[:, None])
        if not len(b):
            continue
        v = z[a] * one.velocity[k] + z[b] * boxes.velocity[b, k]
        through = np.minimum(2 * lengths[a, k] / c[a], 2 * lengths[b, k] / c[b])
        speeds = np.abs(v) / (z[a] + z[b])
        lasting = np.minimum(scene.duration - begins[b, k], through)
        longest = np.lexsort((speeds, speeds * lasting))[-1]
        yield float(speeds[longest]), float(lasting[longest])


class BodyBoxes(NamedTuple):
    """The boxes around n bodies, and their motion, arrays (n, d)."""

    centre: np.ndarray
    velocity: np.ndarray
    low: np.ndarray
    high: np.ndarray


def boxes_of(bodies: Sequence[BodyMotion]) -> BodyBoxes:
    return BodyBoxes(
        *(np.array([getattr(one, name) for one in bodies]) for name in BodyBoxes._fields)
    )


def meetings(one: BodyMotion, boxes: BodyBoxes, h: float) -> np.ndarray:
    """Return when a body meets each of the boxes ahead of it, (n, d): infinite if never."""
    faster, gap = one.velocity - boxes.velocity, boxes.low - one.high - h
    ahead = (faster > 0) & (boxes.centre > one.centre)
    times = np.full(ahead.shape, np.inf)
    n, k = np.nonzero(ahead)
    time = np.maximum(gap[n, k], 0.0) / faster[n, k]
    own_way, way = time[:, None] * one.velocity, time[:, None] * boxes.velocity[n]
    apart = np.maximum(
        boxes.low[n] + way - one.high - own_way, one.low + own_way - boxes.high[n] - way
    )
    apart[np.arange(len(n)), k] = 0
    meets = ~(apart > 0).any(axis=1)
    times[n[meets], k[meets]] = time[meets]
    return times


def measured(scene: Any) -> Crossing:
    """Return the path measured by the watch so far, as a mean over the stressed material.

    If loads do most of the work they maintain the stress, and losses are restored.
    """
    clock = scene.simulation.control.clock[0]
    matters = clock.watch_energy and clock.lost > OF_ENERGY and loses(scene)
    held = clock.supplied > LOADED * clock.largest_energy
    return Crossing(float(clock.crossed) if matters and not held else 0.0, 0.0)


def words_at_end(scene: Any) -> dict[str, str]:
    """Describe the lost stress at the end of a run, and warn of it unless already done."""
    found, hub = measured(scene), scene.hub
    if found.lost <= TOLD:
        return {}
    words = f"{found.cells:.2g} cells of the grid while it was stressed"
    much = f"some {found.percent:.0f} % of its pressure with a linear basis"
    if hub.update.first_time(CROSSING):
        hub.warn(
            f"{CROSSING}: matter has moved through {words}, and lost {much}",
            place=hub.update.method.place,
            hint=CURE,
            code=code_of(CROSSING),
        )
    return {"stress": f"matter moved through {words}: lost {much}"}
