"""Damages: the lost fraction D of the strength of a point, a part of `eos_strength`.

A damage law is a NamedTuple; its history variables (`memory`) are a tuple. All of the stress except
the pressure is scaled by 1 - D; equation of state and strength do not depend on D.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import any_lane, point_function, where
from karamelo_py.compiler.powers import exponential, logarithm
from karamelo_py.points.laws import answers, column, damage, damage_initiation
from karamelo_py.points.laws.parameters import FromZero, check_temperatures, reference_rate
from karamelo_py.points.laws.temperatures import homologous
from karamelo_py.script.errors import ScriptError


@point_function(otherwise=True)
def initial_damage(damage, template):
    return ()


class FlowStep(NamedTuple):
    strain: Any  # increment of equivalent plastic strain
    triaxiality: Any  # mean stress / von Mises stress
    heat: Any  # `Warm` or ()
    dt: Any
    stress: Any  # Cauchy stress of intact material
    expansion: Any  # relative change of volume


@point_function()
def damage_after(damage, memory, step):
    pass


@point_function()
def integrity(damage, memory):
    pass


@point_function()
def initiation(damage, memory):
    """Return the damage initiation, which grows from 0; at 1 damage begins."""


# Triaxiality below which most metals do not fail.
_CLOSED = -3.0
_SMALLEST_FAILURE_STRAIN = 1e-6
# Damage is this number times (sum of strain increments / failure strain, minus 1), at most 1.
_BRITTLENESS = 10.0


class JohnsonCookDamage(NamedTuple):
    """Ductile failure of metals by plastic strain.

    Parameters
    ----------
    d1, d2, d3
        Failure strain d1 + d2 exp(d3 t) at the reference rate; t = mean stress / von Mises stress.
    d4
        Rate coefficient; 0 for none.
    d5
        Temperature coefficient; 0 for none.
    epsdot0
        Reference plastic strain rate.
    Tr, Tm
        Reference and melting temperature.

    Example
    -------
    damage(ductile, damage_johnson_cook, 0.54, 4.89, -3.03, 0.014, 1.12, 1, 298, 1356)

    Notes
    -----
    The failure strain is (d1 + d2 exp(d3 t)) (1 + d4 ln(rate/epsdot0)) (1 + d5 T*) with T* = (T -
    Tr) / (Tm - Tr) (Johnson & Cook 1985). The second factor is 1 up to the reference rate. The
    third is 1 without a temperature. w (dump column damage_init) is the sum of plastic strain
    increments / failure strain. Beyond w = 1, D (dump column damage) is 10 (w - 1), up to 1. There
    is no failure for t below -3. d1 may be negative; failure strains are at least 1e-6.

    sigma = (1 - D) s - p I, with p times 1 - D in tension. Stored energy that is lost by damage
    counts as dissipated.

    See Also
    --------
    strength johnson_cook, temperature plastic_work, material eos-strength
    """

    in_lanes = True

    d1: float
    d2: FromZero
    d3: float
    d4: FromZero
    d5: FromZero
    epsdot0: FromZero
    Tr: float
    Tm: float

    def checked(self):
        check_temperatures(self.Tr, self.Tm)
        if not self.d1 + self.d2 > 0:
            raise ScriptError(
                f"the failure strain in shear, d1 + d2 = {self.d1 + self.d2:g}, is not above 0",
                argument="d1",
                expected="d1 + d2 above 0",
            )
        return self._replace(epsdot0=reference_rate(self.epsdot0, self.d4, "d4"))


column(JohnsonCookDamage, "damage", damage)
column(JohnsonCookDamage, "damage_init", damage_initiation)


class Accumulated(NamedTuple):
    w: Any  # sum of plastic strain increments / failure strain


@initial_damage.on(JohnsonCookDamage)
def _initial_damage_johnson_cook_damage(damage, template):
    return Accumulated(0.0)


answers(JohnsonCookDamage, {initiation: "w"})


@damage_after.on(JohnsonCookDamage)
def _damage_after_johnson_cook_damage(damage, memory, step):
    strain, triaxiality, heat, dt, _, _ = step
    grows = (strain > 0) & (triaxiality > _CLOSED)
    if not any_lane(grows):
        return memory
    failure = damage.d1 + damage.d2 * exponential(min(damage.d3 * triaxiality, 50))
    rate = max(strain / (dt * damage.epsdot0), 1)
    failure *= 1 + damage.d4 * logarithm(rate)
    if len(heat):
        failure *= 1 + damage.d5 * homologous(heat, damage.Tr, damage.Tm)
    further = strain / max(failure, _SMALLEST_FAILURE_STRAIN)
    return Accumulated(where(grows, memory.w + further, memory.w))


@integrity.on(JohnsonCookDamage)
def _integrity_johnson_cook_damage(damage, memory):
    D = _BRITTLENESS * (memory.w - 1)
    return 1 - min(max(D, 0), 1)
