"""Damage tuler-butcher."""

from typing import Any, NamedTuple

from karamelo_py.compiler import real, where
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics.principal import principal
from karamelo_py.points.laws import column, damage, damage_initiation
from karamelo_py.points.laws.damages import damage_after, initial_damage, initiation, integrity
from karamelo_py.points.laws.parameters import AboveZero, FromZero


class TulerButcher(NamedTuple):
    """Spall: failure by sustained tension.

    Parameters
    ----------
    sigma0
        Principal tension below which nothing fails.
    exponent
        Exponent of the tension beyond sigma0; 1: an impulse, 0: a duration.
    K
        Integral at which a point fails.

    Example
    -------
    damage(spall, tuler-butcher, 1e9, 2, 1.2e11)

    Notes
    -----
    Fails when the integral of (s1 - sigma0)^exponent over time reaches K, with the largest
    principal stress s1 of intact material (Tuler & Butcher 1968, Int. J. Fract. Mech. 4, 431-437).
    It then sustains pressure only. Dump columns: damage, and damage_init, the integral over K.

    See Also
    --------
    damage_johnson_cook, eos shock, material eos-strength
    """

    in_lanes = True
    scalarised = ("damage_after",)

    sigma0: FromZero
    exponent: FromZero
    K: AboveZero


column(TulerButcher, "damage", damage)
column(TulerButcher, "damage_init", damage_initiation)


class Pulled(NamedTuple):
    w: Any  # integral over K


@initial_damage.on(TulerButcher)
def _initial_damage_tuler_butcher(damage, like):
    return Pulled(0.0)


@damage_after.on(TulerButcher)
def _damage_after_tuler_butcher(damage, memory, step):
    values, _ = principal(step.stress)
    beyond = max(*values) - damage.sigma0
    pulled = beyond > 0
    rate = where(pulled, power(where(pulled, beyond, 1), damage.exponent), 0)
    return Pulled(memory.w + rate * step.dt / damage.K)


@initiation.on(TulerButcher)
def _initiation_tuler_butcher(damage, memory):
    return memory.w


@integrity.on(TulerButcher)
def _integrity_tuler_butcher(damage, memory):
    return where(memory.w < 1, real(1, memory.w), real(0, memory.w))
