"""Bodies in motion: noise of drifts and rotations, lags, and the fixes that hold them."""

from collections.abc import Iterator
from math import inf
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.laws import law_kind, law_traits, parameter
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.noise import borne
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.script.expressions import POINT_SEEDS

SLOW = 0.01  # of the wave speed, below which no energy gain was found for any duration
TORN = 9.0, 14.0  # angle, in radians, that a body tolerates with one point per cell: FLIP, moments


class Noise(NamedTuple):
    """The motion with the largest energy gain."""

    share: float  # of the tolerable amount
    speed: float  # of the body, or of its rim, over the wave speed
    cells: float  # that the body, or its rim, moves through
    angle: float = 0.0  # of rotation, in radians
    noisy: bool = True  # whether noise grows
    torn: bool = False  # whether the rim separates


def rings(law: Any) -> bool:
    """Return True if a body of this law vibrates: not fluids and flowing materials."""
    if law_traits(law).rebounds:
        return True
    strength = parameter(law, "strength", None)
    silent = strength is None or not law_traits(strength).rings
    return not silent and shear_modulus(strength) > 0


def yields(law: Any) -> bool:
    """Return True if an impact is dissipated by plastic flow."""
    return not any(law_traits(kind).rebounds for kind in law_kind(law))


def vibrating(s: Any) -> list[tuple[BodyMotion, Any]]:
    """List the solids that may vibrate, with their motions."""
    solids = list(s.hub.solids.values())
    bodies = [(one, solids[one.number].material.whole) for one in s.motions if s.waves > 0]
    return [(one, law) for one, law in bodies if rings(law)]


def drift_of(s: Any) -> Noise | None:
    """Estimate the energy gain by drift in the scene `s` (SceneFacts), also if tolerable."""
    if not (s.scheme.traits.keeping and s.moves and s.kept > 0.9) or _thrown(s):
        return None
    known, spacing = borne(s.basis), float(s.simulation.control.clock[0].spacing)
    averages = s.scheme.traits.bears_drift
    bound = (known.averaged if averages else known.drift)[s.sparse]
    bound /= known.line if s.d == 1 else 1
    speed = cells = 0.0
    for one, law in vibrating(s):
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


def _thrown(s: Any) -> bool:
    """Return True if nothing strains the only body: uniform velocity, weight, and no stress."""
    return (
        len(s.motions) == 1
        and bool((s.motions[0].fast == s.motions[0].slow).all())
        and s.hub.update.boundary != "reflect"
        and s.simulation.points.total("stored") == 0
        and all(
            fix.first_step_only
            or (fix.accelerates and all(f is None or f.is_constant for f in fix.formulas))
            for fix in s.hub.fixes.values()
        )
    )


def turn_of(s: Any) -> Noise | None:
    """Estimate the energy gain by rotation in the scene `s`, also if tolerable."""
    turns = s.moments or (s.moves and s.kept > 0.9)
    if not (s.scheme.traits.keeping and turns and s.d > 1) or s.hub.domain.axisymmetric:
        return None
    known, spacing = borne(s.basis), float(s.simulation.control.clock[0].spacing)
    dt, one_point, most = s.simulation.dt, s.sparse, None
    averages = s.scheme.traits.bears_drift
    bound = (known.rim_averaged if averages else known.rim)[one_point]
    for one, _ in vibrating(s):
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


# Squared distance over h^2 of a point from its nodes, weighted mean per direction: two points per
# cell with a linear basis, and second-order basis functions.
SPREAD, SPREAD_OF_OTHERS = 3 / 16, 1 / 4


class Lag(NamedTuple):
    """A free rotation that points follow too slowly."""

    share: float = 0.0  # of the angular velocity
    turns: float = 0.0

    @property
    def percent(self) -> float:
        return 100 * self.share


def lag_of(s: Any) -> Lag:
    """Estimate the lag of a free rotation in the total frame.

    The grid has the angular momentum of the point positions. It lacks the part within their
    surroundings, sum m tr D, of sum m r^2.
    """
    most = Lag()
    if s.moves or s.d == 1 or s.hub.domain.axisymmetric:
        return most
    h = float(s.simulation.control.clock[0].spacing)
    for one in s.motions:
        if one.spin * s.duration > most.turns * 2 * np.pi and not held(s, one).any():
            axis = one.turning / (one.spin or 1.0)
            spread = np.zeros((3, 3))
            spread[: s.d, : s.d] = one.spread
            squared = (np.trace(spread) - axis @ spread @ axis) / one.mass
            away = 2 * (SPREAD if s.linear else SPREAD_OF_OTHERS) * h * h
            most = Lag(min(away / squared, 1.0), one.spin * s.duration / (2 * np.pi))
    return most


def sides(one: BodyMotion, solid: Any) -> np.ndarray:
    """Return the lengths (d,) of a body: points lie inside it."""
    return one.high - one.low + 2 * solid.half_size.max(axis=0)


def held(s: Any, one: BodyMotion) -> np.ndarray:
    """Return the directions (d,) in which fixes hold nodes at a body, which then cannot drift."""
    found = np.zeros(s.d, np.bool_)
    for fix, x in fixes_at(s, one, lattice_at(s, one)):
        if len(x):
            found |= [formula is not None for formula in fix.formulas[: s.d]]
    return found


def lattice_at(s: Any, one: BodyMotion) -> Any:
    """Return the lattice that a body uses."""
    solid = list(s.hub.solids.values())[one.number]
    return s.hub.lattices[s.method.lattice_of(s.hub, solid)]


def fixes_at(s: Any, one: BodyMotion, lattice: Any) -> Iterator[tuple[Any, np.ndarray]]:
    """Yield each fix that prescribes velocities, and positions (n, d) of its nodes at a body."""
    for fix in s.hub.fixes.values():
        if not fix.prescribes_velocity:
            continue
        nodes = fix.group.nodes
        own = (nodes >= lattice.first) & (nodes < lattice.first + lattice.node_count)
        x = lattice.positions(nodes[own])[:, : s.d]
        yield fix, x[((x >= one.low - lattice.h) & (x <= one.high + lattice.h)).all(axis=1)]


def pressed_evenly(s: Any, one: BodyMotion) -> bool:
    """Return True if fixes hold a body by smooth plates on all sides but one: it deforms evenly.

    It then fills a box. Each plate holds all nodes of one side in the direction across it.
    """
    lattice, solid = lattice_at(s, one), list(s.hub.solids.values())[one.number]
    box = sides(one, solid).prod() * s.hub.domain.thickness
    if s.hub.domain.axisymmetric or np.sum(solid.volume0) < (1 - 1e-6) * box:
        return False
    pressed = set()
    for fix, x in fixes_at(s, one, lattice):
        held = [k for k, formula in enumerate(fix.formulas[: s.d]) if formula is not None]
        if not len(x):
            continue
        if len(held) > 1 or not fix.formulas[held[0]].names.isdisjoint(POINT_SEEDS):
            return False
        k, along = held[0], np.delete(np.arange(s.d), held)
        ends = [x[:, k].max() < one.low[k] + lattice.h, x[:, k].min() > one.high[k] - lattice.h]
        low, high = x[:, along].min(axis=0), x[:, along].max(axis=0)
        whole = (low <= one.low[along]).all() and (high >= one.high[along]).all()
        if not (any(ends) and whole):
            return False
        pressed.add((k, ends[0]))
    return len(pressed) >= 2 * s.d - 1


def _free_time(s: Any, one: BodyMotion) -> float:
    """Return the time of flight of a body until it meets another, or the edge of the domain."""
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
    """Return the time at which the boxes around two bodies meet; infinite if never."""
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
