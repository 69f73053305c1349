"""Strengths tabulated and formula."""

from collections import namedtuple
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler import where
from karamelo_py.language.signature import TableFile
from karamelo_py.points.laws.formulas import (
    Code,
    FormulaOf,
    ProgramWriter,
    evaluated,
    in_lanes,
    plain,
)
from karamelo_py.points.laws.parameters import AboveZero, FromZero, Numbers
from karamelo_py.points.laws.strengths import remembers, respond, shear_response
from karamelo_py.points.laws.strengths.hardening import (
    flow_stress,
    radial_return,
    respond_at_pressure,
    surroundings,
)
from karamelo_py.script.derivatives import derivative, to_power
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.reading import read_text, refuse_decimal_commas

STEEPEST = 1e6  # largest slope of a flow stress / G


class Tabulated(NamedTuple):
    """Flow stress interpolated from a measured curve against plastic strain.

    Parameters
    ----------
    G
        Shear modulus.
    curve
        Pairs of plastic strain and flow stress, from strain 0; or a file with two numbers per line,
        separated by blanks or a comma (# begins a comment line).

    Example
    -------
    strength(steel, tabulated, 80e9, 0, 350e6, 0.02, 420e6, 0.1, 510e6, 0.4, 600e6)

    Notes
    -----
    Beyond the last point of the curve the flow stress is constant. The curve may fall by less than
    3 G per unit of plastic strain. ``strength(steel, tabulated, 80e9, curve.txt)`` reads a file.
    Each step solves for the plastic strain at the flow stress of the end of the step.

    See Also
    --------
    plastic, swift, johnson_cook, formula
    """

    G: float
    strain: Numbers
    stress: Numbers
    count: float

    syntax = "G, ep1, Y1[, ep2, Y2, ...] | file"

    @classmethod
    def given(cls, G: AboveZero, *curve: float | TableFile):
        points = _points(curve)
        _check_curve(points, G)
        strain, stress = map(tuple, points.T.tolist())
        return cls(G, Numbers(strain), Numbers(stress), len(points))


def _points(curve: tuple) -> np.ndarray:
    """Return plastic strain and flow stress (n, 2) of a curve."""
    if len(curve) == 1 and isinstance(curve[0], Path):
        path = curve[0]
        try:
            text = read_text(path)
            refuse_decimal_commas(path, text, "curve")
            points = np.loadtxt(text.replace(",", " ").splitlines(), ndmin=2)
        except (OSError, ValueError) as error:
            raise ScriptError(f"{path}: {error}", argument="curve") from None
        if points.shape[1:] != (2,):
            raise ScriptError(f"{path} has no two numbers in a line", argument="curve")
    elif any(isinstance(value, Path) for value in curve) or not curve or len(curve) % 2:
        raise ScriptError(
            "a curve is made of pairs of numbers, or is one file",
            argument="curve",
            expected="ep1, Y1, ep2, Y2, ..., or the name of a file",
        )
    else:
        points = np.array(curve, float).reshape(-1, 2)
    return points


def _check_curve(points: np.ndarray, G: float) -> None:
    strain, stress = points.T
    if not len(points) or strain[0] != 0:
        raise ScriptError(
            "the curve does not begin at zero plastic strain",
            argument="curve",
            expected="a first point at the plastic strain 0, with the yield stress",
        )
    if not (np.diff(strain) > 0).all():
        raise ScriptError("plastic strains of the curve do not rise", argument="curve")
    if not (stress > 0).all():
        raise ScriptError("a flow stress of the curve is not above 0", argument="curve")
    if not (np.diff(stress) > -3 * G * np.diff(strain)).all():
        raise ScriptError(
            "the curve falls by more than 3 G for each unit of plastic strain", argument="curve"
        )


remembers(Tabulated, ep=0.0)
shear_response.on(Tabulated)(radial_return)


@flow_stress.on(Tabulated)
def _flow_stress_tabulated(strength, before, increment, dt):
    x = before.memory.ep + increment
    last = int(strength.count) - 1
    for k in range(last):
        above = strength.strain[k + 1]
        if x < above:
            low = strength.stress[k]
            slope = (strength.stress[k + 1] - low) / (above - strength.strain[k])
            return low + slope * (x - strength.strain[k]), slope
    return strength.stress[last], 0 * x


