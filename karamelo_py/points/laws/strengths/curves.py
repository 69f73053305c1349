"""Strengths tabulated and formula."""

from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler import implements, real, shared
from karamelo_py.compiler.slopes import Dual, value_of
from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import TableFile
from karamelo_py.points.laws.formulas import FormulaOf
from karamelo_py.points.laws.parameters import AboveZero, FromZero, Numbers
from karamelo_py.points.laws.strengths import remembers, respond, shear_response
from karamelo_py.points.laws.strengths.hardening import (
    flow_stress,
    radial_return,
    respond_at_pressure,
    surroundings,
)
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.formula import CONSTANT, POINT, SPREAD, UNIFORM
from karamelo_py.script.operations import FIRST_BINARY, SELECT, of_one, of_two
from karamelo_py.script.reading import read_text


class Tabulated(NamedTuple):
    """Flow stress interpolated in a measured curve over plastic strain.

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
    Beyond the last point the flow stress is constant; it may fall by less than 3 G per unit of
    plastic strain. ``strength(steel, tabulated, 80e9, curve.txt)`` reads a file. Each step solves
    for the plastic strain with the flow stress at its end.

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
    """Return (n, 2) plastic strain and flow stress."""
    if len(curve) == 1 and isinstance(curve[0], Path):
        path = curve[0]
        try:
            text = read_text(path).replace(",", " ")
            points = np.loadtxt(text.splitlines(), ndmin=2)
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
            "the curve does not begin where plastic flow does",
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
DEPTH = 8  # of the stack, a tuple


class FlowFormula(FormulaOf):
    """Script argument: a flow stress.

    Two numbers per instruction: the operation; a constant or the index of an input.
    """

    script_kind: ClassVar[str] = "a formula of ep, epdot, T, p and J"
    names = SEEDS
    quantity = "the flow stress"
    expected = (
        "a formula of ep, epdot, T, p and J: plastic strain, its rate, temperature, "
        "pressure, volume ratio"
    )

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Numbers:
        formula = super().from_script(hub, argument)
        program = formula.program_of(SEEDS, DEPTH)
        instructions = []
        for operation, operand in program.code:
            op = int(operation) % UNIFORM
            if op != SPREAD:
                constant = op == CONSTANT
                instructions += [op, program.constants[operand] if constant else operand]
        return Numbers(tuple(map(float, instructions)))


class FlowStress(NamedTuple):
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
    Each step solves q = 3 G x + Y for its plastic strain x, with Y at its end, by Newton's method
    with finite-difference slopes. Y may fall by less than 3 G per unit of plastic strain; a
    negative Y counts as 0. Formulas are interpreted, not compiled: ten times slower than a compiled
    law.

    See Also
    --------
    johnson_cook, zerilli-armstrong, tabulated, temperature plastic_work
    """

    G: float
    program: Numbers
    count: float
    initial_temperature: float

    @classmethod
    def given(cls, G: AboveZero, Y: FlowFormula, *, T: FromZero = 293.0):
        law = cls(G, Y, len(Y) // 2, T)
        _check_formula(law)
        return law


def _check_formula(law: FlowStress) -> None:
    for ep in (0.0, 1e-3, 0.1, 1.0):
        for epdot in (0.0, 1.0, 1e4):
            Y = value(law, ep, epdot, surroundings(law, ()))
            if np.isnan(Y) or np.inf == Y:
                raise ScriptError(
                    f"the flow stress is {Y:g} where ep = {ep:g}, epdot = {epdot:g}, "
                    f"T = {law.initial_temperature:g}",
                    argument="Y",
                    expected="a number for every plastic strain and rate from 0 on",
                    hint="max(epdot, 1) excludes a zero rate; T=... begins at another T",
                )
    if not value(law, 1e-6, 1.0, surroundings(law, ())) > 0:
        raise ScriptError("the flow stress is not above 0 at first", argument="Y")


def value(strength, ep, epdot, around):
    """Evaluate the formula in double precision."""
    stack = (0.0,) * DEPTH  # top first
    for k in range(int(strength.count)):
        op = int(strength.program[2 * k])
        operand = real(strength.program[2 * k + 1], 1.0)
        if op == CONSTANT:
            stack = (operand, *stack[:-1])
        elif op == POINT:
            seed = ep if operand == 0 else (epdot if operand == 1 else around.T)
            seed = seed if operand < 3 else (around.p if operand == 3 else around.J)
            stack = (real(seed, 1.0), *stack[:-1])
        elif op < FIRST_BINARY:
            stack = (of_one(op, stack[0]), *stack[1:])
        elif op < SELECT:
            stack = (of_two(op, stack[1], stack[0]), *stack[2:], 0.0)
        else:
            stack = (stack[1] if stack[2] != 0.0 else stack[0], *stack[3:], 0.0, 0.0)
    return stack[0]


remembers(FlowStress, ep=0.0)
respond.on(FlowStress)(respond_at_pressure)


@shared
def with_slopes(flow, strength, ep, epdot, around):
    return flow


@implements(with_slopes, Dual)
def _with_slopes_by_pressure(flow, strength, ep, epdot, around):
    plain = value_of(around)
    for name, size in (("p", 1e-4 * strength.G), ("J", 1e-6)):
        at = getattr(plain, name)
        ends = [value(strength, ep, epdot, plain._replace(**{name: at + h})) for h in (size, -size)]
        flow = flow + (ends[0] - ends[1]) / (2 * size) * (getattr(around, name) - at)
    return flow


@flow_stress.on(FlowStress)
def _flow_stress_flow_stress(strength, before, increment, dt):
    around = surroundings(strength, before.heat)
    plain = value_of(around)
    near = 1e-6 * (increment + 1e-4)
    # double precision, because the difference is small
    here = real(before.memory.ep, 1.0) + increment
    stress = max(value(strength, here, increment / dt, plain), 0.0)
    beyond = max(value(strength, here + near, (real(increment, 1.0) + near) / dt, plain), 0.0)
    flow = max(real(stress, increment), 0)
    slope = real((beyond - stress) / near, increment)
    flow = with_slopes(flow, strength, here, increment / dt, around)
    # a slope of -3 G or less has no solution
    return flow, max(slope, -2 * strength.G)
