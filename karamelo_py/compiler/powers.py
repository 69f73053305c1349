"""Logarithm, exponential and power with equal bits for numbers and lanes.

The functions are evaluated as series after range reduction (Muller 2016, "Elementary Functions",
chapter 11). Relative errors are about twice the round-off; for powers, multiply by |y ln x| if this
is above 1. Interpreted code uses Python's functions.
"""

import math
from math import factorial, inf, nan
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.llvm import I32, Lanes
from karamelo_py.compiler.trace.primitives import all_lanes, fma, implements, real, where
from karamelo_py.compiler.trace.values import OF_REALS, intrinsic


def logarithm(x: float) -> float:
    """Return the natural logarithm, NaN for negative numbers."""
    return math.log(x) if x > 0 else (-inf if x == 0 else nan)


def logarithm_near_one(x: float) -> float:
    """Return the logarithm, in half the time if all numbers are within 1/16 of 1."""
    return logarithm(x)


def exponential(x: float) -> float:
    return math.exp(x)


def power(x: float, y: float) -> float:
    """Return x^y for x >= 0; the result is infinite for 0 to a negative power."""
    return x**y if x != 0 or y >= 0 else inf


OF_REALS |= {power}


class _Bits(NamedTuple):
    """Layout of the bits of a number, or of each lane."""

    number: ir.Type
    whole: ir.Type  # integers of the same size
    short: ir.Type  # 32-bit integers, which every processor converts to reals
    mantissa: int
    bias: int


def _bits(kind: Any) -> _Bits:
    scalar = llvm.scalar_of(kind)
    whole, short = ir.IntType(scalar.bitwidth), I32
    if isinstance(kind, Lanes):
        whole, short = (ir.VectorType(one, kind.width) for one in (whole, short))
    parts = (52, 1023) if scalar.bitwidth == 64 else (23, 127)
    return _Bits(llvm.register_type(kind), whole, short, *parts)


def _constant(whole: ir.Type, value: int) -> ir.Constant:
    return ir.Constant(whole, [value] * whole.count if isinstance(whole, ir.VectorType) else value)


@intrinsic
def _taken_apart(x):
    """Split x = m 2^e, with m between sqrt(1/2) and sqrt(2), and e as a real number."""
    made = types.UniTuple(x, 2)
    number, whole, short, mantissa, _ = _bits(x)
    root = 0x3FE6A09E667F3BCD if mantissa == 52 else 0x3F3504F3  # bits of sqrt(1/2)

    def codegen(builder, value):
        bits = builder.bitcast(value, whole)
        shift = _constant(whole, mantissa)
        e = builder.ashr(builder.sub(bits, _constant(whole, root)), shift)
        m = builder.bitcast(builder.sub(bits, builder.shl(e, shift)), number)
        if mantissa == 52:
            e = builder.trunc(e, short)
        return llvm.make_tuple(builder, made, [m, builder.sitofp(e, number)])

    return made(x), codegen


@intrinsic
def _scaled(x, n):
    """Return x 2^n for an integer n in the type of x, |n| <= 2000."""
    number, whole, short, mantissa, bias = _bits(x)

    def codegen(builder, value, n):
        n = builder.fptosi(n, short)
        half = builder.ashr(n, _constant(short, 1))
        for exponent in (half, builder.sub(n, half)):
            # In two steps, as results may be infinite or denormal.
            e = builder.add(exponent, _constant(short, bias))
            if mantissa == 52:
                e = builder.sext(e, whole)
            factor = builder.bitcast(builder.shl(e, _constant(whole, mantissa)), number)
            value = builder.fmul(value, factor)
        return value

    return x(x, x), codegen


def _series(x, square, coefficients):
    """Evaluate a polynomial of `x` with known `square`, in two chains."""
    chains = []
    for chain in (coefficients[::2], coefficients[1::2]):
        total = real(chain[-1], x)
        for c in chain[-2::-1]:
            total = fma(total, square, real(c, x))
        chains.append(total)
    return fma(chains[1], x, chains[0])


_LN_2, _REST = math.log(2), 2.3190468138462996e-17  # remainder of ln 2
_ARTANH = tuple(2 / (2 * k + 3) for k in range(10))
_EXPONENTIAL = tuple(1 / factorial(k) for k in range(14))
_NEAR_ONE = tuple((-1) ** k / (k + 3) for k in range(11))


@implements(logarithm)
def _logarithm(x):
    """Compute ln m = 2 artanh s, with s = (m - 1) / (m + 1) up to 0.172."""
    m, e = _taken_apart(x)
    s = (m - 1) / (m + 1)
    t = s * s
    total = _series(t, t * t, _ARTANH)
    ln = fma(e, _LN_2, fma(s * t, total, fma(e, _REST, s + s)))
    return where(x > 0, ln + (x - x), where(x == 0, -inf, real(nan, x)))


@implements(logarithm_near_one)
def _logarithm_near_one(x):
    """Compute ln (1 + r) = r + r^2 (-1/2 + r / 3 - ...), without division or long chains."""
    r = x - 1
    near = abs(r) <= 1 / 16
    square = r * r
    ln = fma(square, fma(r, _series(r, square, _NEAR_ONE), -0.5), r)
    if all_lanes(near):
        return ln
    return where(near, ln, logarithm(x))


@implements(exponential, by_type=True)
def _exponential(x):
    # Adding a number whose spacing is 1 rounds; not all processors can round directly.
    most, far = (1000, 1.5 * 2**52) if _bits(x).mantissa == 52 else (130, 1.5 * 2**23)

    def exponential(x):
        """Compute e^x = 2^n e^r with |r| up to ln 2 / 2; beyond `most`, e^x is 0 or infinite."""
        x = min(max(x, -most), most)
        n = (x * (1 / _LN_2) + far) - far  # rounds to the nearest integer
        r = fma(-n, _REST, fma(-n, _LN_2, x))
        return _scaled(_series(r, r * r, _EXPONENTIAL), n)

    return exponential


def _of_zero(x, y):
    return where(y == 0, real(1, x), where(y < 0, real(inf, x), real(0, x)))


@implements(power)
def _power(x, y):
    return where(x == 0, _of_zero(x, y), exponential(y * logarithm(x)))
