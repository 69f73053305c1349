"""Strength plastic, and the base of von Mises strengths with any hardening."""

from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import (
    any_lane,
    implements,
    point_function,
    real,
    round_off,
    shared,
    where,
)
from karamelo_py.compiler.slopes import Dual, value_of
from karamelo_py.points.kinematics import dev, von_mises
from karamelo_py.points.laws.eos import pressure
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.temperatures import temperature_or, thermal_pressure


def elastic_trial(G, s, strain):
    # dev() acts on the sum, as rounding in many steps would give s a trace.
    return dev(s + 2 * G * strain)


class LinearHardening(NamedTuple):
    """Von Mises yield stress, constant or with linear hardening.

    Parameters
    ----------
    G
        Shear modulus.
    yield_stress
        Yield stress in uniaxial tension, sqrt(3) times the value in pure shear.
    H
        Hardening modulus: increase of the yield stress per unit of plastic strain.

    Example
    -------
    strength(mild, plastic, 80e9, 400e6)
    strength(copper, plastic, 43.3e9, 400e6, 100e6)

    Notes
    -----
    If the von Mises stress q = sqrt(3/2 s:s) after an elastic step exceeds the yield stress Y, the
    equivalent plastic strain (dump column ep) grows by (q - Y)/(3 G + H), and s is scaled to the
    yield stress (radial return; Wilkins 1964; de Souza Neto et al. 2008, section 7.3).

    See Also
    --------
    linear, johnson_cook, swift, eos, material eos-strength, compute max_plastic_strain
    """

    in_lanes = True

    G: AboveZero
    yield_stress: AboveZero
    H: FromZero = 0.0

    def checked(self):
        return self if self.H > 0 else Plastic(self.G, self.yield_stress)


class Plastic(NamedTuple):
    style = "plastic"
    in_lanes = True
    H = 0.0

    G: float
    yield_stress: float


remembers(Plastic, ep=0.0)
remembers(LinearHardening, ep=0.0)


@shear_response.on(Plastic)
@shear_response.on(LinearHardening)
def _shear_response_linear_hardening(strength, kin, step, memory, heat):
    trial = elastic_trial(strength.G, step.s, step.strain)
    q = von_mises(trial)
    flow = strength.yield_stress + strength.H * memory.ep
    x = max(q - flow, 0) / (3 * strength.G + strength.H)
    flow += strength.H * x
    return onto_yield_surface(trial, q, flow, x), memory._replace(ep=memory.ep + x), flow * x


class FlowState(NamedTuple):
    memory: Any
    heat: Any  # `Warm` or ()
    precomputed: Any


def before_flow(strength, memory, heat):
    return FlowState(memory, heat, precompute(strength, memory, heat))


@point_function()
def flow_stress(strength, before, increment, dt):
    """Return the flow stress and its slope after a plastic strain `increment` in a step dt."""


@point_function(otherwise=True)
def precompute(strength, memory, heat):
    """Return the part of the flow stress that does not depend on the increment."""
    return ()


@point_function(otherwise=True)
def first_guess(strength, before, q, slope):
    """Return a first guess of the plastic strain (0 for q below the flow stress), and a bound k.

    `slope` is 3 G. After an iteration of Newton's method has changed the strain by c, the next one
    changes it by at most about k c^2.
    """
    return real(0, q), real(0, q)


@point_function(otherwise=True)
def updated_memory(strength, memory, increment, dt):
    """Return the history variables after a step, whose plastic strain increment may be 0."""
    return memory._replace(ep=memory.ep + increment)


def onto_yield_surface(trial, q, flow, x):
    yields = x > 0
    return where(yields, flow / where(yields, q, 1), 1) * trial


def radial_return(strength, kin, step, memory, heat):
    """Scale the trial deviatoric stress by flow/q (radial return, Wilkins 1964).

    This is the `shear_response` of strengths with ``G``, a `flow_stress`, and ``ep`` in the memory;
    q is the trial's von Mises stress.
    """
    trial = elastic_trial(strength.G, step.s, step.strain)
    q = von_mises(trial)
    x = plastic_increment(strength, q, memory, heat, step.dt)
    flow = q - 3 * strength.G * x
    after = updated_memory(strength, memory, x, step.dt)
    return onto_yield_surface(trial, q, flow, x), after, flow * x


class Around(NamedTuple):
    """Arguments of a flow stress that depends on pressure, used instead of `heat`."""

    T: Any
    p: Any
    J: Any


def respond_at_pressure(strength, law, kin, step, memories):
    around = around_flow(strength, law, step, memories)
    return radial_return(strength, kin, step, memories.strength, around)


def around_flow(strength, law, step, memories):
    heat = memories.heat
    p = pressure(law.eos, step.j, memories.energy, heat)
    p += sum(thermal_pressure(law.temperature, heat))
    return Around(temperature_or(heat, strength.initial_temperature), p, step.j)


def surroundings(strength, heat):
    """Return `heat` as given by `respond_at_pressure`; else zero pressure and initial volume."""
    if len(heat) > 1:
        return heat
    return Around(temperature_or(heat, strength.initial_temperature), 0.0, 1.0)


_MOST_ITERATIONS = 80


@shared
def plastic_increment(strength, q, memory, heat, dt):
    """Solve q - 3 G x = flow stress for the plastic strain x of a step; x is 0 for smaller q.

    The left side falls with x and the flow stress does not fall, so x is unique for any step size.
    Newton's method is safeguarded by bisection.
    """
    slope = 3 * strength.G
    enough = 4 * round_off(q) * q  # round-off of the three terms
    small = sqrt(round_off(q)) * q
    low, high = 0.0, q / slope
    active = q > 0
    before = before_flow(strength, memory, heat)
    x, curved = first_guess(strength, before, q, slope)
    last = x
    for _ in range(_MOST_ITERATIONS):
        flow, hardening = flow_stress(strength, before, x, dt)
        excess = q - slope * x - flow
        active = active & ((x > 0) | (excess > 0))
        low = where(excess > 0, x, low)
        high = where(excess > 0, high, x)
        change = excess / (slope + hardening)
        new = x + change
        # With quadratic convergence, the next change is (c_n / c_(n-1))^2 c_n. Next to a kink it is
        # larger, so the excess must be small, too.
        square, least = change * change, round_off(q) * new
        next_is_small = (abs(change) * square <= least * last * last) & (curved * square <= least)
        done = (abs(excess) <= enough) | (next_is_small & (abs(excess) <= small))
        within = (low < new) & (new < high)
        middle = 0.5 * (low + high)
        # Rounding must not reduce the plastic strain.
        x = where(active, max(where(done | within, new, middle), 0), x)
        last = change
        active = active & (not (done | (middle <= low) | (middle >= high)))
        if not any_lane(active):
            break
    return x


@implements(plastic_increment, Dual)
def _plastic_increment_slopes(strength, q, memory, heat, dt):
    # The excess e(x, q, ...) vanishes: x' = -e' / (de/dx), with e' at fixed x.
    plain = value_of(strength)  # the modulus in it may depend on pressure
    x = plastic_increment(plain, value_of(q), value_of(memory), value_of(heat), dt)
    flow, hardening = flow_stress(strength, before_flow(strength, memory, heat), x, dt)
    excess = q - 3 * strength.G * x - flow
    rise = 1 / (3 * plain.G + value_of(hardening))
    return excess.chain(x, where(x > 0, rise, 0))
