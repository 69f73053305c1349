"""Laws of thin bodies: plane stress in 2D, uniaxial stress in 1D.

The inner law has tensors of `Axisymmetric`. A secant method with a fixed number of trials (without
branches in lanes) finds the strain increment q across the body (in 1D in y and z) for which the
stress across vanishes. The remaining stress is reduced in the next step (de Borst 1991; Klinkel &
Govindjee 2002); each point records the largest one.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real, where
from karamelo_py.points import laws
from karamelo_py.points.kinematics import Axisymmetric, LargeIncrement, large, nothing

WHOLE = Axisymmetric()
ENOUGH = 10  # number of trials for increments of any size
UNROLLED = 9  # number of trials up to which there is no loop
FURTHEST = 0.3  # largest change of the stretch across the body, in a trial
FLATTEST, STEEPEST = 1e-6, 4.0  # accepted slopes of the stress across / (rho c^2)


class Thin(NamedTuple):
    """The 3D `law` without stress on the faces of a body."""

    law: Any

    in_lanes = True
    trials = 3  # number of trials for small increments


class ThinInLargeIncrements(Thin):
    __slots__ = ()
    trials = ENOUGH


class State(NamedTuple):
    whole: Any  # history variables of the inner law
    across: Any  # thickness / initial thickness
    left: Any  # largest stress across the body that the trials of a step have left
    largest: Any  # largest component of stress so far


def with_strain_across(law, kin, dl, q):
    """Return the increment `dl` with a strain q across the body, for the inner law."""
    if isinstance(dl, LargeIncrement):
        step = with_strain_across(law, kin, dl.dl, q)
        return large(step) if laws.by_rates(law) else step
    zero = real(0, q)
    numbers = (*dl, q) if kin.dimension == 2 else (dl[0], zero, zero, q, q)
    return WHOLE.Tensor._make(numbers)


@point_function(otherwise=True)
def has_short_trials(law):
    return not laws.by_rates(law)


@laws.initial_state.on(Thin)
def _initial_state_thin(law, kin, template):
    return State(laws.initial_state(law.law, WHOLE, template), 1, 0, 0)


@laws.advance.on(Thin)
def _advance_thin(law, kin, state, dl, dt):
    inner, old = law.law, state.whole
    volume = laws.specific_volume(inner) * laws.jacobian(inner, WHOLE, old)
    squared = laws.wave_speed_squared(inner, WHOLE, old)
    modulus = squared / volume
    # Stress across per strain q: 2 G + lambda in a plate, 2 G + 2 lambda in a bar.
    rest = squared - min(laws.shear_part(inner, WHOLE, old), squared)
    first = modulus + (2 - kin.dimension) * rest / volume

    def tried(q):
        new = laws.advance(inner, WHOLE, old, with_strain_across(inner, kin, dl, q), dt)
        return new, laws.cauchy_stress(inner, WHOLE, new)

    large_trials = UNROLLED if has_short_trials(inner) else ENOUGH
    q, slope = modulus - modulus, first
    new, whole = tried(q)
    stress = whole[2]
    for _ in range((large_trials if isinstance(dl, LargeIncrement) else law.trials) - 1):
        furthest, left = FURTHEST * (1 + q), stress
        step = max(min(-stress / slope, furthest), -furthest)
        q = q + step
        new, whole = tried(q)
        stress = whole[2]
        secant = (stress - left) / where(step == 0, 1, step)
        usable = (secant > FLATTEST * modulus) & (secant < STEEPEST * modulus)
        slope = where(usable, secant, slope)
    largest = max(state.largest, abs(whole[0]), abs(whole[1]), abs(whole[3]))
    return State(new, state.across * (1 + q), max(state.left, abs(stress)), largest)


laws.wraps(
    Thin, "law", "whole", (
        laws.jacobian, laws.energy_density, laws.dissipated_energy, laws.damage,
        laws.damage_initiation, laws.temperature, laws.plastic_strain, laws.specific_volume,
        laws.heat_capacity, laws.conductivity, laws.with_temperature, laws.warmed, laws.lit,
    ), WHOLE,
)  # fmt: skip


@laws.by_rates.on(Thin)
def _by_rates_thin(law):
    return True  # load steps use logarithmic strain and need more trials


@laws.wave_speed_squared.on(Thin)
def _wave_speed_squared_thin(law, kin, state):
    return _slower(law, kin, state, laws.wave_speed_squared(law.law, WHOLE, state.whole))


@laws.wave_speed_bound.on(Thin)
def _wave_speed_bound_thin(law, kin, state):
    return _slower(law, kin, state, laws.wave_speed_bound(law.law, WHOLE, state.whole))


def _slower(law, kin, state, squared):
    """Return the squared wave speed of a thin body.

    Without strain across, Hooke's law has 2 G + lambda; a plate has 2 G + 2 G lambda / (2 G +
    lambda) = E / (1 - nu^2), a bar 2 G + 2 G lambda / (2 G + 2 lambda) = E.
    """
    shear = min(laws.shear_part(law.law, WHOLE, state.whole), squared)
    rest = squared - shear
    stiffness = shear + (3 - kin.dimension) * rest
    return shear + rest * shear / where(stiffness > 0, stiffness, 1)


def _in_body(function):
    @function.on(Thin)
    def _tensor_in_body(law, kin, state):
        s = function(law.law, WHOLE, state.whole)
        return kin.Symmetric._make(s[: len(kin.symmetric_names)])


for _function in (laws.kirchhoff_stress, laws.cauchy_stress, laws.elastic_strain):
    _in_body(_function)


@laws.delegating(laws.with_stress, Thin)
def _with_stress_thin(law, kin, state, stress):
    s = WHOLE.Symmetric._make((*stress, *nothing(WHOLE)[len(stress) :]))
    return state._replace(whole=laws.with_stress(law.law, WHOLE, state.whole, s))


@laws.number
def thickness(law, kin, state):
    """Return thickness / initial thickness."""
    return state.across


@laws.number
def stress_left(law, kin, state):
    """Return (largest stress across the body after a step) / (largest stress so far)."""
    return state.left / where(state.largest > 0, state.largest, 1)


laws.answers(Thin, {laws.stretch_across: "across"})
laws.column(Thin, "thickness", thickness)
laws.column(Thin, "stress_left", stress_left)
