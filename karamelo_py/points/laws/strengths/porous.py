"""Strengths crushable-foam and gurson."""

from math import inf, log, pi, sqrt
from typing import NamedTuple

from karamelo_py.compiler import any_lane, point_function, round_off, where
from karamelo_py.compiler.powers import exponential, logarithm, power
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws.eos import (
    VolumeStep,
    at_pressure,
    bulk_modulus,
    compressed,
    pressure,
)
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.strengths import inelastic_ratio, remembers, respond
from karamelo_py.points.laws.strengths.hardening import elastic_trial, onto_yield_surface
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError

MOST_PASSES = 80  # iterations of Newton's method with bisection
DENSE = 0.999999  # largest strain / strain of densification
NO_VOIDS = 1e-12  # void fraction below which pressure does not yield


class CrushableFoamConstants(NamedTuple):
    """Metal or polymer foam that is crushed by pressure and shear.

    Parameters
    ----------
    G
        Shear modulus.
    Y
        Yield stress in uniaxial compression and tension.
    nu
        Plastic Poisson's ratio, 0 to less than 0.5.
    H
        Linear hardening.
    a, e, beta
        Densification: a ln(1/(1 - (ep/e)^beta)), with the strain e at which no pores are left.

    Example
    -------
    eos(alporas, linear, 250, 0.4e9)
    strength(alporas, crushable-foam, 0.4e9, 1.7e6, 0.05, 1e6, 5e6, 1.8, 4)
    material(alporas, eos-strength, alporas, alporas)

    Notes
    -----
    sqrt((q^2 + alpha^2 p^2)/(1 + alpha^2/9)) is at most Y + H ep + a ln(1/(1 - (ep/e)^beta)), with
    alpha^2 = 9/2 (1 - 2 nu)/(1 + nu). Flow is associated; the left side times the increment of the
    plastic strain ep is the plastic work, so ep is the axial plastic strain in uniaxial stress
    (Deshpande & Fleck 2000, J. Mech. Phys. Solids 48, 1253-1283). The plastic volume ratio is the
    dump column Jp. With eos p-alpha, strain increments must be below the elastic strain at yield;
    in larger steps, pores reduce the pressure before the foam yields.

    See Also
    --------
    eos p-alpha, gurson, plastic
    """

    G: AboveZero
    Y: AboveZero
    nu: FromZero = 0.0
    H: FromZero = 0.0
    a: FromZero = 0.0
    e: AboveZero = 1.0
    beta: AboveZero = 1.0

    def checked(self):
        G, Y, nu, *hardening = self
        if not nu < 0.5:
            message = f"with nu = {nu:g} the plastic volume cannot change"
            raise ScriptError(message, argument="nu", expected="below 0.5, or strength plastic")
        return CrushableFoam(G, Y, 4.5 * (1 - 2 * nu) / (1 + nu), *hardening)


class CrushableFoam(NamedTuple):
    style = "crushable-foam"
    in_lanes = True

    G: float
    Y: float
    squared: float  # alpha^2
    H: float
    a: float
    e: float
    beta: float


class Gurson(NamedTuple):
    """Porous metal whose voids grow, nucleate and join until it fails (GTN).

    Parameters
    ----------
    G
        Shear modulus.
    Y, e, n
        Flow stress of the matrix, Y (1 + em/e)^n.
    f0
        Initial void fraction.
    q1, q2
        Constants of Tvergaard.
    fc, ff
        Void fractions at which voids begin to join, and at failure; with fc = 1 they do not join.
    fn, en, sn
        Nucleation in tension: void fraction, mean and deviation of the matrix strain.

    Example
    -------
    strength(steel, gurson, 80e9, 400e6, 5e-3, 0.1, 1e-3, 1.5, 1, 0.15, 0.25, 0.04, 0.3, 0.1)

    Notes
    -----
    (q/Ym)^2 + 2 q1 f cosh(3 q2 p/(2 Ym)) is at most 1 + (q1 f)^2; flow is associated and (1 - f) Ym
    dem the plastic work (Gurson 1977; Tvergaard & Needleman 1984, Acta Metall. 32, 157-169). Voids:
    df = (1 - f) dev + fn/(sn sqrt(2 pi)) exp(-((em - en)/sn)^2/2) dem. Beyond fc, f in the yield
    surface increases (1/q1 - fc)/(ff - fc) times as fast. Each step uses Ym and f at its beginning:
    at a strain of 0.4 the error is 6 % with steps of 0.04, 1 % with steps of 0.008. Compression
    closes voids, even of failed metal, which is then intact again; without voids, metal yields at q
    = Ym. Dump columns: ep (em), f, Jp (plastic volume ratio).

    See Also
    --------
    swift, damage damage_johnson_cook, crushable-foam
    """

    in_lanes = True

    G: AboveZero
    Y: AboveZero
    e: AboveZero
    n: FromZero
    f0: FromZero
    q1: AboveZero = 1.5
    q2: AboveZero = 1.0
    fc: AboveZero = 1.0
    ff: AboveZero = 2.0
    fn: FromZero = 0.0
    en: FromZero = 0.3
    sn: AboveZero = 0.1

    def checked(self):
        if not self.f0 < min(self.fc, 1 / self.q1):
            message = f"with a void fraction of {self.f0:g} the metal has failed from the start"
            raise ScriptError(message, argument="f0", expected="below fc and 1/q1")
        if not self.ff > self.fc:
            message = f"failure at {self.ff:g} is not above fc = {self.fc:g}"
            raise ScriptError(message, argument="ff", expected="a void fraction above fc")
        return self


