"""Moving bodies: energy gain, lag of rotation, and fixes that hold bodies."""

from collections.abc import Iterator
from math import inf
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.basics import BasicFacts, Body
from karamelo_py.points.kinematics import free_from
from karamelo_py.points.laws import law_kind, law_traits, parameter
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.noise import drift_limits
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.modify import Fix
from karamelo_py.script.expressions import POINT_SEEDS

SLOW = 0.01  # fraction of the wave speed below which no drift was seen to gain energy
TORN = 9.0, 14.0  # tolerable rotation with one point per cell, radians: FLIP, affine transfers
# Mean squared distance of a point from its nodes, weighted by N, per direction, divided by h^2: for
# the linear basis with two points per cell, and for second-order bases.
SPREAD, SPREAD_OF_OTHERS = 3 / 16, 1 / 4


class Noise(NamedTuple):
    share: float  # noise / tolerable amount
    speed: float  # speed of the body or its rim / wave speed
    cells: float  # path of the body or its rim, in cells
    angle: float = 0.0
    noisy: bool = True
    torn: bool = False  # True if the rim separates


class Lag(NamedTuple):
    fraction: float = 0.0  # lost fraction of the angular velocity
    turns: float = 0.0

    @property
    def percent(self) -> float:
        return 100 * self.fraction


def rings(law: Any) -> bool:
    """Return True if bodies of a law vibrate, unlike fluids."""
    if law_traits(law).rebounds:
        return True
    strength = parameter(law, "strength", None)
    silent = strength is None or not law_traits(strength).rings
    return not silent and shear_modulus(strength) > 0


def yields(law: Any) -> bool:
    traits = map(law_traits, law_kind(law))
    return not any(each.rebounds or each.hypoelastic for each in traits)


def vibrating(facts: BasicFacts) -> list[Body]:
    return [body for body in facts.bodies if facts.waves > 0 and rings(body.solid.material.whole)]


def drift_of(facts: BasicFacts) -> Noise | None:
    if not (facts.scheme.traits.conserving and facts.moves and facts.kept > 0.9) or _thrown(facts):
        return None
    limits = drift_limits(facts.basis)
    bound = (limits.averaged if facts.scheme.traits.allows_drift else limits.drift)[facts.sparse]
    bound /= limits.line if facts.d == 1 else 1
    speed = cells = 0.0
    for body in vibrating(facts):
        velocity = body.motion.drift(free_from(facts.hub.domain.kin))
        if np.linalg.norm(velocity) <= SLOW * facts.waves:
            continue
        free_speed = float(np.linalg.norm(velocity[~fixed_directions(facts, body)]))
        ends = yields(body.solid.material.whole)
        time = min(facts.duration, _free_time(facts, body.motion)) if ends else facts.duration
        path = free_speed * time / facts.spacing
        if SLOW < free_speed / facts.waves < limits.fastest and path > cells:
            speed, cells = free_speed / facts.waves, path
    if not cells:
        return None
    courant = facts.simulation.steps.later_dt * facts.waves / facts.spacing
    return Noise(cells * courant / bound, speed, cells)


def _thrown(facts: BasicFacts) -> bool:
    if len(facts.motions) != 1 or facts.hub.update.boundary == "reflect":
        return False
    for fix in facts.hub.fixes.values():
        steady = fix.accelerates and all(f is None or f.is_constant for f in fix.formulas)
        if not (fix.first_step_only or steady):
            return False
    even = bool((facts.motions[0].fast == facts.motions[0].slow).all())
    return even and facts.simulation.points.total("stored") == 0


def turn_of(facts: BasicFacts) -> Noise | None:
    turns = facts.moments or (facts.moves and facts.kept > 0.9)
    if not (facts.scheme.traits.conserving and turns and facts.d > 1) or facts.hub.domain.kin.hoops:
        return None
    limits, dt, most = drift_limits(facts.basis), facts.simulation.steps.later_dt, None
    bound = (limits.rim_averaged if facts.scheme.traits.allows_drift else limits.rim)[facts.sparse]
    for body in vibrating(facts):
        spin, reach = body.motion.spin, body.motion.reach
        speed, angle = spin * reach / facts.waves, spin * facts.duration
        if speed <= SLOW or not is_free(facts, body):
            continue
        cells = angle * reach / facts.spacing
        torn = angle / TORN[facts.moments] if facts.sparse else 0.0
        noise = 0.0 if facts.moments else cells * dt * facts.waves / facts.spacing / bound
        share = max(noise, torn)
        if share > (most.share if most else 0.0):
            most = Noise(share, speed, cells, angle, noise > 0, torn > 1)
    return most


