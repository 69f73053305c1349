"""Damages by stress: tuler-butcher, cochran-banner, formula."""

from collections import namedtuple
from math import isnan, nan
from typing import Any, ClassVar, NamedTuple

from karamelo_py.compiler import real, where
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import dev, tr, von_mises
from karamelo_py.points.kinematics.principal import principal
from karamelo_py.points.laws import answers, column, damage, damage_initiation
from karamelo_py.points.laws.damages import damage_after, initial_damage, initiation, integrity
from karamelo_py.points.laws.formulas import (
    Code,
    FormulaOf,
    ProgramWriter,
    evaluated,
    in_lanes,
    plain,
)
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.temperatures import temperature_or
from karamelo_py.script.errors import ScriptError


class TulerButcher(NamedTuple):
    """Spall: failure by sustained tension.

    Parameters
    ----------
    sigma0
        Principal tension below which there is no failure.
    exponent
        Exponent of the tension beyond sigma0. With 1, K is stress times time; with 0, a duration.
    K
        Value of the integral (see notes) at which a point fails.

    Example
    -------
    damage(spall, tuler-butcher, 1e9, 2, 1.2e11)

    Notes
    -----
    A point fails when the integral of (s1 - sigma0)^exponent over time reaches K, with the largest
    principal stress s1 of intact material (Tuler & Butcher 1968, Int. J. Fract. Mech. 4, 431-437).
    A point that has failed sustains pressure only. Dump columns: damage, and damage_init, the
    integral / K.

    See Also
    --------
    cochran-banner, formula, eos shock, material eos-strength
    """

    in_lanes = True
    scalarised = ("damage_after",)

    sigma0: FromZero
    exponent: FromZero
    K: AboveZero


column(TulerButcher, "damage", damage)
column(TulerButcher, "damage_init", damage_initiation)


class Pulled(NamedTuple):
    w: Any  # integral / K


@initial_damage.on(TulerButcher)
def _initial_damage_tuler_butcher(damage, template):
    return Pulled(0.0)


@damage_after.on(TulerButcher)
def _damage_after_tuler_butcher(damage, memory, step):
    values, _ = principal(step.stress)
    beyond = max(*values) - damage.sigma0
    pulled = beyond > 0
    rate = where(pulled, power(where(pulled, beyond, 1), damage.exponent), 0)
    return Pulled(memory.w + rate * step.dt / damage.K)


answers(TulerButcher, {initiation: "w"})


@integrity.on(TulerButcher)
def _integrity_tuler_butcher(damage, memory):
    return where(memory.w < 1, real(1, memory.w), real(0, memory.w))


class CochranBanner(NamedTuple):
    """Spall by cracks that open gradually.

    Parameters
    ----------
    sigma0
        Tension, as a pressure, at which cracks begin to open.
    D0
        Crack opening, a length, at which no tension is left: 50e-6 m for copper.

    Example
    -------
    damage(spall, cochran-banner, 2.2e9, 50e-6)

    Notes
    -----
    Tension is at most sigma0 (1 - (w/D0)^(2/3)) (Cochran & Banner 1977, J. Appl. Phys. 48,
    2729-2737). At that bound the opening w grows by the volume strain times the cell size. The lost
    fraction D of the stress of intact material never decreases. Dump columns: damage, and
    damage_init, w / D0.

    See Also
    --------
    tuler-butcher, formula, eos shock, material eos-strength
    """

    in_lanes = True

    sigma0: float
    D0: float
    cell_size: float = 0.0  # cell size h, set when the scene is lowered

    @classmethod
    def given(cls, sigma0: AboveZero, D0: AboveZero):
        return cls(sigma0, D0)


column(CochranBanner, "damage", damage)
column(CochranBanner, "damage_init", damage_initiation)


class Opened(NamedTuple):
    w: Any  # opening / D0
    left: Any  # fraction of the stress that is lost


@initial_damage.on(CochranBanner)
def _initial_damage_cochran_banner(damage, template):
    return Opened(0.0, 1.0)


