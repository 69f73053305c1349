"""Functions in kernels, by type: of points, of numbers, and of numbers in lanes.

A function of numbers is given first, then what it is of lanes (:mod:`karamelo_py.compiler.lanes`).
"""

import math
import operator
from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types

from karamelo_py.compiler import arithmetic, choices, code
from karamelo_py.compiler.arithmetic import common
from karamelo_py.compiler.code import I64, Lanes, lane, scalar_of
from karamelo_py.compiler.trace import (
    INSTEAD,
    Undefined,
    forget,
    outdate_kernels,
    run_for_kernel,
)
from karamelo_py.compiler.values import (
    OF_REALS,
    Untraceable,
    Value,
    at_work,
    in_kernels,
    intrinsic,
    mapped,
    now,
    rebuilt,
)


def implements(function: Callable, *numbers: type, by_type: bool = False) -> Callable:
    """Decorate what `function` is in a kernel: for these types of numbers, or for all others.

    A type of numbers is a NamedTuple with operators (:func:`~.algebra.algebra`), or lanes. It
    is looked for in tuples, too. What is decorated is traced, or code written by hand. If
    `by_type`, it is Python that returns this for the types of the arguments; None leaves them to
    what was known before.
    """

    def register(made: Callable) -> Callable:
        known = choices.choosers.setdefault(function, [])
        of_numbers = any(function in getattr(one, "implements", ()) for one in numbers)
        if of_numbers or (known and not numbers):
            outdate_kernels()
        for one in numbers:
            if "implements" not in vars(one):
                one.implements = {}
            one.implements[function] = made
            choices.of_numbers.setdefault(function, []).append(made)
        if by_type:
            known.insert(0, made)
        elif not numbers:
            known.append(lambda *_: made)
        forget()
        return made

    return register


def shared(function: Callable) -> Callable:
    """Mark a helper that lanes or types of numbers may have in a way of their own: `implements`."""
    return implements(function)(function)


def point_function(*, tags: int = 1, otherwise: bool = False) -> Callable[[Callable], Any]:
    """Declare a pure function of one point, selected by the classes of its first `tags` arguments.

    The decorated function gives name, parameters and docstring. Implementations are added with
    ``name.on(Class, ...)``, serve classes derived from these that have none of their own, and serve
    both as plain Python (``NUMBA_DISABLE_JIT=1``, tests) and inside kernels, where the types are
    known at compile time and no branch is left. A plug-in adds its own in the same way. With
    ``otherwise`` what the decorated function does is for all others.

    Point functions serve one point or several at once (:mod:`karamelo_py.compiler.lanes`). Those
    that a class names in ``scalarised``, since they branch, are called for one point after another.
    """

    def declare(stub: Callable) -> Callable:
        table: dict[tuple[type, ...], Callable] = {}
        fallback = stub if otherwise else None
        nearest: dict[tuple[type, ...], Callable | None] = {}

        def find(classes: tuple) -> Callable | None:
            known = nearest  # another thread of Python may add implementations meanwhile
            if classes not in known:
                ways = product(*(getattr(one, "__mro__", (one,)) for one in classes))
                known[classes] = next((table[way] for way in ways if way in table), fallback)
            return known[classes]

        def plain(*arguments: Any) -> Any:
            first = arguments[0].__class__
            classes = (first,) if tags == 1 else tuple([a.__class__ for a in arguments[:tags]])
            known = nearest
            chosen = known[classes] if classes in known else find(classes)
            if chosen is None:
                raise Undefined(stub.__name__, classes)
            return chosen(*arguments)

        def watched(*arguments: Any) -> Any:
            return run_for_kernel(dispatch, arguments) if at_work() else plain(*arguments)

        dispatch = plain if choices.INTERPRETED else watched
        for name in ("__name__", "__qualname__", "__module__", "__doc__"):
            setattr(dispatch, name, getattr(stub, name))

        def choose(*arguments: Any) -> Callable | None:
            classes = tuple(choices.tag_class(a) for a in arguments[:tags])
            found = find(classes)
            apart = any(stub.__name__ in getattr(tag, "scalarised", ()) for tag in classes)
            if apart and lanes_of(arguments):
                return lambda *given: lane_by_lane(dispatch, False, given)
            return found

        implements(dispatch, by_type=True)(choose)

        def on(*classes: type) -> Callable[[Callable], Callable]:
            def register(implementation: Callable) -> Callable:
                nonlocal nearest
                table[classes] = implementation
                before, nearest = nearest, {}
                forget()
                if any(find(asked) is not found for asked, found in before.items()):
                    outdate_kernels()
                return implementation

            return register

        def defined(*classes: type) -> bool:
            choices.note([(dispatch, classes)])
            return find(classes) is not fallback

        dispatch.tags, dispatch.find, dispatch.on, dispatch.defined = tags, find, on, defined
        choices.point_functions.setdefault(choices.name_of(dispatch), []).append(dispatch)
        return dispatch

    return declare