SEEDS = ("ep", "epdot", "T", "p", "J")


class FlowFormula(FormulaOf):
    """Script argument: a flow stress."""

    script_kind: ClassVar[str] = "a formula of ep, epdot, T, p and J"
    names = SEEDS
    quantity = "the flow stress"
    expected = (
        "a formula of ep, epdot, T, p and J: plastic strain, its rate, temperature, "
        "pressure, volume ratio"
    )


class ByFlow:
    __slots__ = ()
    start: ClassVar[int]
    flow: ClassVar[Code]
    slopes: ClassVar[tuple[Code, ...]]  # derivatives with respect to ep and epdot


FlowFields = namedtuple("FlowFields", ("G", "initial_temperature"))


class FlowStress(ByFlow, FlowFields):
    """Flow stress from a formula of plastic strain, its rate and temperature.

    Parameters
    ----------
    G
        Shear modulus.
    Y
        The flow stress: a formula of the equivalent plastic strain ep, its rate epdot in the step,
        the temperature T, the pressure p and the volume ratio J.
    T
        Temperature, if neither the material nor its solid has one.

    Example
    -------
    strength(steel, formula, 80e9, 350e6 + 600e6*(1 - exp(-12*ep)))
    strength(hot, formula, 80e9, (350e6 + 275e6*ep^0.36)*(1 + 0.022*log(max(epdot, 1))))

    Notes
    -----
    In each step, Newton's method with the exact slope solves q = 3 G x + Y for the plastic strain
    x, with Y at the end; q is the von Mises stress of an elastic step. Y may fall by less than 3 G
    per unit of plastic strain; a negative Y counts as 0. The formula is compiled, with numbers of
    the script as parameters.

    See Also
    --------
    johnson_cook, zerilli-armstrong, tabulated, temperature plastic_work
    """

    __slots__ = ()
    syntax = "G, Y[, number=...][, T=293]"

    @classmethod
    def given(cls, G: AboveZero, Y: FlowFormula, *, T: FromZero = 293.0) -> Any:
        term = plain(Y, "Y")
        smooth = plain(term, "Y", {"sqrt": lambda a: to_power(a, 0.5)})  # allows its slope at 0
        writer = ProgramWriter(SEEDS)
        codes: dict[str, Any] = {
            "flow": writer.code(term),
            "slopes": tuple(writer.code(derivative(smooth, name)) for name in SEEDS[:2]),
            "style": "formula",
        }
        codes["in_lanes"] = in_lanes(codes["flow"])
        law = writer.law(ByFlow, {"G": G, "initial_temperature": T}, codes)
        _check_formula(law)
        return law


def _check_formula(law: Any) -> None:
    for ep in (0.0, 1e-3, 0.1, 1.0):
        for epdot in (0.0, 1.0, 1e4):
            try:
                Y = evaluated(law.flow, law, (ep, epdot, *surroundings(law, ())))
            except ArithmeticError:
                Y = np.nan
            if np.isnan(Y) or np.inf == Y:
                raise ScriptError(
                    f"the flow stress is {Y:g} where ep = {ep:g}, epdot = {epdot:g}, "
                    f"T = {law.initial_temperature:g}",
                    argument="Y",
                    expected="a number for every plastic strain and rate from 0 on",
                    hint="max(epdot, 1) excludes a zero rate; T=... begins at another T",
                )
    if not evaluated(law.flow, law, (1e-6, 1.0, *surroundings(law, ()))) > 0:
        raise ScriptError("the initial flow stress is not above 0", argument="Y")


remembers(ByFlow, ep=0.0)
respond.on(ByFlow)(respond_at_pressure)


@flow_stress.on(ByFlow)
def _flow_stress_by_flow(strength, before, increment, dt):
    around = surroundings(strength, before.heat)
    at = (before.memory.ep + increment, increment / dt, *around)
    flow = evaluated(strength.flow, strength, at)
    by_strain, by_rate = [evaluated(code, strength, at) for code in strength.slopes]
    slope = by_strain + by_rate / dt
    # There is no solution for slopes of -3 G or less; ep^0.3 at 0, and kinks, have no slope.
    slope = where(slope > -2 * strength.G, min(slope, STEEPEST * strength.G), -2 * strength.G)
    return max(flow, 0), slope
