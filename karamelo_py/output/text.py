"""Tables of numbers as text, with the bytes of ``"%.9g" % x`` and ``"%d" % n``.

The nine digits of x are the digits of x 10^k, computed in twice the precision of a double. Within
`DOUBT` of a tie the last digit is undecided, unless 10^k is exact (0 <= k <= 22). Python formats
numbers whose last digit is undecided and very large or small numbers; without compilation or on
big-endian machines, it formats all. Surplus digits are written and then overwritten, which is
faster than branching.
"""

import sys
from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
from llvmlite import ir
from numba import config, types

from karamelo_py.compiler import fma, index, intrinsic, kernel, llvm

ROWS = 1024
# Enough for -1.23456789e-308 or -4611686018427387903, a blank, and surplus digits.
NUMBER_BYTES = 32

DIGITS = 9
DOUBT = 1e-12
EXACT = 22  # largest power of ten that is exact in double precision
SMALLEST, LARGEST = 1e-280, 1e280
LARGEST_INTEGER = 2**62
FIRST = -280  # exponent of the first power in POWERS


def _power(k: int) -> tuple[float, float]:
    exact = Fraction(10) ** k
    high = float(exact)
    return high, float(exact - Fraction(high))


POWERS = np.array([_power(k) for k in range(FIRST, 300)])
MINUS, PLUS, POINT, ZERO, BLANK, NEWLINE, E = b"-+.0 \ne"
ZEROS = int.from_bytes(b"00000000", "little")
NAN, INF, NOUGHT = (int.from_bytes(w, "little") for w in (b"nan", b"inf", b"0.000000"))
BYTEWISE = config.DISABLE_JIT or sys.byteorder != "little"  # type: ignore[attr-defined]


def rows(columns: Sequence[np.ndarray]) -> Iterator[bytes]:
    """Yield rows as text, block by block: integers, and numbers with nine significant digits."""
    is_integer = np.array([np.issubdtype(column.dtype, np.integer) for column in columns])
    width = len(columns)
    numbers = np.empty((ROWS, width))
    integers = numbers.view(np.int64)
    text = np.empty(numbers.size * NUMBER_BYTES, np.uint8)
    for start in range(0, len(columns[0]), ROWS):
        count = len(columns[0][start : start + ROWS])
        for k, column in enumerate(columns):
            (integers if is_integer[k] else numbers)[:count, k] = column[start : start + count]
        at, done, total = 0, 0, count * width
        while done < total:
            if not BYTEWISE:
                done, at = write_rows((numbers[:count], integers, is_integer), done, text, at)
                if done == total:
                    break
            i, k = divmod(done, width)
            written = b"%d" % integers[i, k] if is_integer[k] else b"%.9g" % numbers[i, k]
            written += b"\n" if k == width - 1 else b" "
            text[at : at + len(written)] = np.frombuffer(written, np.uint8)
            done, at = done + 1, at + len(written)
        yield text[:at].tobytes()


