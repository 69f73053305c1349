"""Motion through the grid that feeds what the grid does not see of velocities: how much of it."""

from math import inf
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.laws import law_kind
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.noise import borne
from karamelo_py.run.body_motion import BodyMotion

SLOW = 0.01  # of the speed of waves, up to where nothing is fed in any time that was tried
TORN = 9.0, 14.0  # angle, in radian, that a body bears with one point a cell: FLIP, moments


class Noise(NamedTuple):
    """The motion that feeds most.

    Attributes
    ----------
    share
        How much of what is borne it takes.
    speed
        Of the body, or of its rim, over the speed of waves.
    cells
        How many the body, or its rim, goes through.
    angle
        Of a turn, in radian.
    noisy, torn
        Whether noise grows, and whether the rim comes loose.
    """

    share: float
    speed: float
    cells: float
    angle: float = 0.0
    noisy: bool = True
    torn: bool = False


def rings(law: Any) -> bool:
    """Tell whether a body of this law vibrates: not fluids, nor what flows like one."""
    if getattr(law, "rebounds", False):
        return True
    strength = getattr(law, "strength", None)
    silent = strength is None or not getattr(strength, "rings", True)
    return not silent and shear_modulus(strength) > 0


def yields(law: Any) -> bool:
    """Tell whether it stops where it hits something: its impact is spent on plastic flow."""
    return not any(getattr(kind, "rebounds", False) for kind in law_kind(law))


def _feeds(s: Any) -> bool:
    """Tell whether the scheme is one of which these numbers are known."""
    return hasattr(s.scheme, "keeping")


def _averages(s: Any) -> bool:
    return getattr(s.scheme, "bears_drift", False)


def _bodies(s: Any) -> list[tuple[BodyMotion, Any]]:
    """The solids that may vibrate, and how they move."""
    solids = list(s.hub.solids.values())
    bodies = [(one, solids[one.number].material.law) for one in s.motions if s.waves > 0]
    return [(one, law) for one, law in bodies if rings(law)]


def drift_of(s: Any) -> Noise | None:
    """Measure what the drift in the scene `s` (SceneFacts) feeds, also where that is borne."""
    if not (_feeds(s) and s.moves and s.kept > 0.9):
        return None
    known, spacing = borne(s.basis), float(s.simulation.control.clock[0].spacing)
    bound = (known.averaged if _averages(s) else known.drift)[s.sparse]
    bound /= known.line if s.d == 1 else 1
    speed = cells = 0.0
    for one, law in _bodies(s):
        velocity = one.drift(s.hub.domain.axisymmetric)
        if np.linalg.norm(velocity) <= SLOW * s.waves:
            continue
        own = float(np.linalg.norm(velocity[~held(s, one)]))
        time = min(s.duration, _free_time(s, one)) if yields(law) else s.duration
        if SLOW < own / s.waves < known.fastest and own * time / spacing > cells:
            speed, cells = own / s.waves, own * time / spacing
    if not cells:
        return None
    return Noise(cells * s.simulation.dt * s.waves / spacing / bound, speed, cells)


def turn_of(s: Any) -> Noise | None:
    """Measure what the turn in the scene `s` feeds, also where that is borne."""
    turns = s.moments or (s.moves and s.kept > 0.9)
    if not (_feeds(s) and turns and s.d > 1) or s.hub.domain.axisymmetric:
        return None
    known, spacing = borne(s.basis), float(s.simulation.control.clock[0].spacing)
    dt, one_point, most = s.simulation.dt, s.sparse, None
    bound = (known.rim_averaged if _averages(s) else known.rim)[one_point]
    for one, _ in _bodies(s):
        speed, angle = one.spin * one.reach / s.waves, one.spin * s.duration
        if speed <= SLOW or held(s, one).any():
            continue
        cells = angle * one.reach / spacing
        torn = angle / TORN[s.moments] if one_point else 0.0
        noise = 0.0 if s.moments else cells * dt * s.waves / spacing / bound
        share = max(noise, torn)
        if share > (most.share if most else 0.0):
            most = Noise(share, speed, cells, angle, noise > 0, torn > 1)
    return most


def held(s: Any, one: BodyMotion) -> np.ndarray:
    """(d,) Find the directions in which fixes hold nodes at a body: it goes nowhere."""
    found, lattices = np.zeros(s.d, np.bool_), s.hub.lattices
    solid = list(s.hub.solids.values())[one.number]
    lattice = lattices[s.method.lattice_of(s.hub, solid)]
    for fix in s.hub.fixes.values():
        if not fix.prescribes_velocity:
            continue
        nodes = fix.group.nodes
        own = (nodes >= lattice.first) & (nodes < lattice.first + lattice.node_count)
        x = lattice.positions(nodes[own])[:, : s.d]
        near = ((x >= one.low - lattice.h) & (x <= one.high + lattice.h)).all(axis=1)
        given = [formula is not None for formula in fix.formulas[: s.d]]
        found |= near.any() & np.array(given)
    return found


def _free_time(s: Any, one: BodyMotion) -> float:
    """Time of flight of a body until it meets another, or the edge of the domain."""
    d, domain = s.d, s.hub.domain
    ways = zip(one.velocity, one.low, one.high, domain.lo[:d], domain.hi[:d], strict=True)
    first = min(
        ((hi - high) / v if v > 0 else (lo - low) / v for v, low, high, lo, hi in ways if v),
        default=inf,
    )
    for other in s.motions:
        if other is not one:
            first = min(first, _meeting(one, other))
    return max(first, 0.0)


def _meeting(one: BodyMotion, other: BodyMotion) -> float:
    """Time at which the boxes around two bodies meet; infinite if they never do."""
    begin, end = 0.0, inf
    for v, gap, over in zip(
        one.velocity - other.velocity, other.low - one.high, other.high - one.low, strict=True
    ):
        if v == 0:
            if gap > 0 or over < 0:
                return inf
        else:
            times = sorted((gap / v, over / v))
            begin, end = max(begin, times[0]), min(end, times[1])
    return begin if begin <= end else inf
