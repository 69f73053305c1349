"""Eos formula, stiffened-gas, mie-grueneisen: pressure from volume and internal energy."""

from collections import namedtuple
from math import isfinite
from typing import Any, ClassVar, NamedTuple

from karamelo_py.compiler import any_lane, round_off, where
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    initial_energy,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.formulas import (
    Code,
    FormulaOf,
    ProgramWriter,
    evaluated,
    in_lanes,
    plain,
    with_numbers,
)
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero
from karamelo_py.points.laws.temperatures import temperature_or
from karamelo_py.points.laws.viscosity import artificial_viscosity
from karamelo_py.script import terms
from karamelo_py.script.derivatives import derivative
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression

NAMES = ("J", "E", "T")
SOLUTIONS = 3  # iterations for the energy of a step; one if the pressure is linear in energy
MOST_PASSES = 60


class PressureFormula(FormulaOf):
    """Script argument: a pressure as a formula of volume ratio and internal energy."""

    script_kind: ClassVar[str] = "a formula of J, E and T"
    names = NAMES
    quantity = "the pressure"
    expected = (
        "a formula of J, E and T: volume ratio, internal energy per initial volume, temperature"
    )


class ByPressure:
    __slots__ = ()
    in_lanes = True
    start: ClassVar[int]
    p: ClassVar[Code]
    slopes: ClassVar[tuple[Code, ...]]  # derivatives of p with respect to J and E
    linear: ClassVar[bool]  # True if p is linear in E


class GasByPressure(ByPressure):
    __slots__ = ()
    traits = LawTraits(any_speed=True, least_density=1e-3)


class SolidByPressure(ByPressure):
    __slots__ = ()
    traits = LawTraits(of_solids=True)


EosFields = namedtuple("EosFields", ("specific_volume", "initial", "initial_temperature"))


class EosFormula(NamedTuple):
    """Pressure from a formula of volume, internal energy and temperature.

    Parameters
    ----------
    rho0
        Density before deformation.
    p
        Pressure: a formula of J = rho0/rho, the internal energy E per initial volume, and the
        temperature T. Script variables are replaced by their present values; time and other varying
        quantities are an error.
    E
        Initial internal energy per initial volume.
    T
        Temperature in the formula, if neither the material nor its solid has one.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(water, formula, 1000, 2.2e9*(1/J - 1) + 0.5*E)
    eos(air, formula, 1.2, 0.4*E/J, E=2.5e5, Q1=2, Q2=0.2)
    eos(steel, formula, 7850, 160e9*(1 - J) + 5.8e6*(T - 293))

    Notes
    -----
    The energy changes by dE = -p dJ, with the mean pressure in the step and the initial T, and by
    plastic and viscous work. The strain energy is E minus initial energy and heat, plus the energy
    of thermal pressure. Wave speeds use the slope at constant entropy, -J (p_J - p p_E).

    See Also
    --------
    mie-grueneisen, stiffened-gas, ideal-gas, shock, strength formula, damage formula
    """

    rho0: AboveZero
    p: PressureFormula
    E: ByName[float] = 0.0
    T: ByName[FromZero] = 293.0
    Q1: ByName[FromZero] = 0.0
    Q2: ByName[FromZero] = 0.0

    def checked(self):
        rho0, p, E, T, *viscous = self
        return {"eos": eos_of(rho0, p, (E, T), "formula"), **artificial_viscosity(*viscous)}


def eos_of(
    rho0: float, formula: Expression, initial: tuple, style: str, kind: type = ByPressure
) -> NamedTuple:
    """Build the law. Raises ScriptError unless p is finite and K positive at rest."""
    term = plain(formula, "p")
    slopes = [derivative(term, name) for name in NAMES[:2]]
    rest = dict(zip(NAMES, (1.0, *initial), strict=True))
    p, *at_rest = (terms.evaluated(one, rest.__getitem__) for one in (term, *slopes))
    K = p * at_rest[1] - at_rest[0]
    if not isfinite(p) or not K > 0:
        raise ScriptError(
            f"the pressure at rest is {p:.4g} and the bulk modulus {K:.4g}",
            argument="p",
            expected="a pressure that falls with the volume ratio J",
        )
    writer = ProgramWriter(NAMES)
    codes: dict[str, Any] = {"p": writer.code(term), "slopes": tuple(map(writer.code, slopes))}
    codes |= {"linear": "E" not in slopes[1].names, "style": style}
    codes["in_lanes"] = in_lanes(codes["p"])
    kind = GasByPressure if initial[0] > 0 else kind
    fields = zip(EosFields._fields, (1 / rho0, *initial), strict=True)
    return writer.law(kind, dict(fields), codes)


