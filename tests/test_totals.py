"""Totals: sums without rounding, whatever the order of their terms."""

from fractions import Fraction
from math import fsum

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from karamelo_py.compiler import kernel
from karamelo_py.kernels.totals import LIMBS, add_many, add_to, rounded

numbers = some.lists(some.floats(-1e300, 1e300), max_size=30)


@kernel
def add_all(totals, terms):
    for k in range(terms.size):
        add_to(totals, k % len(totals), terms[k])


@kernel
def add_blocks(totals, terms, size):
    for k in range(0, terms.size, size):
        add_many(totals, 0, terms[k:], min(size, terms.size - k))


def total_of(terms, parts=1):
    totals = np.zeros((parts, LIMBS), np.int64)
    add_all(totals, np.array(terms, float))
    return rounded(totals.sum(axis=0))


@given(numbers)
def test_a_total_is_the_exact_sum(terms):
    """Within the rounding of a last digit; the exact sum is that of fractions."""
    exact = sum(map(Fraction, terms), Fraction(0))
    value = total_of(terms)
    assert abs(Fraction(value) - exact) <= Fraction(float(np.spacing(abs(value))))


@given(numbers, some.randoms())
def test_the_order_of_terms_does_not_matter(terms, random):
    """Nor how they are shared out among several totals that are added up."""
    value = total_of(terms)
    random.shuffle(terms)
    assert total_of(terms) == value
    assert total_of(terms, parts=2) == value


def test_what_cancels_leaves_what_is_small():
    """A plain sum of these is 0; fsum is Shewchuk's exact one."""
    terms = [1e300, 1.0, -1e300, 5e-324]
    assert total_of(terms) == fsum(terms) == 1.0
    assert total_of([5e-324, 1e-310]) == 5e-324 + 1e-310


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_term_that_is_no_number_is_seen(wrong):
    assert np.isnan(total_of([1.0, wrong]))
    for terms in ([wrong], [0.0, wrong], [wrong, 1.0]):
        totals = np.zeros((1, LIMBS), np.int64)
        add_blocks(totals, np.array(terms), 2)
        assert np.isnan(rounded(totals[0]))


@given(
    some.lists(some.floats(-1e6, 1e6) | some.floats(-1e-9, 1e-9), max_size=40), some.integers(1, 40)
)
def test_blocks_of_terms_make_the_same_sum(terms, size):
    totals = np.zeros((1, LIMBS), np.int64)
    add_blocks(totals, np.array(terms, float), size)
    assert rounded(totals[0]) == total_of(terms)


@pytest.mark.parametrize("term", [np.nextafter(1, 0), -np.nextafter(1, 0), 1.0, 2.0**-30, 1e-199])
def test_a_full_block_of_equal_terms(term):
    """The largest sums of parts that a block can have, exact by a power of two."""
    totals = np.zeros((1, LIMBS), np.int64)
    add_blocks(totals, np.full(1024, term), 1024)
    assert rounded(totals[0]) == 1024 * term
