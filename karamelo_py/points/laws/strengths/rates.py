"""Strengths steinberg-guinan, mts, norton and perzyna."""

from math import inf, log, tanh
from typing import NamedTuple

from karamelo_py.compiler import where
from karamelo_py.compiler.powers import exponential, logarithm, power
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero, Temperature
from karamelo_py.points.laws.strengths import (
    present,
    remembers,
    respond,
    shear_energy,
    shear_response,
)
from karamelo_py.points.laws.strengths.hardening import (
    around_flow,
    before_flow,
    elastic_trial,
    first_guess,
    flow_stress,
    onto_yield_surface,
    plastic_increment,
    radial_return,
    surroundings,
)
from karamelo_py.points.laws.temperatures import temperature_or

MELTED = 1e-6  # smallest factor g of the shear modulus
LEAST = 1e-30  # smallest plastic strain in a step that counts as a rate


class SteinbergGuinan(NamedTuple):
    """Flow stress and shear modulus of metals at high pressure, where the rate has no effect.

    Parameters
    ----------
    G
        Shear modulus at 300 K without pressure.
    Y0
        Initial flow stress.
    beta, n
        Hardening: the factor (1 + beta ep)^n.
    Ymax
        Bound of Y0 (1 + beta ep)^n.
    A
        Relative increase per pressure: 28e-12 1/Pa for copper.
    B
        Relative decrease per kelvin: 3.77e-4 for copper.
    Tm
        Melting temperature, above which there is no strength and no shear stiffness.
    T
        Temperature, if neither the material nor its solid has one.

    Example
    -------
    strength(copper, steinberg-guinan, 47.7e9, 120e6, 36, 0.45, 640e6, 28e-12, 3.77e-4, Tm=1790)

    Notes
    -----
    Y = min(Y0 (1 + beta ep)^n, Ymax) g with g = 1 + A p J^(1/3) - B (T - 300), not below 0; the
    shear modulus is G g (Steinberg, Cochran & Guinan 1980, J. Appl. Phys. 51, 1498-1504). Elastic
    shear strains do not change with g; the change of their energy counts as dissipated. Dump
    columns: ep, stiffness (g).

    See Also
    --------
    johnson_cook, mts, eos shock, eos mie-grueneisen
    """

    in_lanes = True

    G: AboveZero
    Y0: AboveZero
    beta: FromZero
    n: FromZero
    Ymax: AboveZero
    A: FromZero = 0.0
    B: FromZero = 0.0
    Tm: ByName[AboveZero] = inf
    initial_temperature: Temperature[FromZero] = 300.0

    def checked(self):
        return self._replace(Tm=min(self.Tm, 1e30))


remembers(SteinbergGuinan, ep=0.0, stiffness=1.0)


@present.on(SteinbergGuinan)
def _present_steinberg_guinan(strength, memory):
    return strength._replace(G=strength.G * memory.stiffness)


def stiffness_factor(strength, around):
    factor = 1 + strength.A * around.p * power(around.J, 1 / 3) - strength.B * (around.T - 300)
    return where(strength.Tm > around.T, max(factor, 0), 0)


@respond.on(SteinbergGuinan)
def _respond_steinberg_guinan(strength, law, kin, step, memories):
    around = around_flow(strength, law, step, memories)
    memory = memories.strength
    stiffness = max(stiffness_factor(strength, around), MELTED)
    ratio = stiffness / memory.stiffness
    softer = (1 - ratio) * shear_energy(present(strength, memory), kin, step.s)
    memory = memory._replace(stiffness=stiffness)
    step = step._replace(s=ratio * step.s)
    s, memory, work = radial_return(present(strength, memory), kin, step, memory, around)
    return s, memory, work + softer


