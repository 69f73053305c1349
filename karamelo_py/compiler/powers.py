"""Logarithms, exponentials and powers for numbers and for lanes: the same operations, so same bits.

The functions of the C library are called for one number after another. These are series after a
reduction to a small range (Muller 2016, "Elementary Functions", chapter 11). Their relative error
is about that of two operations; of powers, |y ln x| times as much where that is above 1.
Interpreted, they are Python's.
"""

import math
from math import factorial, inf, nan
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from karamelo_py.compiler.compile import by_type, choose, define, fma, in_all, real, shared
from karamelo_py.compiler.lanes.registers import Lanes, element, vector_of
from karamelo_py.compiler.values import OF_REALS


def logarithm(x: float) -> float:
    """The natural logarithm of a number above 0; no number below."""
    return math.log(x) if x > 0 else (-inf if x == 0 else nan)


def logarithm_near_one(x: float) -> float:
    """The same, in half the time where all numbers lie within 1/16 of 1."""
    return logarithm(x)


def exponential(x: float) -> float:
    """e to the power of x."""
    return math.exp(x)


def power(x: float, y: float) -> float:
    """x to the power of y, for x not below 0; infinite for 0 to a negative one."""
    return x**y if x != 0 or y >= 0 else inf


OF_REALS |= {power}


def _bits(kind: Any) -> tuple[Any, Any, int, int]:
    """Types of the bits of a number, or of numbers in lanes; bits of the mantissa; the bias."""
    scalar = kind.scalar if isinstance(kind, Lanes) else kind
    whole = ir.IntType(scalar.bitwidth)
    if isinstance(kind, Lanes):
        whole = ir.VectorType(whole, kind.width)
    return (
        (vector_of(kind) if isinstance(kind, Lanes) else element(kind)),
        whole,
        *((52, 1023) if scalar.bitwidth == 64 else (23, 127)),
    )


def _short(whole: ir.Type) -> ir.Type:
    """Whole numbers of 32 bits, from which every processor makes real ones."""
    short = ir.IntType(32)
    return ir.VectorType(short, whole.count) if isinstance(whole, ir.VectorType) else short


def _constant(whole: ir.Type, value: int) -> ir.Constant:
    return ir.Constant(whole, [value] * whole.count if isinstance(whole, ir.VectorType) else value)


@intrinsic
def _taken_apart(typing_context, x):
    """m between the roots of 1/2 and of 2, and e as a real number, with x = m 2^e."""
    made = types.UniTuple(x, 2)

    def codegen(context, builder, sig, arguments):
        number, whole, mantissa, _bias = _bits(x)
        root = 0x3FE6A09E667F3BCD if mantissa == 52 else 0x3F3504F3  # of 1/2
        bits = builder.bitcast(arguments[0], whole)
        shift = _constant(whole, mantissa)
        e = builder.ashr(builder.sub(bits, _constant(whole, root)), shift)
        m = builder.bitcast(builder.sub(bits, builder.shl(e, shift)), number)
        if mantissa == 52:
            e = builder.trunc(e, _short(whole))
        return context.make_tuple(builder, made, [m, builder.sitofp(e, number)])

    return made(x), codegen


@intrinsic
def _scaled(typing_context, x, n):
    """x 2^n, n a whole number in the type of x, up to 2000 in size."""

    def codegen(context, builder, sig, arguments):
        number, whole, mantissa, bias = _bits(x)
        narrow = _short(whole)
        n = builder.fptosi(arguments[1], narrow)
        half = builder.ashr(n, _constant(narrow, 1))
        value = arguments[0]
        for part in (half, builder.sub(n, half)):
            # Twice half of the way: results go on to infinity and to the smallest numbers.
            e = builder.add(part, _constant(narrow, bias))
            if mantissa == 52:
                e = builder.sext(e, whole)
            factor = builder.bitcast(builder.shl(e, _constant(whole, mantissa)), number)
            value = builder.fmul(value, factor)
        return value

    return x(x, x), codegen


def _series(x: str, coefficients: list[float]) -> list[str]:
    """Lines that sum up a polynomial of `x`, and of `xx`, its square, in two chains."""
    lines = []
    for name, chain in (("even", coefficients[::2]), ("odd", coefficients[1::2])):
        lines.append(f"{name} = real({chain[-1]!r}, {x})")
        lines += [f"{name} = fma({name}, {x}{x}, real({c!r}, {x}))" for c in chain[-2::-1]]
    return [*lines, f"total = fma(odd, {x}, even)"]


_NAMES = {"real": real, "fma": fma, "choose": choose, "inf": inf, "nan": nan}
_LN_2, _REST = math.log(2), 2.3190468138462996e-17  # what the first leaves of ln 2

# ln m = 2 artanh s with s = (m - 1) / (m + 1), up to 0.172
_logarithm = define(
    "x",
    "m, e = taken_apart(x)",
    "s = (m - real(1, m)) / (m + real(1, m))",
    "t = s * s",
    "tt = t * t",
    *_series("t", [2 / (2 * k + 3) for k in range(10)]),
    f"ln = fma(e, real({_LN_2!r}, x), fma(s * t, total, fma(e, real({_REST!r}, x), s + s)))",
    "return choose(x > 0, ln + (x - x), choose(x == 0, real(-inf, x), real(nan, x)))",
    taken_apart=_taken_apart,
    **_NAMES,
)
# e^x = 2^n e^r with |r| up to ln 2 / 2; beyond these limits it is 0 or infinite
_exponential = define(
    "x, most, far",
    "most, far = real(most, x), real(far, x)",
    "x = min(max(x, -most), most)",
    f"n = (x * real({1 / _LN_2!r}, x) + far) - far",  # the whole number next to it
    f"r = fma(-n, real({_REST!r}, x), fma(-n, real({_LN_2!r}, x), x))",
    "rr = r * r",
    *_series("r", [1 / factorial(k) for k in range(14)]),
    "return scaled(total, n)",
    scaled=_scaled,
    **_NAMES,
)


# ln (1 + r) = r + r^2 (-1/2 + r / 3 - ...): no division, and no step that waits for one.
_near_one = define(
    "x",
    "r = x - real(1, x)",
    "near = abs(r) <= real(1 / 16, x)",
    "rr = r * r",
    *_series("r", [(-1) ** k / (k + 3) for k in range(11)]),
    "ln = fma(rr, fma(r, total, real(-0.5, x)), r)",
    "if in_all(near): return ln",
    "return choose(near, ln, logarithm(x))",
    logarithm=logarithm,
    in_all=in_all,
    **_NAMES,
)


@by_type(logarithm)
def _choose_logarithm(x):
    return _logarithm


@by_type(logarithm_near_one)
def _choose_near_one(x):
    return _near_one


@by_type(exponential)
def _choose_exponential(x):
    # So far from 0 that the next number is 1 away; all targets know how to add, but not to round.
    most, far = (1000, 1.5 * 2**52) if _bits(x)[3] == 1023 else (130, 1.5 * 2**23)
    return lambda x: _exponential(x, most, far)


shared(_exponential)


@shared
def _of_zero(x, y):
    return choose(y == 0, real(1, x), choose(y < 0, real(inf, x), real(0, x)))


@by_type(power)
def _choose_power(x, y):
    return lambda x, y: choose(x == 0, _of_zero(x, y), exponential(y * logarithm(x)))
