"""Names in scripts for Karamelo: which are free, and what further ones stand for."""

import math
from statistics import NormalDist

import pytest

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.functions import CONSTANTS


def run(text):
    """The interpreter and the warnings of a script."""
    hub, told = Hub(), []
    hub.warn = lambda message, **_: told.append(message)
    interpreter = Interpreter(hub)
    interpreter.run_text(text)
    return interpreter, told


@pytest.mark.parametrize("name", ["gamma", "step", "sign", "mod", "round", "erf", "boundary"])
def test_names_that_karamelo_does_not_reserve_are_free(name):
    """Said once: the second assignment is that of a variable like any other."""
    interpreter, told = run(f"{name} = 1.5\n{name} = 2*{name}\na = {name}*time\n")
    assert interpreter.variables[name] == 3
    assert interpreter.variables["a"].text == "3*time"
    assert [name in message for message in told] == [True]


def test_a_variable_hides_the_function_of_its_name():
    """gamma(y - 1) may be meant as a product: it is not taken for the function."""
    with pytest.raises(ScriptError) as caught:
        run("gamma = 1.4\na = gamma(2)\n")
    assert "'gamma' is not a function but a variable" in caught.value.render()
    assert "gamma*(...)" in caught.value.render()
    assert run("a = gamma(5)\n")[0].variables["a"] == 24


def test_constants():
    """phi^2 = phi + 1; Euler's constant is the limit of sum 1/k - log(n), 1/(2n) off at n."""
    assert CONSTANTS["PHI"] ** 2 == pytest.approx(CONSTANTS["PHI"] + 1, rel=1e-15)
    n = 10**5
    harmonic = math.fsum(1 / k for k in range(1, n + 1)) - math.log(n) - 1 / (2 * n)
    assert CONSTANTS["EGAMMA"] == pytest.approx(harmonic, abs=1e-11)
    assert run("PHI = 30\na = 2*PHI\n")[0].variables["a"] == 60
    assert run("a = PHI + EGAMMA\n")[1] == []


def test_inverse_of_the_normal_distribution():
    """Known quantiles, the same for a number and for a formula; nothing in the far tails."""
    interpreter, _ = run("a = inv_norm(0.975)\nb = inv_norm(0.975 + 0*x)\nc = inv_norm(x)\n")
    assert interpreter.variables["a"] == pytest.approx(1.959963984540054, rel=1e-14)
    values, x = (
        interpreter.hub.values,
        [[1e-9], [0.02], [0.3], [0.5], [0.9], [0], [1], [2], [1e-11]],
    )
    b, c = (interpreter.variables[name].evaluate_points(values, x) for name in "bc")
    assert b == pytest.approx([interpreter.variables["a"]] * 9, rel=1e-14)
    expected = [NormalDist().inv_cdf(p) for p in (1e-9, 0.02, 0.3, 0.5, 0.9)]
    assert c == pytest.approx([*expected, *[math.nan] * 4], rel=1e-13, abs=1e-15, nan_ok=True)
    with pytest.raises(ScriptError, match="inv_norm"):
        run("a = inv_norm(1)\n")


def test_the_number_of_a_point_is_refused_with_a_way_out():
    with pytest.raises(ScriptError) as caught:
        run("v = inv_norm(mod(i*PHI, 1))\n")
    assert "'i' is the number of a point" in caught.value.render()
    assert run("i = 3\nj = i + 1\n")[0].variables["j"] == 4