@flow_stress.on(SteinbergGuinan)
def _flow_stress_steinberg_guinan(strength, before, increment, dt):
    factor = stiffness_factor(strength, surroundings(strength, before.heat))
    base = 1 + strength.beta * (before.memory.ep + increment)
    hard = strength.Y0 * power(base, strength.n)
    rises = hard < strength.Ymax
    slope = where(rises, hard * strength.n * strength.beta / base, 0)
    return min(hard, strength.Ymax) * factor, slope * factor


class Norton(NamedTuple):
    """Creep by a power of the stress, without a yield stress.

    Parameters
    ----------
    G
        Shear modulus.
    A, n
        The creep rate is A q^n, with the von Mises stress q.
    Q
        Activation temperature (energy / gas constant): the factor exp(-Q/T).
    T
        Temperature, if neither the material nor its solid has one.

    Example
    -------
    strength(ice, norton, 3.5e9, 2.4e-24, 3)
    strength(hot, norton, 60e9, 1e-35, 5, Q=30000, T=900)

    Notes
    -----
    In each step, the creep strain is found for the stress at the end of the step, so steps may be
    much longer than the relaxation time (Norton 1929). Dump column ep: the creep strain.

    See Also
    --------
    perzyna, formula, viscosity prony
    """

    in_lanes = True

    G: float
    log_A: float  # logarithm, as A itself may be too small for single precision
    n: float
    Q: float
    initial_temperature: float

    @classmethod
    def given(
        cls, G: AboveZero, A: AboveZero, n: AboveZero, *, Q: FromZero = 0.0, T: AboveZero = 293.0
    ):
        return cls(G, log(A), n, Q, T)


remembers(Norton, ep=0.0)
shear_response.on(Norton)(radial_return)


def power_of_rate(rate, n, increment):
    some = increment > 0
    value = where(some, power(where(some, rate, 1), 1 / n), 0)
    return value, value / (n * where(some, increment, 1))


@flow_stress.on(Norton)
def _flow_stress_norton(strength, before, increment, dt):
    some = increment > 0
    T = temperature_or(before.heat, strength.initial_temperature)
    log_rate = logarithm(where(some, increment, 1)) - logarithm(dt)
    log_q = (log_rate - strength.log_A + strength.Q / max(T, 1e-6)) / strength.n
    q = where(some, exponential(log_q), 0)
    return q, q / (strength.n * where(some, increment, 1))


@first_guess.on(Norton)
def _first_guess_norton(strength, before, q, slope):
    # Half of the strain that relaxes all stress: Newton's method then converges from either side.
    return 0.5 * q / slope, q - q


class Perzyna(NamedTuple):
    """Viscoplastic flow beyond a yield stress.

    Parameters
    ----------
    G
        Shear modulus.
    Y
        Yield stress at rest.
    H
        Increase of the yield stress per plastic strain.
    eta
        Viscosity parameter, a time.
    n
        Exponent of the overstress.

    Example
    -------
    strength(steel, perzyna, 80e9, 300e6, 1e9, 2.5e-2, 5)

    Notes
    -----
    The plastic strain rate is <q/(Y + H ep) - 1>^n/eta (Perzyna 1966, Adv. Appl. Mech. 9, 243-377);
    with eta = 1/D and n = q it is the law of Cowper and Symonds. In each step, the plastic strain
    is found for the stress at the end of the step.

    See Also
    --------
    norton, plastic, johnson_cook
    """

    in_lanes = True

    G: AboveZero
    Y: AboveZero
    H: FromZero
    eta: AboveZero
    n: AboveZero


remembers(Perzyna, ep=0.0)
shear_response.on(Perzyna)(radial_return)


@flow_stress.on(Perzyna)
def _flow_stress_perzyna(strength, before, increment, dt):
    still = strength.Y + strength.H * (before.memory.ep + increment)
    over, slope = power_of_rate(strength.eta * increment / dt, strength.n, increment)
    return still * (1 + over), strength.H * (1 + over) + still * slope


@first_guess.on(Perzyna)
def _first_guess_perzyna(strength, before, q, slope):
    over = max(q - strength.Y - strength.H * before.memory.ep, 0)
    return 0.5 * over / slope, q - q