def real(value: float, like: Any) -> Any:
    """Give `value` the number type of `like`.

    Literals take the type of what they meet; this is for what meets nothing yet.
    """
    return type(like)(value)


def lanes_of(numba_type: Any) -> int:
    """Count the lanes of a type, or of a value (:mod:`karamelo_py.compiler.lanes`).

    It is 0 for numbers; of tuples, those of what is in them.
    """
    if isinstance(numba_type, tuple | types.BaseTuple):
        return max(map(lanes_of, numba_type), default=0)
    return getattr(numba_type, "width", 0)


INSTEAD[lanes_of] = lambda thing: lanes_of(now().kind_of(thing))


def _of_width(width: int, scalar: types.Type) -> types.Type:
    return Lanes(scalar, width) if width else scalar


@implements(real)
@intrinsic
def _real(value, like):
    scalar = scalar_of(like) if isinstance(like, Lanes | types.Float) else types.float64
    made = _of_width(lanes_of((value, like)), scalar)
    return made(value, like), lambda builder, given, _: code.cast(builder, given, value, made)


@implements(int, Lanes)
@intrinsic
def _truncated(a):
    if not isinstance(a.scalar, types.Float):
        return None
    whole = Lanes(types.int32, a.width)  # every processor has that, and cells are no more
    return whole(a), lambda builder, given: code.cast(builder, given, a, whole)


def round_off(like: Any) -> Any:
    """Give the relative error of one operation, in the number type of `like`."""
    return type(like)(2.0**-23 if type(like).__name__ == "float32" else 2.0**-52)


@implements(round_off)
@intrinsic
def _round_off(like):
    scalar = types.float32 if scalar_of(like) == types.float32 else types.float64
    made = _of_width(lanes_of(like), scalar)

    def codegen(builder, _):
        error = code.constant(builder, scalar, 2.0**-23 if scalar == types.float32 else 2.0**-52)
        return code.cast(builder, error, scalar, made)

    return made(like), codegen


def index(i: int) -> int:
    """Give `i` as an array index that is known not to be negative.

    Saves a test for indices counted from the end at every access (a tenth of a sweep).
    """
    return i


implements(index)(lambda i: types.uint64(i))

implements(index, Lanes)(lambda i: i)


def beside(first: int, steps: int) -> int:
    """Give `first` + `steps` as the number of a node: an array index, as `index` makes it.

    Of lanes it keeps the two apart: what is `steps` from the first node of each is found from the
    places of these.
    """
    return first + steps


implements(beside)(lambda first, steps: types.uint64(first + steps))


@shared
def fma(a: float, b: float, c: float) -> float:
    """Add a b to c with one rounding, where compiled: always so, whatever surrounds it."""
    return a * b + c


@intrinsic
def _fused(a, b, c):
    kind = common(a, b, c)
    call = arithmetic.of_library("llvm.fma")
    return kind(kind, kind, kind), lambda builder, *values: call(builder, values)


@implements(fma, by_type=True)
def _fma(a, b, c):
    real = a == b == c and isinstance(a, types.Float)
    return _fused if real or lanes_of((a, b, c)) else None