@kernel
def write_rows(table, start, text, at):
    """Write rows up to the first number that Python must format.

    Returns the index of this number (the number of numbers if there is none), and the end of the
    text. `table` consists of the numbers (rows, columns), the same memory viewed as integers, and a
    mask of integer columns. `start` is the index of the first number to write, counted row by row.
    `text` has `NUMBER_BYTES` bytes per number, and is written from index `at` on.
    """
    numbers, integers, is_integer = table
    rows, columns = numbers.shape
    first = start % columns
    for i in range(start // columns, rows):
        for k in range(first, columns):
            if is_integer[k]:
                end = _put_integer(text, at, integers[i, k])
            else:
                end = _put_number(text, at, numbers[i, k], integers[i, k])
            if end == at:
                return i * columns + k, at
            text[index(end)] = BLANK
            at = end + 1
        text[index(at - 1)] = NEWLINE
        first = 0
    return rows * columns, at


def _put_integer(text, at, n):
    if not -LARGEST_INTEGER < n < LARGEST_INTEGER:
        return at
    text[index(at)] = MINUS
    at += n < 0
    n = abs(n)
    length, rest = 1, n // 10
    while rest > 0:
        length, rest = length + 1, rest // 10
    for k in range(at + length - 1, at - 1, -1):
        text[index(k)] = ZERO + n % 10
        n //= 10
    return at + length


def _put_number(text, at, x, bits):
    """Write nine significant digits; return the end of the text, or `at` if they are undecided."""
    begin = at
    text[index(at)] = MINUS
    at += (bits < 0) & (x == x)
    x = abs(x)
    if not SMALLEST < x < LARGEST:
        if SMALLEST >= x > 0 or LARGEST <= x < np.inf:
            return begin
        _put_eight(text, at, ZEROS if x == 0 else INF if x == x else NAN)
        return at + (1 if x == 0 else 3)
    digits, exponent = _decimal(x, (bits >> 52 & 2047) - 1023)
    if digits == 0:
        return begin
    first = (digits * 1441151881) >> 57  # digits // 10^8
    others = _eight(digits - 100_000_000 * first)
    kept = DIGITS
    if others >> 56 == ZERO:
        kept = 1 + _without_zeros(others)
    if -5 < exponent < 0:
        _put_eight(text, at, NOUGHT)
        at += 1 - exponent
        text[index(at)] = ZERO + first
        _put_eight(text, at + 1, others)
        return at + kept
    fixed = 0 <= exponent < DIGITS
    before = exponent + 1 if fixed else 1
    text[index(at)] = ZERO + first
    _put_eight(text, at + 1, others)
    _put_eight(text, at + 1 + before, others >> (8 * (before - 1) & 63))
    text[index(at + before)] = POINT
    at += kept + 1 if kept > before else before
    if fixed:
        return at
    text[index(at)], text[index(at + 1)] = E, MINUS if exponent < 0 else PLUS
    exponent = abs(exponent)
    if exponent >= 100:
        text[index(at + 2)] = ZERO + exponent // 100
        at += 1
    two = exponent % 100
    text[index(at + 2)], text[index(at + 3)] = ZERO + two // 10, ZERO + two % 10
    return at + 4


def _decimal(x, binary):
    """Return nine digits of x > 0 as an integer (0: undecided), and the exponent of the first.

    `binary` is the exponent of two of x.
    """
    exponent = binary * 315653 >> 20  # log10(2) * 2^20
    exponent += x >= POWERS[index(exponent + 1 - FIRST), 0]
    k = DIGITS - 1 - exponent
    high, low = POWERS[index(k - FIRST), 0], POWERS[index(k - FIRST), 1]
    product = x * high
    digits = int(product)
    above_tie = (product - digits - 0.5) + (fma(x, high, -product) + x * low)
    if abs(above_tie) < DOUBT and not 0 <= k <= EXACT:
        return 0, exponent
    digits += (above_tie > 0) | ((above_tie == 0) & (digits & 1))
    if digits == 1_000_000_000:
        return 100_000_000, exponent + 1
    return digits, exponent


def _eight(n):
    """Return the eight digits of n < 10^8 as bytes, by splitting the number three times."""
    four = n * 109951163 >> 40  # n // 10^4
    word = four | (n - 10_000 * four) << 32
    two = (word * 5243 >> 19) & 0x7F0000007F  # // 100
    word = two | (word - 100 * two) << 16
    one = (word * 103 >> 10) & 0xF000F000F000F  # // 10
    return (one | (word - 10 * one) << 8) + ZEROS


def _without_zeros(word):
    kept = 8
    while kept > 0 and word >> 8 * (kept - 1) & 255 == ZERO:
        kept -= 1
    return kept


@intrinsic
def _put_eight(text, at, word):
    def codegen(builder, array, at, number):
        data = llvm.ArrayParts(builder, text, array).data
        pointer = builder.bitcast(builder.gep(data, [at]), ir.IntType(64).as_pointer())
        builder.store(number, pointer, align=1)

    return types.void(text, types.int64, types.int64), codegen