class StiffenedGas(NamedTuple):
    """Pressure of a liquid under strong shocks: a gas with additional stiffness.

    Parameters
    ----------
    rho0
        Density at pressure p.
    gamma
        Exponent, above 1: 4.4 for water.
    stiffness
        Pressure p0 that stiffens the gas: 6e8 for water.
    p
        Initial pressure.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(water, stiffened-gas, 1000, 4.4, 6e8, p=1e5)

    Notes
    -----
    p = (gamma - 1) E/J - gamma p0 with the energy E per initial volume (Harlow & Amsden 1971;
    Menikoff & Plohr 1989). The speed of sound is sqrt(gamma (p + p0)/rho).

    See Also
    --------
    ideal-gas, fluid, formula
    """

    rho0: AboveZero
    gamma: float
    stiffness: AboveZero
    p: ByName[float] = 0.0
    Q1: ByName[FromZero] = 0.0
    Q2: ByName[FromZero] = 0.0

    def checked(self):
        rho0, gamma, stiffness, p, *viscous = self
        if not gamma > 1:
            raise ScriptError(f"gamma = {gamma:g} is impossible", argument="gamma", expected="> 1")
        formula = with_numbers("(g - 1)*E/J - g*p0", g=gamma, p0=stiffness)
        made = eos_of(rho0, formula, ((p + gamma * stiffness) / (gamma - 1), 0.0), "stiffened-gas")
        return {"eos": made, **artificial_viscosity(*viscous)}


class MieGrueneisen(NamedTuple):
    """Pressure of shocked solids and liquids, including the heat generated by the shock.

    Parameters
    ----------
    rho0
        Density before deformation.
    c0
        Speed of sound without shear, at zero pressure.
    S
        Slope of the shock speed U = c0 + S u against the material speed u after the shock.
    Gamma
        Grueneisen parameter; Gamma rho is constant.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(copper, mie-grueneisen, 8940, 3933, 1.5, 1.99, Q1=1.5, Q2=0.06)

    Notes
    -----
    p = rho0 c0^2 x (1 - Gamma x/2)/(1 - S x)^2 + Gamma E, with x = 1 - J and the energy E per
    initial volume; rho0 c0^2 x + Gamma E in tension (Meyers 1994, chapter 5). A shock reaches its
    Hugoniot state, and release follows an isentrope. The pole at S x = 1 must not be reached.

    See Also
    --------
    shock, formula
    """

    rho0: AboveZero
    c0: AboveZero
    S: FromZero
    Gamma: FromZero
    Q1: ByName[FromZero] = 0.0
    Q2: ByName[FromZero] = 0.0

    def checked(self):
        rho0, c0, S, Gamma, *viscous = self
        curve = "K*(1 - J)*(1 - G/2*max(1 - J, 0))/(1 - S*max(1 - J, 0))^2 + G*E"
        formula = with_numbers(curve, K=rho0 * c0**2, S=S, G=Gamma)
        made = eos_of(rho0, formula, (0.0, 0.0), "mie-grueneisen", SolidByPressure)
        return {"eos": made, **artificial_viscosity(*viscous)}


class EnergyAndHeat(NamedTuple):
    E: Any  # internal energy per reference volume
    heat: Any  # part of E that is not work of the pressure


@initial_energy.on(ByPressure)
def _initial_energy_by_pressure(eos, template):
    return EnergyAndHeat(eos.initial, 0.0)


def values(eos, j, E, heat):
    at = (j, E, temperature_or(heat, eos.initial_temperature))
    return [evaluated(code, eos, at) for code in (eos.p, *eos.slopes)]


@compressed.on(ByPressure)
def _compressed_by_pressure(eos, memory, step, heating):
    half = 0.5 * (step.j - step.before)
    fixed = memory.E + heating - half * values(eos, step.before, memory.E, ())[0]
    E = memory.E + heating
    for _ in range(1 if eos.linear else SOLUTIONS):
        p, _, slope = values(eos, step.j, E, ())
        E = E - (E + half * p - fixed) / (1 + half * slope)
    return EnergyAndHeat(E, memory.heat + heating)


@pressure.on(ByPressure)
def _pressure_by_pressure(eos, j, memory, heat):
    return values(eos, j, memory.E, heat)[0]


@bulk_modulus.on(ByPressure)
def _bulk_modulus_by_pressure(eos, j, memory, heat):
    p, by_volume, by_energy = values(eos, j, memory.E, heat)
    return max(j * (p * by_energy - by_volume), 0)


@compression_energy.on(ByPressure)
def _compression_energy_by_pressure(eos, j, memory):
    return memory.E - eos.initial - memory.heat


@at_pressure.on(ByPressure)
def _at_pressure_by_pressure(eos, j, memory, p, heat):
    # Newton's method along dE = -p dJ, in steps that at most halve or double the volume
    first, _, _ = values(eos, j, memory.E, heat)
    mean, new, moves = 0.5 * (first + p), j, j > 0
    for _ in range(MOST_PASSES):
        E = memory.E - mean * (new - j)
        at, by_volume, by_energy = values(eos, new, E, heat)
        slope = min(by_volume - mean * by_energy, 0)
        change = where(slope < 0, (p - at) / where(slope < 0, slope, 1), 0)
        next_one = max(min(new + change, 2 * new), 0.5 * new)
        moves = moves & (abs(next_one - new) > 2 * round_off(new) * new)
        new = where(moves, next_one, new)
        if not any_lane(moves):
            break
    return new, memory._replace(E=memory.E - mean * (new - j))


@ratio_at_pressure.on(ByPressure)
def _ratio_at_pressure_by_pressure(eos, p, heat):
    return at_pressure(eos, 1, EnergyAndHeat(eos.initial, 0.0), p, heat)[0]