@intrinsic
def select(condition, a, b):
    """Choose lane by lane."""
    lanes = common(a, b)
    lanes = lanes if isinstance(lanes, Lanes) else Lanes(a, condition.width)
    return lanes(condition, lanes, lanes), lambda builder, *values: builder.select(*values)


@shared
def where(condition: bool, a: float, b: float) -> float:
    """Choose `a` where `condition` holds, else `b`; both are computed, and nothing branches."""
    return a if condition else b


@implements(where, Lanes)
def _where(condition, a, b):
    if not isinstance(a, tuple):
        return select(condition, a, b)
    return rebuilt(a, [where(condition, x, y) for x, y in zip(a, b, strict=True)])


OF_REALS |= {fma, where}


def _all_bits(builder: Any, mask: Any, sign: str, wanted: int) -> Any:
    bits = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.icmp_signed(sign, bits, ir.Constant(bits.type, wanted))


@shared
def all_lanes(condition: bool) -> bool:
    """Tell whether a condition holds in all lanes; it itself where there are none."""
    return condition


@implements(all_lanes, Lanes)
@intrinsic
def _all(mask):
    return types.boolean(mask), lambda builder, given: _all_bits(builder, given, "==", -1)


@shared
def any_lane(condition: bool) -> bool:
    """Tell whether a condition holds in any lane; it itself where there are none."""
    return condition


@implements(any_lane, Lanes)
@intrinsic
def _any(mask):
    return types.boolean(mask), lambda builder, given: _all_bits(builder, given, "!=", 0)


def all_same(builder: Any, value: Any) -> Any:
    """Check that all lanes have the same whole number."""
    first = code.shuffle(builder, value, value, [0] * value.type.count)
    return _all_bits(builder, builder.icmp_signed("==", value, first), "==", -1)


@implements(bool, Lanes)
@intrinsic
def _branch(value):
    raise Untraceable(
        "several points are computed at once, which a branch cannot tell apart: take where, "
        "all_lanes or any_lane, or name the point function in scalarised"
    )


# --- lane after lane ---------------------------------------------------------------------------


@shared
def largest(a: float) -> float:
    """Find the largest of the lanes; a number itself."""
    return a


@implements(largest, Lanes)
@intrinsic
def _largest_lane(a):
    def codegen(builder, given):
        best = lane(builder, given, 0)
        for k in range(1, a.width):
            value = lane(builder, given, k)
            best = builder.select(builder.fcmp_ordered(">", value, best), value, best)
        return best

    return a.scalar(a), codegen


@shared
def first_false_lane(condition: bool) -> int:
    """Find the first lane in which a condition does not hold; 0 where there are none."""
    return 0


@implements(first_false_lane, Lanes)
@intrinsic
def _first_false(mask):
    def codegen(builder, given):
        found = I64(0)
        for k in reversed(range(mask.width)):
            found = builder.select(lane(builder, given, k), found, I64(k))
        return found

    return types.int64(mask), codegen


@shared
def first_lane(number: int) -> int:
    """Give the number of the first lane; a number itself."""
    return number


@implements(first_lane, Lanes)
@intrinsic
def _first(a):
    return a.scalar(a), lambda builder, given: lane(builder, given, 0)


@shared
def added(total: float, value: float) -> float:
    """Add to `total` a value that may be in lanes: one after another, as numbers would be added."""
    return total + value


@implements(added, Lanes)
@intrinsic
def _added_lanes(total, a):
    def codegen(builder, so_far, given):
        for k in range(a.width):
            so_far = builder.fadd(so_far, lane(builder, given, k))
        return so_far

    return total(total, a), codegen


def _lanes_changed(thing: Any, change: Callable) -> Any:
    """Give tuples, or a number, with something else for each number in lanes in them."""

    def changed(item: Any) -> Any:
        return change(item) if isinstance(item, Value) and isinstance(item._kind, Lanes) else item

    return mapped(changed, thing)


