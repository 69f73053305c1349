"""Functions with branches and loops are written down, and do what Python does with them."""

from typing import NamedTuple

import numpy as np
import pytest
from listening import listening
from numba import config

from karamelo_py.compiler import CannotCompile, hold, kernel, noinline, shared

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


class Pair(NamedTuple):
    first: float
    second: float


class Arrays(NamedTuple):
    x: np.ndarray
    out: np.ndarray


def returns_early(n, x):
    if n < 0:
        return -1.0
    if n == 0:
        x = x + 1
    elif n == 1 and x > 0:
        return 2 * x
    else:
        x = x if n % 2 else -x
    return x


def counts(n, x):
    total = 0
    for k in range(n):
        if k == 3:
            continue
        if k > 7:
            break
        total += k
    for k in range(n, 0, -2):
        total += 100 * k
    return total


def waits(n, x):
    steps = 0
    while n != 1 and steps < 100:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        steps += 1
    while True:
        steps += 1
        if steps % 5 == 0:
            return steps


def nested(n, x):
    found = 0.0
    for i in range(n):
        while found < 9:
            for j in range(i):
                found += j * i
            found += 4
        for j in range(i):
            if (i * j) % 7 == 5:
                found += x
                break
        else_x = x * i
        found -= else_x
    return found


def carries(n, x):
    pair, last = Pair(0.0, x), (0, 1)
    for _ in range(n):
        if pair.first < 10:
            pair = Pair(pair.first + pair.second, pair.second * 0.5)
        last = last[1], last[0] + last[1]
    return pair.first + 1000 * last[1]


def chains(n, x):
    a = 0 < n <= 3
    b = n > 5 or (x > 0 and n != 2)
    c = not (a and b)
    return 4 * a + 2 * b + c


def guarded(n, x):
    values = (x, 2 * x, 3 * x)
    return values[n] if n >= 0 and n < 3 else -1.0


def unrolled(n, x):
    total = 0.0
    for k, weight in enumerate((1.0, 2.0, 3.0)):
        if k == n:
            continue
        if weight * x > 5:
            break
        total += weight
    return total


def long(n, x):
    """Two loops over known ranges: of the second one, an item of a tuple is asked for."""
    total = 0
    for k in range(30):
        total += k * n
    different = (1, 2.0, 3, 4.0, 5, 6.0, 7, 8.0, 9, 10.0)
    for k in range(10):
        total += different[k]
    return total


def halves(n, x):
    """Comprehensions and functions within, of what is known on one of two ways only."""
    z = [k * x for k in (1, 2) if k > 1]
    f = lambda a, b: a - b  # noqa: E731
    if n > 2:
        y = n * x
        return f(*z, y)
    return z[0]


def leaves_loops(n, x):
    """Loops with an end of their own, a range in steps that only a run knows."""
    total = 0
    for k in range(0, 20, n):
        if k == 12:
            break
        total += k
    else:
        total += 1000
    for k in range(20, 0, -n):
        total += k
    for weight in (1, 2, 3):
        if weight == n:
            break
    else:
        total += 5000
    steps: int = 0
    while steps < n:
        steps += 2
    else:
        total -= steps
    return total


def asks_for_one(n, x):
    """Numbers among others, a name within an expression, a function within a function."""

    def raised(number, by=2):
        return number + by if number > by else -by

    if n in (1, 3, 5):
        return raised(n)
    if n not in {2, 4} and (n > 7 or (half := n / 2) > 3):
        return n
    if (half := n / 3) > 3:
        return half
    return {1: x, 2: -x}[2] * raised(x, by=1)


scale = 3.0


def comprehends(n, x):
    """Comprehensions that ask, as parts of a function of any Python; one hides a global's name."""
    sizes = {k: a if a > 0 else -a for k, a in enumerate((x, x - n))}
    turns = [scale * k if k > n else x for scale in (1, 2) for k in range(9)]
    return scale * sizes[0] + sizes[1] + sum(turns)


FUNCTIONS = [
    returns_early, counts, waits, nested, carries, chains, guarded, unrolled, long, halves,
    leaves_loops, asks_for_one, comprehends,
]  # fmt: skip


def in_a_kernel(function):
    """A kernel that calls a function, which nothing else compiles."""

    def caller(n, x):
        return function(n, x)

    made = kernel(caller)

    def call(n, x):
        with listening() as names:
            result = made(n, x)
        assert function.__name__ not in names
        return result

    return call


@pytest.mark.parametrize("mark", [shared, noinline])
@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_as_python_does(function, mark):
    expected = [function(n, x) for n in range(1, 12) for x in (1.75, -3.0)]
    made = in_a_kernel(mark(lambda_of(function)))
    assert [made(n, x) for n in range(1, 12) for x in (1.75, -3.0)] == expected


def lambda_of(function):
    """The same function once more: each is marked in one way."""
    made = type(function)(function.__code__, function.__globals__, function.__name__)
    return made


@noinline
def put(arrays, n):
    """Twice the numbers that are larger than n; how many."""
    found = 0
    for value in arrays.x:
        if value > n:
            arrays.out[found] += 2 * value
            found += 1
    arrays.out[found:] = -1.0
    return found