remembers(CrushableFoam, ep=0.0, Jp=1.0)
remembers(Gurson, ep=0.0, f="f0", Jp=1.0)


class Trial(NamedTuple):
    q: float
    p: float
    K: float


class PlasticStep(NamedTuple):
    x: float  # equivalent strain of a foam
    work: float  # plastic work per unit volume
    opening: float  # plastic volume strain
    tension: bool


@point_function()
def returned(strength, memory, trial):
    """Return q and p on or inside the yield surface, and a foam's equivalent strain."""


@point_function()
def grown(strength, memory, flow):
    """Return the history variables after a `PlasticStep`, except the plastic volume ratio."""


@point_function(otherwise=True)
def most_recovered(strength, memory):
    """Return the largest possible (elastic volume ratio after a step) / (ratio of the trial)."""
    return inf


@inelastic_ratio.on(CrushableFoam)
@inelastic_ratio.on(Gurson)
def _inelastic_ratio_porous(strength, memory):
    return (memory.Jp,)


@respond.on(CrushableFoam)
@respond.on(Gurson)
def _respond_porous(strength, law, kin, step, memories):
    memory, heat = memories.strength, memories.heat
    elastic = step.j / memory.Jp
    warm = sum(thermal_pressure(law.temperature, heat))
    energy = compressed(law.eos, memories.energy, VolumeStep(elastic, elastic, step.dt), 0)
    p_trial = pressure(law.eos, elastic, energy, heat) + warm
    K = bulk_modulus(law.eos, elastic, energy, heat)
    trial = elastic_trial(strength.G, step.s, step.strain)
    q_trial = von_mises(trial)
    q, p, x = returned(strength, memory, Trial(q_trial, p_trial, K))
    slip = (q_trial - q) / (3 * strength.G)
    # The volume at the new pressure is elastic; the rest of the change is plastic.
    moved = p != p_trial
    after, _ = at_pressure(law.eos, elastic, memories.energy, p - warm, heat)
    after = min(where(moved, after, elastic), elastic * most_recovered(strength, memory))
    opening = logarithm(elastic / after)
    work = q * slip - p * opening
    memory = grown(strength, memory, PlasticStep(x, work, opening, p < 0))._replace(
        Jp=step.j / after
    )
    return onto_yield_surface(trial, q_trial, q, slip), memory, work


def foam_flow(strength, ep):
    some, dense = ep > 0, DENSE * strength.e
    ratio = min(where(some, ep, 1) / strength.e, DENSE)
    pores = where(some, power(ratio, strength.beta), 0)
    room = 1 - min(pores, DENSE)
    slope = strength.a * strength.beta * pores / (room * where(some, min(ep, dense), 1))
    Y = strength.Y + strength.H * ep - strength.a * logarithm(room)
    return Y + slope * max(ep - dense, 0), strength.H + slope