def _room(builder: Any, lanes: Lanes) -> Any:
    """Give memory for lanes; truth takes bytes there."""
    kind = ir.VectorType(code.memory_type(lanes.scalar), lanes.width)
    return builder and code.room(builder, kind)


def _in_memory(builder: Any, value: Value) -> Value:
    """Store lanes, to be read one by one."""
    room, bits = _room(builder, value._kind), value._value
    if builder:
        wanted = room.type.pointee
        builder.store(bits if bits.type == wanted else builder.zext(bits, wanted), room)
    return Value(value._kind, room)


def _from_memory(builder: Any, stored: Value) -> Value:
    bits, wanted = builder.load(stored._value), code.register_type(stored._kind)
    return Value(stored._kind, bits if bits.type == wanted else builder.trunc(bits, wanted))


def _place(builder: Any, stored: Value, k: Any) -> Any:
    """Give where one lane in memory is."""
    scalar = code.memory_type(stored._kind.scalar)
    return builder.gep(builder.bitcast(stored._value, scalar.as_pointer()), [k])


@in_kernels
def lane_by_lane(lowering: Any, function: Callable, unrolled: bool, arguments: tuple) -> Any:
    """Do a function of numbers for each lane among its arguments."""
    builder = lowering.builder
    width = lanes_of(tuple(map(lowering.kind_of, arguments)))
    stored = _lanes_changed(arguments, lambda value: _in_memory(builder, value))

    def run(k: Any) -> Any:
        def of_lane(value: Value) -> Value:
            scalar = value._kind.scalar
            place = builder and _place(builder, value, k)
            return Value(scalar, builder and code.get(builder, scalar, place))

        def to_lane(thing: Any) -> Value:
            scalar = types.unliteral(lowering.kind_of(thing))
            lanes = Lanes(scalar, width)
            made = Value(lanes, _room(builder, lanes))
            if builder:
                code.put(builder, scalar, lowering.lowered(thing, scalar), _place(builder, made, k))
            return made

        read, lowering.read = lowering.read, dict(lowering.read)
        found = mapped(to_lane, function(*_lanes_changed(stored, of_lane)))
        lowering.read = read
        return found

    if builder is None:
        return run(None)
    count = I64(width)
    if not unrolled:
        # The loop is to stay one, with one copy of the function: LLVM must not know its count.
        count = builder.asm(ir.FunctionType(I64, [I64]), "", "=r,0", [count], False)
    with code.counted(builder, count) as k:
        found = run(k)
    return _lanes_changed(found, lambda value: _from_memory(builder, value))


for _function in (
    math.log, math.log1p, math.exp, math.expm1, math.pow, math.sin, math.cos, math.tan, math.atan2,
    operator.pow, operator.floordiv, operator.mod,
):  # fmt: skip
    implements(_function, Lanes)(lambda *given, do=_function: lane_by_lane(do, True, given))


# --- groups of points, and nodes; in lanes: `lanes/` -------------------------------------------


@shared
def of_present(p: int, value: float) -> float:
    """Give `value`, and 0 in the lanes of a group of points that have no point."""
    return value


@shared
def is_one(number: int) -> bool:
    """Tell whether all lanes have the same number."""
    return True


class Weighted(NamedTuple):
    """Rows of an array in the place of one: read, their weighted sum; given to, each its share."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]


@shared
def prefetch(array: Any, at: tuple) -> None:
    """Have the memory bring what a loop over groups of points reads soon behind an item."""


@shared
def prefetch_records(array: Any, i: Any) -> None:
    """Have the memory bring the records some nodes behind those of number `i`, in lanes."""


@shared
def accumulate(array: Any, i: int | Weighted, first: int, values: tuple) -> None:
    """array[i, first + k] += values[k], lane after lane."""
    if isinstance(i, Weighted):
        for one, weight in zip(i.rows, i.weights, strict=True):
            accumulate(array, one, first, tuple([weight * value for value in values]))
    else:
        for k, value in enumerate(values):
            array[i, first + k] += value