@damage_after.on(CochranBanner)
def _damage_after_cochran_banner(damage, memory, step):
    tension = 1 / 3 * tr(step.stress)
    bound = damage.sigma0 * cracked(memory.w)
    opens = memory.left * tension > bound
    wider = where(opens, max(step.expansion, 0) * damage.cell_size / damage.D0, 0)
    w = min(memory.w + wider, 1)
    left = damage.sigma0 * cracked(w) / where(opens, tension, 1)
    return Opened(w, where(opens, min(memory.left, left), memory.left))


def cracked(w):
    """Return the fraction of the tension that cracks with the opening `w` sustain."""
    some = w > 0
    return 1 - where(some, power(where(some, w, 1), 2 / 3), 0)


answers(CochranBanner, {initiation: "w", integrity: "left"})


class RateFormula(FormulaOf):
    """Script argument: a growth rate of damage."""

    script_kind: ClassVar[str] = "a formula of s1, p, q, t, epdot, T and w"
    names = ("s1", "p", "q", "t", "epdot", "T", "w")
    quantity = "the growth of damage"
    expected = script_kind


class ByRate:
    __slots__ = ()
    scalarised = ("damage_after",)
    start: ClassVar[int]
    rate: ClassVar[Code]
    directed: ClassVar[bool]  # whether s1 is needed


DamageFields = namedtuple("DamageFields", ("brittleness", "initial_temperature"))


class DamageFormula(ByRate, DamageFields):
    """Failure by a growth rate that is a formula of stress, plastic strain rate and temperature.

    Parameters
    ----------
    rate
        Growth rate of w: a formula of the largest principal stress s1, pressure p, von Mises
        stress q and triaxiality t = -p/q of intact material, plastic strain rate epdot, temperature
        T and w.
    brittleness
        D grows from 0 to 1 while w grows from 1 to 1 + 1/brittleness; by default at once.
    T
        Temperature, if neither the material nor its solid has one.

    Example
    -------
    damage(spall, formula, max(s1 - 1e9, 0)^2/1.2e11)
    damage(ductile, formula, epdot/(0.54 + 4.89*exp(-3.03*t)), brittleness=10)

    Notes
    -----
    Negative rates count as 0. A broken point sustains pressure only. Dump columns: damage, and
    damage_init, which is w.

    See Also
    --------
    damage_johnson_cook, tuler-butcher, cochran-banner, strength formula, eos formula
    """

    __slots__ = ()
    syntax = "rate[, number=...][, brittleness=][, T=293]"

    @classmethod
    def given(
        cls, rate: RateFormula, *, brittleness: AboveZero = 1e30, T: FromZero = 293.0
    ) -> NamedTuple:
        term = plain(rate, "rate")
        writer = ProgramWriter(RateFormula.names)
        codes: dict[str, Any] = {"rate": writer.code(term), "directed": "s1" in rate.names}
        codes["style"] = "formula"
        codes["in_lanes"] = in_lanes(codes["rate"])
        fields = {"brittleness": brittleness, "initial_temperature": T}
        law = writer.law(ByRate, fields, codes)
        pulled = 1.0, -1 / 3, 1.0, 1 / 3, 1.0, T, 0.5
        try:
            growth = evaluated(law.rate, law, pulled)
        except ArithmeticError:
            growth = nan
        if isnan(growth):
            raise ScriptError(
                "the growth is not a number in uniaxial tension",
                argument="rate",
                expected="a number for every tension, such as max(s1, 0)",
            )
        return law


column(ByRate, "damage", damage)
column(ByRate, "damage_init", damage_initiation)


@initial_damage.on(ByRate)
def _initial_damage_by_rate(damage, template):
    return Pulled(0.0)


@damage_after.on(ByRate)
def _damage_after_by_rate(damage, memory, step):
    p = -1 / 3 * tr(step.stress)
    largest = max(*principal(step.stress)[0]) if damage.directed else p
    T = temperature_or(step.heat, damage.initial_temperature)
    q = von_mises(dev(step.stress))
    at = (largest, p, q, step.triaxiality, step.strain / step.dt, T, memory.w)
    return Pulled(memory.w + max(evaluated(damage.rate, damage, at), 0) * step.dt)


answers(ByRate, {initiation: "w"})


@integrity.on(ByRate)
def _integrity_by_rate(damage, memory):
    return where(memory.w < 1, 1, 1 - min((memory.w - 1) * damage.brittleness, 1))