def test_arrays_also_held():
    def caller(arrays, n):
        return put(arrays, n) + 10 * put(hold(arrays), n)

    arrays = Arrays(np.array([1.0, 5.0, 2.0, 7.0]), np.zeros(4))
    assert kernel(caller)(arrays, 1.5) == 33
    assert arrays.out.tolist() == [20, 8, 28, -1]


RECORD = np.dtype([("count", np.int64), ("sum", np.float64)])


@shared
def add(records, k, x):
    """Count x in a record."""
    one = records[k]
    if x > 0:
        one.count += 1
    one.sum = one.sum + x


@shared
def checked(n):
    """A number that must lie below another."""
    assert n < 5, "five or more"
    if n == 3:
        raise ValueError("three", 3)
    return n


def test_what_is_raised():
    def caller(n):
        return checked(n)

    made = kernel(caller)
    assert made(2) == 2
    with pytest.raises(ValueError, match="three"):
        made(3)
    with pytest.raises(AssertionError, match="five or more"):
        made(7)


def test_ctrl_c_behind_what_was_raised():
    """The kernels that are called next know nothing of it."""

    def caller(n):
        return checked(n)

    made = kernel(caller)
    made(2)
    ((kinds, (plan, entry, *rest)),) = made._plans.items()

    def interrupted(*given):
        entry(*given)
        raise KeyboardInterrupt

    made._plans[kinds] = plan, interrupted, *rest
    with pytest.raises((ValueError, KeyboardInterrupt)):
        made(3)
    made._plans[kinds] = plan, entry, *rest
    assert made(2) == 2


def test_attributes_of_records():
    def caller(records, x):
        for k in range(records.size):
            add(records, k, x - k)

    records = np.zeros(3, RECORD)
    kernel(caller)(records, 1.5)
    assert records["count"].tolist() == [1, 1, 0]
    assert records["sum"].tolist() == [1.5, 0.5, -0.5]


@shared
def listed(x):
    """A list that changes on one of two ways."""
    out = [x]
    if x > 0:
        out.append(2 * x)
    return sum(out)


def test_a_list_does_not_change_on_both_ways():
    def caller(x):
        return listed(x)

    with pytest.raises(CannotCompile, match="a list cannot be changed on one"):
        kernel(caller)(1.0)


def test_a_file_that_has_changed_is_not_read(tmp_path, monkeypatch):
    """What runs is what Python has read: another text beside it is not walked through."""
    source = "def change(x):\n    if x > 0:\n        return {}\n    return x\n"
    path = tmp_path / "module.py"
    names: dict = {}
    path.write_text(source.format("2 * x"))
    exec(compile(path.read_text(), str(path), "exec"), names)
    path.write_text(source.format("3 * x"))
    change = shared(names["change"])

    def caller(x):
        return change(x)

    with pytest.raises(CannotCompile, match="its file has changed since Python read it"):
        kernel(caller)(1.0)


def last_of(x, n):
    """A number that a loop gives, of the type of x: a literal before."""
    last = 0.0
    for _ in range(n):
        last = x
    return last


def sum_of(items, x):
    """A loop that must be written out: the items have several types."""
    total = x
    for k in range(9):
        total = total + items[k]
    return total


@shared
def negated(x):
    return -x if x > 0 else x


@shared
def opposite(x):
    return x if x <= 0 else -x


@pytest.mark.parametrize(
    ("loop", "branches", "found"),
    [
        (lambda x, n: last_of(x, n), negated, 0.0),
        (lambda x, n: sum_of(((x,) * 9 + ((),)), x), opposite, 4.5),
    ],
)
def test_what_is_known_of_loops_is_found_again(loop, branches, found):
    """A function that is seen to branch has all that were walked through forgotten."""

    def caller(x, n):
        return loop(x, n) + branches(x)

    assert kernel(caller)(np.float32(0.5), 3) == found


def last_given(f, n):
    last = 0.0
    for _ in range(n):
        last = f()
    return last


def by_lambda(x, n):
    if n > 100:
        return x
    return last_given(lambda: x, n)


def by_functions(x, n):
    """One calls the other, which calls itself."""
    if n > 100:
        return x

    def known(k=2):
        return x if k == 0 else known(k - 1)

    def given():
        return known()

    return last_given(given, n)


def by_default(x, n):
    if n > 100:
        return x

    def known(y=x):
        return y

    return last_given(known, n)


KINDS = np.float32, np.float64


@pytest.mark.parametrize("last", [by_lambda, by_functions, by_default])
@pytest.mark.parametrize("kinds", [KINDS, KINDS[::-1]])
def test_loops_keep_the_types_of_what_functions_close_over(last, kinds):
    def caller(a, b, n):
        return last(a, n), last(b, n)

    numbers = [kind(0.1) for kind in kinds]
    assert kernel(caller)(*numbers, 3) == tuple(numbers)


def last_pair(pair, n):
    last = (0.0, 0.0)
    for _ in range(n):
        last = (pair.first, pair.second)
    return last


def test_loops_over_tuples_keep_their_precision():
    """Of single numbers, what a loop begins with is single; doubles beside them change nothing."""

    def alone(single, n):
        a, b = last_pair(single, n)
        return a * b + a * a

    def beside(single, double, n):
        found = alone(single, n)
        return found + 0 * len(last_pair(double, n))

    pairs = Pair(np.float32(1 / 3), np.float32(0.7)), Pair(1 / 3, 0.7)
    assert kernel(beside)(*pairs, 2) == kernel(alone)(pairs[0], 2)