@returned.on(CrushableFoam)
def _returned_foam(strength, memory, trial):
    c, (Y, _) = 1 + strength.squared / 9, foam_flow(strength, memory.ep)
    first = sqrt((trial.q * trial.q + strength.squared * trial.p * trial.p) / c)
    stiff, bulk = 3 * strength.G / c, trial.K * strength.squared / c
    outside = first > Y
    low, high = first - first, first / min(stiff, bulk)
    x, moves = low, outside
    for _ in range(MOST_PASSES):
        Y, slope = foam_flow(strength, memory.ep + x)
        # q = q_t Y/(Y + 3 G x/c), and p follows the same rule.
        a, b = 1 / (Y + stiff * x), 1 / (Y + bulk * x)
        q, p = trial.q * Y * a, trial.p * Y * b
        size = sqrt((q * q + strength.squared * p * p) / c)
        by_q = q * q * a * (slope * stiff * x / Y - stiff)
        by_p = strength.squared * p * p * b * (slope * bulk * x / Y - bulk)
        excess = size - Y
        fall = (by_q + by_p) / (c * where(outside, size, 1)) - slope
        low, high = where(excess > 0, x, low), where(excess > 0, high, x)
        new = x - excess / where(fall < 0, fall, -1)
        new = where((low <= new) & (new <= high), new, 0.5 * (low + high))
        settled = abs(new - x) <= 4 * round_off(new) * (new + Y / stiff)
        x = where(moves, new, x)
        moves = moves & (not settled)
        if not any_lane(moves):
            break
    Y, _ = foam_flow(strength, memory.ep + x)
    q, p = trial.q * Y / (Y + stiff * x), trial.p * Y / (Y + bulk * x)
    return where(outside, q, trial.q), where(outside, p, trial.p), where(outside, x, low - low)


@grown.on(CrushableFoam)
def _grown_foam(strength, memory, flow):
    return memory._replace(ep=memory.ep + flow.x)


def voids(strength, f):
    """Return q1 times the void fraction of the yield surface, below 1."""
    faster = (1 / strength.q1 - strength.fc) / (strength.ff - strength.fc)
    more = max(f - strength.fc, 0)
    return min(strength.q1 * (min(f, strength.fc) + faster * more), DENSE)


def matrix(strength, ep):
    return strength.Y * power(1 + ep / strength.e, strength.n)


@most_recovered.on(Gurson)
def _most_recovered_gurson(strength, memory):
    return 1 / (1 - memory.f)  # ratio at which all voids are closed


@returned.on(Gurson)
def _returned_gurson(strength, memory, trial):
    Y, c = matrix(strength, memory.ep), voids(strength, memory.f)
    b = 1.5 * strength.q2 / Y
    size = abs(trial.p)
    # acosh of (1 + c^2)/(2 c) is -ln c; q is 0 for larger pressures.
    highest = where(c > NO_VOIDS, -logarithm(max(c, NO_VOIDS)) / b, size)
    top = min(size, highest)
    q, _, _ = on_gurson(Y, c, b, top)
    outside = (trial.q > q) | (size > highest)
    low, high = size - size, top
    x, moves = 0.5 * top, outside
    stiff, bulk = 6 * strength.G, 2 * trial.K * c * b * Y * Y
    for _ in range(MOST_PASSES):
        q, sinh, cosh = on_gurson(Y, c, b, x)
        fall = -Y * Y * c * b * sinh / max(q, 1e-9 * Y)
        excess = stiff * (size - x) * q - bulk * sinh * (trial.q - q)
        slope = stiff * ((size - x) * fall - q) - bulk * (b * cosh * (trial.q - q) - sinh * fall)
        low, high = where(excess > 0, x, low), where(excess > 0, high, x)
        new = x - excess / where(slope < 0, slope, -1)
        new = where((low <= new) & (new <= high), new, 0.5 * (low + high))
        settled = abs(new - x) <= 4 * round_off(new) * (new + Y)
        x = where(moves, new, x)
        moves = moves & (not settled)
        if not any_lane(moves):
            break
    q, _, _ = on_gurson(Y, c, b, x)
    # Voids that close within the step leave the matrix, and its pressure.
    least = where(trial.p > 0, size + trial.K * logarithm(1 - memory.f), 0)
    q, x = where(x < least, Y, q), max(x, least)
    p = where(trial.p < 0, -x, x)
    return where(outside, min(q, trial.q), trial.q), where(outside, p, trial.p), x - x


def on_gurson(Y, c, b, p):
    grown = exponential(min(b * p, -log(NO_VOIDS)))
    sinh, cosh = 0.5 * (grown - 1 / grown), 0.5 * (grown + 1 / grown)
    return Y * sqrt(max(1 + c * c - 2 * c * cosh, 0)), sinh, cosh


@grown.on(Gurson)
def _grown_gurson(strength, memory, flow):
    f = memory.f
    x = max(flow.work, 0) / ((1 - f) * matrix(strength, memory.ep))
    away = (memory.ep + 0.5 * x - strength.en) / strength.sn
    density = strength.fn / (strength.sn * sqrt(2 * pi)) * exponential(-0.5 * away * away)
    born = where(flow.tension, density * x, 0)
    # (1 - f) Jp is constant without nucleation.
    new = 1 - (1 - f) * exponential(-flow.opening) + born
    return memory._replace(ep=memory.ep + x, f=min(max(new, 0), DENSE))