def lag_of(facts: BasicFacts) -> Lag:
    """Return the lag of a free rotation in the total frame.

    The moment of inertia of the nodes is sum m r^2 of the points minus sum m tr D.
    """
    most = Lag()
    if facts.moves or facts.d == 1 or facts.hub.domain.kin.hoops:
        return most
    for body in facts.bodies:
        motion = body.motion
        turns = motion.spin * facts.duration / (2 * np.pi)
        if turns > most.turns and is_free(facts, body):
            axis = motion.turning / (motion.spin or 1.0)
            spread = np.zeros((3, 3))
            spread[: facts.d, : facts.d] = motion.spread
            squared = (np.trace(spread) - axis @ spread @ axis) / motion.mass
            away = 2 * (SPREAD if facts.linear else SPREAD_OF_OTHERS) * facts.spacing**2
            most = Lag(min(away / squared, 1.0), turns)
    return most


def sides(body: Body) -> np.ndarray:
    """Return the side lengths (d,) of a body, half a point beyond the outer points."""
    return body.motion.high - body.motion.low + 2 * body.solid.half_size.max(axis=0)


def fixed_directions(facts: BasicFacts, body: Body) -> np.ndarray:
    fixes = [fix for fix, x in fixes_at(facts, body) if len(x)]
    return np.array([any(fix.formulas[k] is not None for fix in fixes) for k in range(facts.d)])


def is_free(facts: BasicFacts, body: Body) -> bool:
    return not fixed_directions(facts, body).any()


def lattice_at(facts: BasicFacts, body: Body) -> Lattice:
    return facts.hub.lattices[facts.method.lattice_of(facts.hub, body.solid)]


def fixes_at(facts: BasicFacts, body: Body) -> Iterator[tuple[Fix, np.ndarray]]:
    lattice, low, high = lattice_at(facts, body), body.motion.low, body.motion.high
    for fix in facts.hub.fixes.values():
        if not fix.prescribes_velocity:
            continue
        nodes = fix.group.nodes
        inside = (nodes >= lattice.first) & (nodes < lattice.first + lattice.node_count)
        x = lattice.positions(nodes[inside])[:, : facts.d]
        yield fix, x[((x >= low - lattice.h) & (x <= high + lattice.h)).all(axis=1)]


def pressed_evenly(facts: BasicFacts, body: Body) -> bool:
    """Return True if fixes hold all sides of a box, except one, in the normal direction."""
    h, low, high = lattice_at(facts, body).h, body.motion.low, body.motion.high
    box = sides(body).prod() * facts.hub.domain.thickness
    if facts.hub.domain.kin.hoops or np.sum(body.solid.volume0) < (1 - 1e-6) * box:
        return False
    pressed = set()
    for fix, x in fixes_at(facts, body):
        directions = [k for k, formula in enumerate(fix.formulas[: facts.d]) if formula is not None]
        if not len(x):
            continue
        k = directions[0]
        if len(directions) > 1 or not fix.formulas[k].names.isdisjoint(POINT_SEEDS):
            return False
        along = np.delete(np.arange(facts.d), k)
        ends = [x[:, k].max() < low[k] + h, x[:, k].min() > high[k] - h]
        from_, to = x[:, along].min(axis=0), x[:, along].max(axis=0)
        whole = (from_ <= low[along]).all() and (to >= high[along]).all()
        if not (any(ends) and whole):
            return False
        pressed.add((k, ends[0]))
    return len(pressed) >= 2 * facts.d - 1


def _free_time(facts: BasicFacts, motion: BodyMotion) -> float:
    d, domain = facts.d, facts.hub.domain
    ways = zip(motion.velocity, motion.low, motion.high, domain.lo[:d], domain.hi[:d], strict=True)
    first = min(
        ((hi - high) / v if v > 0 else (lo - low) / v for v, low, high, lo, hi in ways if v),
        default=inf,
    )
    for other in facts.motions:
        if other is not motion:
            first = min(first, _meeting(motion, other))
    return max(first, 0.0)


def _meeting(motion: BodyMotion, other: BodyMotion) -> float:
    begin, end = 0.0, inf
    v = motion.velocity - other.velocity
    for speed, gap, over in zip(v, other.low - motion.high, other.high - motion.low, strict=True):
        if speed == 0:
            if gap > 0 or over < 0:
                return inf
        else:
            times = sorted((gap / speed, over / speed))
            begin, end = max(begin, times[0]), min(end, times[1])
    return begin if begin <= end else inf
