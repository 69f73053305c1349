"""Sums independent of the order of their terms: reactions, work, energies.

A total is a superaccumulator: a fixed-point number that covers the range of doubles, in limbs of 32
bits with room for carries. Terms are added without rounding; a published total is correct within a
unit in the last place (Kulisch 1971; Neal 2015, "Fast exact summation using small and large
superaccumulators").
"""

from math import frexp, ldexp
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline, point_function
from karamelo_py.compiler.threads import add_among, many_threads

LIMBS = 68
LOST = LIMBS - 1  # limb that counts NaN and infinite terms
DIGIT = (1 << 32) - 1
MANTISSA = (1 << 52) - 1
MANY = 1 << 10  # terms whose integers sum without overflow
COARSE, FINE = 1e-200, 1e200  # range of the largest term that allows integer sums
MAGNITUDE = 0x7FFFFFFFFFFFFFFF  # all bits but the sign; ordered like the numbers
WHOLE = 1.5 * 2.0**52
WHOLE_BITS = int(np.float64(WHOLE).view(np.int64))
# Rows of totals, in slots whose published values (time, timestep, dt, none) are not sums.
KINETIC, STORED, WORK, CONTACT_LOSS, TRANSFER_LOSS = 0, 1, 2, 3, 4
SINCE_START = slice(WORK, CONTACT_LOSS + 1)


class Alone(NamedTuple):
    pass


def _grow(totals, row, limb, number):
    if many_threads():
        add_among(totals, row, limb, number)
    else:
        totals[row, limb] += number


@noinline
def add_to(totals, row, x):
    if x == 0.0:
        return
    bits = np.float64(x).view(np.int64)
    exponent = (bits >> 52) & 0x7FF
    if exponent == 0x7FF:
        _grow(totals, row, LOST, 1)
        return
    mantissa = bits & MANTISSA
    if exponent > 0:
        mantissa |= 1 << 52
        exponent -= 1
    limb = exponent >> 5
    shift = exponent & 31
    low = (mantissa & DIGIT) << shift
    high = (mantissa >> 32) << shift
    sign = 1 if bits >= 0 else -1
    _grow(totals, row, limb, sign * (low & DIGIT))
    _grow(totals, row, limb + 1, sign * ((low >> 32) + (high & DIGIT)))
    _grow(totals, row, limb + 2, sign * (high >> 32))


@noinline
def add_many(totals, row, terms, count):
    """Add the first `count` of `terms`, at most `MANY`, without rounding.

    Terms are summed as integers of two sizes, except terms 2^30 times smaller than the largest. The
    last bits of a number plus 1.5 2^52 are its integer part, so the loop vectorises.
    """
    if many_threads():  # each thread has one or two terms
        for q in range(count):
            add_to(totals, row, terms[q])
        return
    top = 0
    for q in range(count):
        top = max(top, np.float64(terms[q]).view(np.int64) & MAGNITUDE)
    largest = np.int64(top).view(np.float64)
    if largest == 0.0:
        return
    if not COARSE < largest < FINE:
        for q in range(count):
            add_to(totals, row, terms[q])
        return
    unit = ldexp(1.0, frexp(largest)[1] - 30)
    per_unit, fraction = 1.0 / unit, unit / 2.0**52
    least = np.float64(unit).view(np.int64)
    high = low = small = 0
    for q in range(count):
        x = terms[q]
        fits = np.float64(x).view(np.int64) & MAGNITUDE >= least
        x = x * per_unit if fits else 0.0
        small += 0 if fits else 1
        whole = x + WHOLE
        high += np.float64(whole).view(np.int64) - WHOLE_BITS
        rest = (x - (whole - WHOLE)) * 2.0**52 + WHOLE
        low += np.float64(rest).view(np.int64) - WHOLE_BITS
    if small > 0:
        for q in range(count):
            if abs(terms[q]) < unit:
                add_to(totals, row, terms[q])
    add_to(totals, row, high * unit)
    above = low >> 32
    add_to(totals, row, above * (2.0**32 * fraction))
    add_to(totals, row, (low - (above << 32)) * fraction)


@noinline
def hand_over(private, totals, row):
    for k in range(LIMBS):
        if private[row, k] != 0:
            add_among(totals, row, k, private[row, k])
            private[row, k] = 0


@kernel
def carry(total):
    """Carry between limbs, which are then in [0, 2^32 - 1]; the last one is signed."""
    for k in range(LOST - 1):
        carry = total[k] >> 32
        total[k] -= carry << 32
        total[k + 1] += carry


@kernel
def rounded(total):
    """Return the value of a total (LIMBS,), whose digits are carried."""
    if total[LOST] > 0:
        return np.nan
    carry(total)
    sign = 1.0
    if total[LOST - 1] < 0:
        # Digits of the same sign are summed without cancellation.
        sign = -1.0
        for k in range(LOST):
            total[k] = -total[k]
        carry(total)
    value = 0.0
    for k in range(LOST):
        if total[k] != 0:
            value += ldexp(float(total[k]), 32 * k - 1074)
    return sign * value


@kernel
def _round(totals, digits, answer, first, count):
    for k in range(count):
        for limb in range(LIMBS):
            digits[limb] = totals[first + k, limb]
        answer[k] = rounded(digits)


@kernel
def _round_all(totals, values):
    for k in range(values.size):
        values[k] = rounded(totals[k])


def values_of(totals: np.ndarray) -> np.ndarray:
    """Round totals (k, LIMBS). Quantiles have thousands of totals, most of which are 0."""
    values, some = np.zeros(len(totals)), totals.any(axis=1)
    others = values[some]
    _round_all(totals[some], others)
    values[some] = others
    return values


@kernel
def add_all(totals, terms):
    """Add terms (k, n) to totals (k, LIMBS)."""
    for k in range(terms.shape[0]):
        for first in range(0, terms.shape[1], MANY):
            add_many(totals, k, terms[k][first:], min(MANY, terms.shape[1] - first))


@kernel
def add_rows(totals, rows, terms):
    for q in range(terms.size):
        add_to(totals, rows[q], terms[q])


def add_torque(totals, row, x, c, force):
    add_to(totals, row + (c + 1) % 3, x[(c + 2) % 3] * force)
    add_to(totals, row + (c + 2) % 3, -x[(c + 1) % 3] * force)


@point_function(otherwise=True)
def collect(ranks, control, first, count):
    """Put the values of `count` totals from row `first` on into `control.answer`."""
    _round(control.totals, control.digits, control.answer, first, count)


@point_function(otherwise=True)
def counts(ranks, n):
    """Return True if this process adds the terms of node `n`."""
    return True


@point_function(otherwise=True)
def number_of_all(ranks, control, number):
    return number


@point_function(otherwise=True)
def agree_on_reports(ranks, control):
    pass


@point_function(otherwise=True)
def agree_on_heat(ranks, control):
    pass


@point_function(otherwise=True)
def take_over(ranks, due):
    """Wait for the contributions of other processes to nodes that this process uses."""


def publish(control, slot, count):
    collect(control.ranks, control, slot, count)
    for k in range(count):
        control.values[slot + k] = control.answer[k]
