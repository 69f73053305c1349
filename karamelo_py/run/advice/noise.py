"""Motion through the grid that feeds what the grid does not see of velocities, told beforehand.

Thresholds are measured with disks of rubber and of metal, 4 to 16 cells across the radius, that
vibrate by 0.01 to 2 % while they drift or turn (docs/energy.md).
"""

from collections.abc import Iterator
from math import inf
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points.basis.cubic_spline import CubicSpline
from karamelo_py.points.laws import law_kind
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.neo_hookean import NeoHookean
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.laws.strengths.fluid import Viscous
from karamelo_py.points.laws.strengths.linear import Elastic
from karamelo_py.points.laws.strengths.mu_i import MuI
from karamelo_py.points.laws.thermoelastic import Thermoelastic
from karamelo_py.points.transfers.flip import FLIP
from karamelo_py.run.body_motion import Motion
from karamelo_py.run.timestep import sparse
from karamelo_py.schemes.musl import MUSL
from karamelo_py.schemes.usavg import USAVG
from karamelo_py.schemes.usf import USF
from karamelo_py.styles.fixes.velocity_nodes import VelocityNodes

SLOW = 0.01  # of the speed of waves, up to where nothing is fed in any time that was tried
TORN = 9.0, 14.0  # angle, in radian, that a body bears with one point a cell: FLIP, moments
ELASTIC = LinearElastic, NeoHookean, Thermoelastic


class Far(NamedTuple):
    """Cells crossed times c dt/h up to which energy is kept, with two points a cell or one.

    Attributes
    ----------
    drift
        By the centre of mass in the plane and in space, with musl and usf.
    line
        By how much less that is in 1D.
    averaged
        The same as `drift` with usavg.
    rim
        By the rim of a body that turns, with musl and usf.
    rim_averaged
        The same with usavg.
    fastest
        Times the speed of waves, from where on a drift feeds nothing.
    """

    drift: tuple[float, float]
    line: float
    averaged: tuple[float, float]
    rim: tuple[float, float]
    rim_averaged: tuple[float, float]
    fastest: float = inf


class Noise(NamedTuple):
    """What motion feeds.

    Attributes
    ----------
    share
        How much of what is borne it takes.
    words
        Name, reason and cure.
    cause
        The reason, in a run that gains energy.
    """

    share: float
    words: tuple[str, str, str]
    cause: str


JUMPS = Far((4, 2), 3, (35, 35), (15, 1.5), (inf, 7))  # functions whose gradients jump
BOXES = Far((18, 18), 6, (inf, inf), (60, 25), (inf, inf))
QUADRATIC = Far((54, 20), 6, (inf, inf), (inf, 25), (inf, inf))
CUBIC = Far((135, 70), 6, (inf, inf), (inf, inf), (inf, inf), fastest=1)


def far(basis: Any) -> Far:
    """What is known of these functions."""
    if getattr(basis, "gradient_jumps", False):
        return JUMPS
    if basis.steep_edge:
        return BOXES
    return CUBIC if isinstance(basis, CubicSpline) else QUADRATIC


def rings(law: Any) -> bool:
    """Whether a body of this law vibrates: not fluids, nor what flows like one."""
    if set(law_kind(law)) & set(ELASTIC):
        return True
    strength = getattr(law, "strength", None)
    return not isinstance(strength, (type(None), Viscous, MuI)) and shear_modulus(strength) > 0


def yields(law: Any) -> bool:
    """Whether it stops where it hits something: its impact is spent on plastic flow."""
    return not set(law_kind(law)) & {*ELASTIC, Elastic}


def noises(s: Any) -> Iterator[Noise]:
    """What the motion in the scene `s` (Foreseen) feeds, also where that is borne."""
    keeps = s.moves and isinstance(s.transfer, FLIP) and s.transfer.alpha > 0.9
    if not isinstance(s.scheme, (MUSL, USF, USAVG)):
        return
    if keeps:
        yield from _drift(s)
    if (keeps or s.moments) and s.d > 1 and not s.hub.domain.axisymmetric:
        yield from _turn(s)