class Mts(NamedTuple):
    """Flow stress of metals by the mechanical threshold, their flow stress at 0 kelvin.

    Parameters
    ----------
    G
        Shear modulus.
    sa
        Athermal stress.
    k
        Boltzmann's constant / cube of the Burgers vector: 0.823e6 Pa/K for copper.
    g0, rate0, p, q
        Normalized activation energy, reference rate and exponents of the obstacles.
    theta
        Hardening of the threshold, a stress.
    ss, gs, rates
        Saturation threshold at 0 kelvin, its normalized energy and its reference rate.
    s0
        Initial threshold.
    T
        Absolute temperature, if neither the material nor its solid has one.

    Example
    -------
    strength(cu, mts, 45.8e9, 40e6, 0.823e6, 1.6, 1e7, 0.6667, 1, 2.39e9, 900e6, 0.35, 1e8, 10e6)

    Notes
    -----
    Y = sa + s (1 - (k T/(g0 G) ln(rate0/epdot))^(1/q))^(1/p), with the threshold s: ds/dep = theta
    (1 - tanh(2 s/sm)/tanh 2), ln(sm/ss) = k T/(gs G) ln(epdot/rates) (Follansbee & Kocks 1988, Acta
    Metall. 36, 81-93). The dump column threshold is s. In each step, its increase is computed with
    the threshold at the beginning, and the flow stress with the threshold at the end.

    See Also
    --------
    johnson_cook, zerilli-armstrong, steinberg-guinan
    """

    in_lanes = True

    G: AboveZero
    sa: FromZero
    k: AboveZero
    g0: AboveZero
    rate0: AboveZero
    p: AboveZero
    q: AboveZero
    theta: FromZero
    ss: AboveZero
    gs: AboveZero
    rates: AboveZero
    s0: FromZero = 0.0
    initial_temperature: Temperature[AboveZero] = 293.0


remembers(Mts, ep=0.0, threshold="s0")


def threshold_after(strength, before, increment, dt):
    x, s = max(increment, LEAST), before.memory.threshold
    T = temperature_or(before.heat, strength.initial_temperature)
    exponent = strength.k * T / (strength.gs * strength.G)
    u = 2 * s / strength.ss * power(x / (dt * strength.rates), -exponent)
    curve = 1 - 2 / (exponential(2 * min(u, 50)) + 1)
    rise = strength.theta * (1 - curve / tanh(2))
    further = strength.theta / tanh(2) * (1 - curve * curve) * u * exponent
    return s + rise * increment, rise + further


@flow_stress.on(Mts)
def _flow_stress_mts(strength, before, increment, dt):
    s, slope = threshold_after(strength, before, increment, dt)
    x = max(increment, LEAST)
    T = temperature_or(before.heat, strength.initial_temperature)
    a = strength.k * T / (strength.g0 * strength.G)
    z = min(max(a * logarithm(strength.rate0 * dt / x), 1e-30), 1)
    left = max(1 - power(z, 1 / strength.q), 1e-30)
    S = power(left, 1 / strength.p)
    active = (z < 1) & (z > 1e-30)
    steeper = power(z, 1 / strength.q - 1) * S / (left * strength.p * strength.q) * a / x
    return strength.sa + S * s, S * slope + where(active, s * steeper, 0)


@shear_response.on(Mts)
def _shear_response_mts(strength, kin, step, memory, heat):
    trial = elastic_trial(strength.G, step.s, step.strain)
    q = von_mises(trial)
    x = plastic_increment(strength, q, memory, heat, step.dt)
    s, _ = threshold_after(strength, before_flow(strength, memory, heat), x, step.dt)
    flow = q - 3 * strength.G * x
    after = memory._replace(ep=memory.ep + x, threshold=s)
    return onto_yield_surface(trial, q, flow, x), after, flow * x
