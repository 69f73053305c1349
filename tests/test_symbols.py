"""Formulas on symbols: the flat function that is written does the formula's operations."""

import numpy as np
import pytest
from numba import njit

from karamelo_py.compiler.compile import where
from karamelo_py.compiler.symbols import Symbol, add_product, call, cofactor, determinant, written

a, b, c = Symbol("a"), Symbol("b"), Symbol("c")
COUNTED = []


def counted(x):
    COUNTED.append(x)
    return x


def test_operations_keep_the_order_of_the_formula():
    """0.1 + 0.2 + 0.3 and 0.1 + (0.2 + 0.3) differ in the last bit, as do other rearrangements."""
    numbers = (0.1, 0.2, 0.3)
    for formula in (
        lambda a, b, c: (a + b) + c,
        lambda a, b, c: a + (b + c),
        lambda a, b, c: a - (b - c) / c,
        lambda a, b, c: -a * (b * c),
        lambda a, b, c: abs(a - b) * 3 / c - 1,
        lambda a, b, c: 1 - a - 2 / (b - c),
    ):
        function = written("a, b, c", formula(a, b, c), "a")
        assert function(*numbers) == formula(*numbers)


def test_what_does_not_exist_drops_out():
    assert 0 * a == a * 0 == 0
    assert (a + 0) is a
    assert (0 + a) is a
    assert (a - 0) is a
    assert (a * 1) is a
    assert (1 * a) is a
    assert add_product(0, a, b) is add_product(a, 0, b) is b
    assert written("a", 0 - a)(2.0) == -2.0
    assert sum([0 * a, a * b, 0]).text == "(a * b)"


def test_what_occurs_twice_is_computed_once():
    item = call(counted, a)
    function = written("a, b", (item + b, item * item, (item, b)))
    assert function(2.0, 3.0) == (5.0, 4.0, (2.0, 3.0))
    assert COUNTED == [2.0]


def test_items_fields_and_choices():
    parts = written("a, b", call(where, a[1] > 0, a[0], b.real), "b")
    assert parts((1.0, 2.0), 3.0) == 1.0
    assert parts((1.0, -2.0), 3.0) == 3.0


@pytest.mark.parametrize("d", [1, 2, 3])
def test_determinants_and_cofactors(d):
    """Cofactors over the determinant are the transposed inverse (Cramer), to round-off."""
    numbers = np.random.default_rng(d).uniform(-1, 1, (d, d))
    m = {(i, j): a[i][j] for i in range(d) for j in range(d)}
    rows = tuple(tuple(row) for row in numbers.tolist())
    assert written("a", determinant(m, d))(rows) == pytest.approx(np.linalg.det(numbers), rel=1e-13)
    k = 1 / determinant(m, d)
    inverse = [[k * cofactor(m, d, j, i) for j in range(d)] for i in range(d)]
    found = written("a", inverse, "a[0][0]")(rows)
    assert np.array(found) @ numbers == pytest.approx(np.eye(d), abs=1e-13)


def test_literals_have_the_type_of_the_numbers():
    function = njit(written("a", (0.5 * a[0], 1 / a[1], 0), "a[0]"))
    function((np.float32(3), np.float32(7)))
    if hasattr(function, "nopython_signatures"):
        assert "float64" not in str(function.nopython_signatures[0].return_type)
