"""Strengths johnson-holmquist-2 and hjc."""

from math import inf, sqrt
from typing import NamedTuple

from karamelo_py.compiler import point_function, real, where
from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.points.kinematics import dev, inner, von_mises
from karamelo_py.points.laws import answers
from karamelo_py.points.laws.eos import (
    VolumeStep,
    at_pressure,
    bulk_modulus,
    compressed,
    crushed_strain,
    pressure,
)
from karamelo_py.points.laws.parameters import AboveZero, FromZero, reference_rate
from karamelo_py.points.laws.strengths import (
    added_energy,
    added_pressure,
    inelastic_ratio,
    remembers,
    respond,
)
from karamelo_py.points.laws.strengths.hardening import elastic_trial, onto_yield_surface
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError

LEAST_STRAIN = 1e-9  # smallest failure strain


class JohnsonHolmquist2(NamedTuple):
    """Strength of intact to crushed ceramics and glass under impact.

    Parameters
    ----------
    G
        Shear modulus.
    A, N
        Intact strength: A (P* + T*)^N.
    B, M
        Strength of broken material: B P*^M.
    C
        Rate coefficient; 0 for none.
    epsdot0
        Reference strain rate; it may be 0 if C is 0.
    T
        Largest tension, as a pressure.
    HEL
        Hugoniot elastic limit: axial stress at which a plane wave yields.
    PHEL
        Pressure at the Hugoniot elastic limit.
    D1, D2
        Failure strain: D1 (P* + T*)^D2.
    beta
        Fraction of the lost shear energy that becomes pressure (bulking), 0 to 1.
    sfmax
        Upper bound of the strength of broken material / strength at the elastic limit.

    Example
    -------
    eos(alumina, linear, 3700, 131e9)
    strength(a, johnson-holmquist-2, 9e10, 0.93, 0.6, 0.31, 0.6, 0, 1, 2e8, 2.8e9, 1.5e9, 0.005, 1)
    material(alumina, eos-strength, alumina, a)

    Notes
    -----
    The von Mises stress is at most sHEL (si - D (si - sf)), where the intact and broken strengths
    si and sf get the factor 1 + C ln(rate/epsdot0), P* = P/PHEL, T* = T/PHEL and sHEL = 3/2 (HEL -
    PHEL) (Johnson & Holmquist 1993, AIP Conf. Proc. 309, 981-984). The damage D is the sum of
    plastic strain / failure strain, up to 1, and 1 at once if the failure strain is 0. Beyond a
    tension of T (1 - D), gaps open. In compression, if the strength decreases in a step, the
    fraction beta of the lost shear energy becomes pressure. The rate is the total strain rate. Dump
    columns: ep, damage, bulking (the added pressure), opened (the volume ratio of gaps).

    When gaps open, energy has an error of first order in the step: -4 % with 10 % of the stable
    step, -0.7 % with 1 %.

    See Also
    --------
    eos linear, eos shock, damage tuler-butcher, mohr-coulomb
    """

    in_lanes = True
    crushing_breaks = False  # True if crushed pores count as damage

    G: AboveZero
    A: AboveZero
    N: FromZero
    B: FromZero
    M: FromZero
    C: FromZero
    epsdot0: FromZero
    T: FromZero
    HEL: AboveZero
    PHEL: AboveZero
    D1: FromZero
    D2: FromZero
    beta: FromZero = 1.0
    sfmax: AboveZero = inf

    def checked(self):
        if not self.HEL > self.PHEL:
            raise ScriptError(
                f"the elastic limit {self.HEL:g} is not above its pressure {self.PHEL:g}",
                argument="HEL",
                expected="the axial stress, PHEL plus two thirds of the strength",
            )
        if self.beta > 1:
            raise ScriptError(
                f"a fraction of {self.beta:g} is not possible", argument="beta", expected="0 to 1"
            )
        return self._replace(epsdot0=reference_rate(self.epsdot0, self.C, "C"))


class Concrete(NamedTuple):
    """Strength of concrete under impact (Holmquist, Johnson, Cook).

    Parameters
    ----------
    G
        Shear modulus.
    A, B, N
        Strength / fc: A (1 - D) + B P*^N, with P* = P/fc.
    C
        Rate coefficient; 0 for none.
    epsdot0
        Reference strain rate; it may be 0 if C is 0.
    fc
        Uniaxial compressive strength.
    T
        Largest tension, as a pressure.
    smax
        Upper bound of the strength / fc.
    D1, D2
        Strain to failure: D1 (P* + T*)^D2.
    efmin
        Smallest strain to failure.

    Example
    -------
    eos(solid, linear, 2640, 30e9)
    eos(concrete, p-alpha, solid, 1.1, 16e6, 800e6)
    strength(c, hjc, 14.86e9, 0.79, 1.6, 0.61, 0.007, 1, 48e6, 4e6, 7, 0.04, 1, 0.01)
    material(concrete, eos-strength, concrete, c)

    Notes
    -----
    The von Mises stress is at most fc (A (1 - D) + B P*^N) (1 + C ln(rate/epsdot0)), and at most
    smax fc; in tension it decreases to 0 at a pressure of -T (1 - D). D sums plastic strain and,
    with eos p-alpha, the volume strain of crushed pores, both divided by the strain to failure
    (Holmquist, Johnson & Cook 1993, 14th Int. Symp. Ballistics, 591-600). The three-part pressure
    curve of these authors is not built in: use eos p-alpha, which has the same parts, or eos
    formula. Dump columns: ep, damage, opened (the volume ratio of gaps).

    See Also
    --------
    johnson-holmquist-2, eos p-alpha
    """

    in_lanes = True
    beta = 0.0
    crushing_breaks = True

    G: AboveZero
    A: AboveZero
    B: FromZero
    N: FromZero
    C: FromZero
    epsdot0: FromZero
    fc: AboveZero
    T: AboveZero
    smax: AboveZero
    D1: AboveZero
    D2: FromZero
    efmin: AboveZero

    def checked(self):
        return self._replace(epsdot0=reference_rate(self.epsdot0, self.C, "C"))