def _bodies(s: Any) -> list[tuple[Motion, Any]]:
    """The solids that may vibrate, and how they move."""
    solids = list(s.hub.solids.values())
    bodies = [(one, solids[one.number].material.law) for one in s.motions if s.waves > 0]
    return [(one, law) for one, law in bodies if rings(law)]


def _drift(s: Any) -> Iterator[Noise]:
    known, spacing = far(s.basis), float(s.simulation.control.clock[0].spacing)
    averages = isinstance(s.scheme, USAVG)
    bound = (known.averaged if averages else known.drift)[sparse(s.hub)]
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
        return
    schemes = "usavg" if averages else "musl and usf"
    grows = "what the grid does not see of the velocities grows with each cell"
    gains = "if it vibrates, that gains a tenth to several times its energy"
    cure = "scheme(usavg), with which it grows ten times less, or not"
    if isinstance(s.basis, CubicSpline) and s.d == 3:
        gains = "it damps what vibrates (to 0.85 of its energy where that was tried)"
        cure = "method tlmpm"
    elif averages:
        cure = "quadratic-spline in the place of the basis"
    yield Noise(
        cells * s.simulation.dt * s.waves / spacing / bound,
        (
            "noise of a drift",
            f"a body drifts at {speed:.2g} times the speed of waves through about {cells:.0f} "
            f"cells, and with {schemes} {grows}: {gains}",
            cure,
        ),
        f"a drift through the grid, at {speed:.2g} times the speed of waves: with {schemes} "
        f"and {s.method.basis_name} functions {grows}",
    )


def _turn(s: Any) -> Iterator[Noise]:
    known, spacing = far(s.basis), float(s.simulation.control.clock[0].spacing)
    averages, dt, one_point = isinstance(s.scheme, USAVG), s.simulation.dt, sparse(s.hub)
    bound = (known.rim_averaged if averages else known.rim)[one_point]
    most = Noise(0.0, ("", "", ""), "")
    for one, _ in _bodies(s):
        speed, angle = one.spin * one.reach / s.waves, one.spin * s.duration
        if speed <= SLOW or held(s, one).any():
            continue
        cells = angle * one.reach / spacing
        torn = angle / TORN[s.moments] if one_point else 0.0
        noise = 0.0 if s.moments else cells * dt * s.waves / spacing / bound
        share = max(noise, torn)
        if share <= most.share:
            continue
        ends = "loses points at its rim" if torn > 1 else "gains a tenth of its energy or more"
        known_cures = {
            f"{2**s.d} points a cell": one_point,
            "quadratic-spline in the place of the basis": noise > 0 and not one_point,
        }
        cures = [cure for cure, helps in known_cures.items() if helps]
        turns = f"turns by about {angle:.2g} rad, its rim at {speed:.2g} times the speed of waves"
        way = f"with {s.words} and {s.method.basis_name} functions"
        most = Noise(
            share,
            (
                "noise of a turn",
                f"a body {turns} through about {cells:.0f} cells, and {way} it {ends} on the way",
                ", ".join([*cures, "or method tlmpm"]),
            ),
            f"a turn: a body {turns}, {way}",
        )
    if most.share:
        yield most


def held(s: Any, one: Motion) -> np.ndarray:
    """(d,) Whether fixes hold nodes at a body in each direction: it goes nowhere."""
    found, lattices = np.zeros(s.d, np.bool_), s.hub.lattices
    solid = list(s.hub.solids.values())[one.number]
    lattice = lattices[s.method.lattice_of(s.hub, solid)]
    for fix in s.hub.fixes.values():
        if not isinstance(fix, VelocityNodes):
            continue
        nodes = fix.group.nodes
        own = (nodes >= lattice.first) & (nodes < lattice.first + lattice.node_count)
        x = lattice.positions(nodes[own])[:, : s.d]
        near = ((x >= one.low - lattice.h) & (x <= one.high + lattice.h)).all(axis=1)
        given = [formula is not None and not formula.bound for formula in fix.formulas[: s.d]]
        found |= near.any() & np.array(given)
    return found


def _free_time(s: Any, one: Motion) -> float:
    """How long a body flies until it meets another, or the edge of the domain."""
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


def _meeting(one: Motion, other: Motion) -> float:
    """When the boxes around two bodies meet; infinite if they never do."""
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
