"""The compiled evaluator of formulas, against NumPy."""

import math
import re
from statistics import NormalDist

import numpy as np
import pytest

from karamelo_py.compiler.programs import BLOCK, ROWS
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene.hub import Hub
from karamelo_py.script.formula import (
    CONSTANT,
    KEEP,
    KEPT,
    POINT,
    SPREAD,
    UNIFORM,
    Program,
    evaluate,
)
from karamelo_py.script.operations import OPERATIONS
from karamelo_py.script.parser import parse_text


@pytest.fixture
def hub():
    hub = Hub(Console(quiet=True))
    Interpreter(hub)
    hub.values.set("time", 0.7)
    hub.values.set("timestep", 12)
    hub.values.set("dt", 0.05)
    hub.values.publish_vector("Ek")
    hub.values.set("Ek_s", 3.5)
    return hub


def formula(hub, text):
    raw, node = parse_text(text)
    return hub.interpreter.evaluate(node, raw)


erf = np.vectorize(math.erf)
gamma = np.vectorize(math.gamma)
lgamma = np.vectorize(math.lgamma)
inv_norm = np.vectorize(NormalDist().inv_cdf)
A, B = np.random.default_rng(1).uniform(-0.9, 0.9, (2, 300))
CASES = {
    "x + y": A + B,
    "x - y": A - B,
    "x*y": A * B,
    "x/y": A / B,
    "x % y": np.mod(A, B),
    "mod(x, y)": np.mod(A, B),
    "remainder(x, y)": A - B * np.rint(A / B),
    "abs(x)^y": np.abs(A) ** B,
    "x^2 + x^3 + x^-1": A**2 + A**3 + 1 / A,
    "pow(2, x)": 2**A,
    "-x": -A,
    "x < y": A < B,
    "x <= y": A <= B,
    "x > y": A > B,
    "x >= y": A >= B,
    "x == x": A == A,
    "x != y": A != B,
    "x > 0 && y > 0": (A > 0) & (B > 0),
    "x > 0 || y > 0": (A > 0) | (B > 0),
    "!(x > 0)": ~(A > 0),
    "abs(x)": np.abs(A),
    "min(x, y, 0)": np.minimum(np.minimum(A, B), 0),
    "max(x, y, 0)": np.maximum(np.maximum(A, B), 0),
    "floor(5*x)": np.floor(5 * A),
    "ceil(5*x)": np.ceil(5 * A),
    "round(5*x)": np.rint(5 * A),
    "trunc(5*x)": np.trunc(5 * A),
    "sign(x)": np.sign(A),
    "step(x)": A >= 0,
    "sqrt(abs(x))": np.sqrt(np.abs(A)),
    "cbrt(x)": np.cbrt(A),
    "exp(x)": np.exp(A),
    "exp2(x)": np.exp2(A),
    "expm1(x)": np.expm1(A),
    "log(abs(x))": np.log(np.abs(A)),
    "log10(abs(x))": np.log10(np.abs(A)),
    "log2(abs(x))": np.log2(np.abs(A)),
    "log1p(x)": np.log1p(A),
    "sin(x)": np.sin(A),
    "cos(x)": np.cos(A),
    "tan(x)": np.tan(A),
    "asin(x)": np.arcsin(A),
    "acos(x)": np.arccos(A),
    "atan(x)": np.arctan(A),
    "atan2(y, x)": np.arctan2(B, A),
    "sinh(x)": np.sinh(A),
    "cosh(x)": np.cosh(A),
    "tanh(x)": np.tanh(A),
    "asinh(x)": np.arcsinh(A),
    "acosh(2 + x)": np.arccosh(2 + A),
    "atanh(x)": np.arctanh(A),
    "hypot(x, y)": np.hypot(A, B),
    "erf(x)": erf(A),
    "erfc(x)": 1 - erf(A),
    "gamma(1 + x)": gamma(1 + A),
    "tgamma(1 + x)": gamma(1 + A),
    "lgamma(1 + x)": lgamma(1 + A),
    "inv_norm(1/(1 + exp(-10*x)))": inv_norm(1 / (1 + np.exp(-10 * A))),
    "if(x > 0, x, y)": np.where(A > 0, A, B),
    "if(x > 0, time, 1)": np.where(A > 0, 0.7, 1),
    "if(time > 0, x, 1)": A,
    "degrees(x)": np.degrees(A),
    "radians(x)": np.radians(A),
    "sin(x0)*cos(time) + x0*y0": np.sin(A) * np.cos(0.7) + A * B,
    "Ek_s*x + timestep - dt": 3.5 * A + 12 - 0.05,
    "time + Ek_s": np.full(300, 4.2),
    "x + 0*z + 0*z0": A,
}


@pytest.mark.parametrize("text", CASES)
def test_every_function_agrees_with_numpy(hub, text):
    x = np.column_stack([A, B])
    result = formula(hub, text).evaluate_points(hub.values, x)
    assert result == pytest.approx(np.asarray(CASES[text], float), rel=1e-13, abs=1e-14)