remembers(Concrete, ep=0.0, damage=0.0, bulking=0.0, opened=1.0)
remembers(JohnsonHolmquist2, ep=0.0, damage=0.0, bulking=0.0, opened=1.0)


@inelastic_ratio.on(Concrete)
@inelastic_ratio.on(JohnsonHolmquist2)
def _inelastic_ratio_johnson_holmquist(strength, memory):
    return (memory.opened,)


answers(JohnsonHolmquist2, {added_pressure: "bulking"})


@added_energy.on(JohnsonHolmquist2)
def _added_energy_johnson_holmquist(strength, law, elastic, memories):
    # Elastic energy of the added pressure, (p + dP)^2/(2 K) - p^2/(2 K).
    p = pressure(law.eos, elastic, memories.energy, memories.heat)
    p += sum(thermal_pressure(law.temperature, memories.heat))
    added = memories.strength.bulking
    return 0.5 * added * (2 * p + added) / stiffness_at_rest(law, memories)


def stiffness_at_rest(law, memories):
    return bulk_modulus(law.eos, real(1, memories.strength.ep), memories.energy, memories.heat)


def rate_factor(strength, step):
    d = dev(step.strain)
    rate = sqrt(2 / 3 * inner(d, d)) / (step.dt * strength.epsdot0)
    return 1 + strength.C * logarithm(max(rate, 1))


@point_function()
def limits(strength, p, factor):
    """Return the intact and broken strengths, and the strain to failure."""


@limits.on(JohnsonHolmquist2)
def _limits_johnson_holmquist(strength, p, factor):
    above = max(p + strength.T, 0) / strength.PHEL
    intact = strength.A * power(above, strength.N) * factor
    broken = strength.B * power(max(p, 0) / strength.PHEL, strength.M) * factor
    scale = 1.5 * (strength.HEL - strength.PHEL)
    failure = max(strength.D1 * power(above, strength.D2), LEAST_STRAIN)
    return scale * intact, scale * min(min(broken, strength.sfmax), intact), failure


@limits.on(Concrete)
def _limits_concrete(strength, p, factor):
    above = max(p + strength.T, 0)
    confined = strength.B * power(max(p, 0) / strength.fc, strength.N) * factor
    cohesion = strength.A * min(above / strength.T, 1) * factor
    failure = max(strength.D1 * power(above / strength.fc, strength.D2), strength.efmin)
    ends = [strength.fc * min(end, strength.smax) for end in (cohesion + confined, confined)]
    return *ends, failure


@respond.on(Concrete)
@respond.on(JohnsonHolmquist2)
def _respond_johnson_holmquist(strength, law, kin, step, memories):
    memory, heat = memories.strength, memories.heat
    trial = elastic_trial(strength.G, step.s, step.strain)
    lowest = -strength.T * (1 - memory.damage)
    warm = sum(thermal_pressure(law.temperature, heat))
    before = step.j / memory.opened
    energy = compressed(law.eos, memories.energy, VolumeStep(before, before, step.dt), 0)
    whole, _ = at_pressure(law.eos, before, energy, lowest - memory.bulking - warm, heat)
    opened = max(step.j / whole, 1)
    p_eos = pressure(law.eos, step.j / opened, energy, heat) + warm
    p = p_eos + memory.bulking
    intact, broken, failure = limits(strength, p, rate_factor(strength, step))
    q, flow = von_mises(trial), intact - memory.damage * (intact - broken)
    x = max(q - flow, 0) / (3 * strength.G)
    lost = x
    if strength.crushing_breaks:
        lost = x + crushed_strain(law.eos, memories.energy, energy)
    damage = min(memory.damage + lost / failure, 1)
    weaker = intact - damage * (intact - broken)
    # Shear energy that is released beyond the plastic work.
    released = where(x > 0, (flow * flow - weaker * weaker) / (6 * strength.G), 0)
    K = stiffness_at_rest(law, memories)
    gained = where(p > 0, strength.beta * released, 0)
    bulking = where(gained > 0, sqrt(p * p + 2 * K * gained) - p_eos, memory.bulking)
    work = flow * x + released - gained - min(p, 0) * logarithm(opened / memory.opened)
    s = onto_yield_surface(trial, q, weaker, x)
    after = memory._replace(ep=memory.ep + x, damage=damage, bulking=bulking, opened=opened)
    return s, after, work