def test_every_function_and_operation_is_covered():
    from karamelo_py.script.functions import FUNCTIONS

    text = " ".join(CASES)
    assert [name for name in FUNCTIONS if f"{name}(" not in text] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1/(x-x)", np.inf),
        ("-1/(x-x)", -np.inf),
        ("0/(x-x)", np.nan),
        ("log(x-x)", -np.inf),
        ("sqrt(x-x-1)", np.nan),
        ("(x-x-1)^0.5", np.nan),
        ("exp(x-x+1000)", np.inf),
        ("acos(x-x+2)", np.nan),
        ("(x-x) % (x-x)", np.nan),
        ("gamma(x-x)", np.inf),
    ],
)
def test_no_result_is_nan_or_infinity_and_never_an_exception(hub, text, expected):
    result = formula(hub, text).evaluate_points(hub.values, np.ones((5, 3)))
    np.testing.assert_array_equal(result, np.full(5, expected))
    # The same number, without points.
    scalar = formula(hub, re.sub(r"\bx\b", "time", text)).evaluate(hub.values)
    np.testing.assert_array_equal(scalar, expected)


def test_positions_now_and_in_the_beginning_are_told_apart(hub):
    x, x0 = np.random.default_rng(2).normal(size=(2, 3 * BLOCK + 7, 3))
    result = formula(hub, "x + 10*y0 + 100*z").evaluate_points(hub.values, x, x0)
    assert result == pytest.approx(x[:, 0] + 10 * x0[:, 1] + 100 * x[:, 2], rel=1e-13)


def test_the_program_follows_the_published_values(hub):
    rising = formula(hub, "2*time")
    program = rising.program(hub.values)
    out, stack = np.zeros(BLOCK), np.zeros((ROWS, BLOCK))
    for time in (1.0, 2.0):
        hub.values.set("time", time)
        evaluate(program, hub.values.array, np.zeros((6, BLOCK)), BLOCK, out, stack)
        assert (out == 2 * time).all()
        assert rising.evaluate(hub.values) == 2 * time


def test_a_power_does_not_depend_on_those_of_other_points():
    """Blocks have other points in them with another number of threads."""
    code = np.array([[POINT, 0], [POINT, 1], [OPERATIONS["^"], 0]], np.int64)
    program, stack = Program(code, np.zeros(1)), np.zeros((ROWS, BLOCK))
    points, out = np.zeros((6, BLOCK)), np.zeros(BLOCK)
    points[0] = np.random.default_rng(0).uniform(0.5, 2, BLOCK)
    for power in (2, 3, 2.5):
        points[1] = power
        evaluate(program, np.zeros(4), points, BLOCK, out, stack)
        alone = out.copy()
        points[1, -3:] = 2, 3, 0.5
        evaluate(program, np.zeros(4), points, BLOCK, out, stack)
        np.testing.assert_array_equal(out[:-3], alone[:-3])


def test_only_the_count_asked_for_is_written():
    program = Program(np.array([[CONSTANT + UNIFORM, 0]]), np.array([3.0]))
    out = np.zeros(BLOCK)
    evaluate(program, np.zeros(4), np.zeros((6, BLOCK)), 5, out, np.zeros((ROWS, BLOCK)))
    assert out.sum() == 15


def test_a_named_formula_is_evaluated_once(hub):
    """Newton's method for cos(u) = u: each of its ten steps uses the one before three times."""
    steps = "\n".join("u = u - (cos(u) - u)/(-sin(u) - 1)" for _ in range(10))
    hub.interpreter.run_text(f"u = x + 1.5 + time/1000\n{steps}\n")
    found = hub.interpreter.variables["u"]
    result = found.evaluate_points(hub.values, np.column_stack([A, B]))
    assert result == pytest.approx(np.full(300, 0.7390851332151607), rel=1e-15)
    operations = list(found.program(hub.values).code[:, 0])
    assert operations.count(OPERATIONS["cos"]) == 10
    assert operations.count(KEEP) == 10
    assert operations.count(KEPT) == 4 * 9 + 4  # u, and in cos, in -u and in sin


def test_a_formula_of_time_is_evaluated_once_as_well(hub):
    hub.interpreter.run_text("a = sin(time)\nb = a*a + a\nc = b*x + b\n")
    found = hub.interpreter.variables["c"]
    b = np.sin(0.7) ** 2 + np.sin(0.7)
    result = found.evaluate_points(hub.values, np.column_stack([A, B]))
    assert result == pytest.approx(b * A + b, rel=1e-15)
    operations = list(found.program(hub.values).code[:, 0])
    assert operations.count(OPERATIONS["sin"] + UNIFORM) == 1
    assert KEEP + UNIFORM in operations


@pytest.mark.parametrize("nesting", ["(x + {})", "({} + x)", "min(1, 2*{})"])
def test_formulas_may_be_nested_beyond_the_stack(hub, nesting):
    lines = "".join("f = " + nesting.format("f") + "\n" for _ in range(300))
    hub.interpreter.run_text(f"f = x/1000\n{lines}")
    result = hub.interpreter.variables["f"].evaluate_points(hub.values, np.column_stack([A, B]))
    expected = A / 1000
    for _ in range(300):
        expected = np.minimum(1, 2 * expected) if "min" in nesting else expected + A
    assert result == pytest.approx(expected, rel=1e-12)
    # As deep in one line as the parser goes.
    deep = formula(hub, "x" + "+(x*2" * 60 + ")" * 60)
    assert deep.evaluate_points(hub.values, np.ones((3, 1))) == pytest.approx(121)


def test_what_is_the_same_everywhere_is_computed_once(hub):
    program = formula(hub, "sin(x0)*cos(time)").program(hub.values)
    operations = list(program.code[:, 0])
    assert operations == [
        POINT,
        OPERATIONS["sin"],
        1 + UNIFORM,
        OPERATIONS["cos"] + UNIFORM,
        SPREAD,
        OPERATIONS["*"],
    ]
