"""Items and slices of arrays, and fields of records."""

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code.arithmetic import OPERATIONS
from karamelo_py.compiler.trace.values import Untraceable, Value


def _places(place: Any) -> tuple:
    return place if isinstance(place, tuple) else (place,)


def is_part(kind: types.Array, place: Any) -> bool:
    """Tell whether indices select a slice of an array instead of an item."""
    places = _places(place)
    return len(places) < kind.ndim or any(isinstance(one, slice) for one in places)


def part_type(kind: types.Array, place: Any) -> types.Array:
    """Return the type of a slice of an array."""
    places = _places(place)
    if len(places) > kind.ndim:
        raise Untraceable(f"an array of {kind.ndim} dimensions has no {len(places)} indices")
    slices = [k for k, one in enumerate(places) if isinstance(one, slice)]
    whole = not slices or (slices == [len(places) - 1] and places[-1].step is None)
    layout = "C" if kind.layout == "C" and whole else "A"
    return kind.copy(ndim=kind.ndim - len(places) + len(slices), layout=layout)


def _index_type(lowering: Any, thing: Any) -> types.Type:
    kind = types.unliteral(lowering.kind_of(thing))
    if not isinstance(kind, types.Integer | types.Boolean):
        raise Untraceable(f"{kind} is no index")
    return kind


def _index(lowering: Any, thing: Any, count: Any) -> Any:
    """Compute an index; negative ones count from the end."""
    kind = _index_type(lowering, thing)
    value = lowering.lowered(thing, types.intp)
    known = isinstance(thing, int) and thing >= 0
    if known or isinstance(kind, types.Boolean) or not kind.signed:
        return value
    return _from_the_end(lowering.builder, value, count)


def _from_the_end(builder: Any, value: Any, count: Any) -> Any:
    negative = builder.icmp_signed("<", value, llvm.I64(0))
    return builder.select(negative, builder.add(value, count), value)


def item_place(lowering: Any, array: Value, place: Any) -> Any:
    """Compute the address of an item."""
    parts = llvm.ArrayParts(lowering.builder, array._kind, array._value)
    pairs = zip(_places(place), parts.shape, strict=True)
    indices = [_index(lowering, one, count) for one, count in pairs]
    return llvm.item_pointer(lowering.builder, array._kind, array._value, indices)


def _align(kind: types.Array) -> int | None:
    return None if kind.aligned else 1


def get(lowering: Any, array: Value, place: Any) -> Any:
    """Read an item, or make a slice."""
    kind, builder = array._kind, lowering.builder
    if is_part(kind, place):
        made = part_type(kind, place)
        return Value(made, builder and _part(lowering, array, place, made))
    if builder is None:
        for one in _places(place):
            _index_type(lowering, one)
        return lowering.wrapped(kind.dtype, None)
    at = item_place(lowering, array, place)
    if isinstance(kind.dtype, types.Record):
        return Value(kind.dtype, builder.bitcast(at, llvm.NOTHING))
    return lowering.wrapped(kind.dtype, llvm.get(builder, kind.dtype, at, _align(kind)))


def put(lowering: Any, array: Value, place: Any, value: Any) -> None:
    """Write an item, or all items of a slice."""
    kind, builder = array._kind, lowering.builder
    given = types.unliteral(lowering.kind_of(value))
    if not isinstance(given, types.Number | types.Boolean | types.Array):
        raise Untraceable(f"{given} cannot be put into an array")
    if not kind.mutable:
        raise Untraceable("an array that must not be changed")
    if builder is None:
        return
    if not is_part(kind, place):
        number = lowering.lowered(value, kind.dtype)
        llvm.put(builder, kind.dtype, number, item_place(lowering, array, place), _align(kind))
        return
    made = part_type(kind, place)
    _fill(lowering, Value(made, _part(lowering, array, place, made)), value)


def _fill(lowering: Any, array: Value, value: Any, outer: tuple = ()) -> None:
    """Set each item of an array to a number, or to the item of another array."""
    builder, kind = lowering.builder, array._kind
    parts = llvm.ArrayParts(builder, kind, array._value)
    if len(outer) < kind.ndim:
        if not outer and not isinstance(lowering.kind_of(value), types.Array):
            value = Value(kind.dtype, lowering.lowered(value, kind.dtype))
        with llvm.counted(builder, parts.shape[len(outer)]) as index:
            _fill(lowering, array, value, (*outer, index))
        return
    if isinstance(value._kind, types.Array):
        own = value._kind
        at = llvm.item_pointer(builder, own, value._value, outer[kind.ndim - own.ndim :])
        value = Value(own.dtype, llvm.get(builder, own.dtype, at, _align(own)))
    at = llvm.item_pointer(builder, kind, array._value, outer)
    llvm.put(builder, kind.dtype, lowering.lowered(value, kind.dtype), at, _align(kind))


def _bounds(lowering: Any, one: slice, count: Any) -> tuple[Any, Any, Any]:
    builder = lowering.builder
    zero = llvm.I64(0)
    step = 1 if one.step is None else one.step
    if not isinstance(step, int) or step < 1:
        raise Untraceable("a slice with a step that is not known, or below 1")

    def bound(thing: Any, otherwise: Any) -> Any:
        if thing is None:
            return otherwise
        value = _from_the_end(builder, lowering.lowered(thing, types.intp), count)
        value = builder.select(builder.icmp_signed("<", value, zero), zero, value)
        return builder.select(builder.icmp_signed(">", value, count), count, value)

    first, last = bound(one.start, zero), bound(one.stop, count)
    size = builder.sub(last, first)
    if step > 1:
        size = builder.sdiv(builder.add(size, llvm.I64(step - 1)), llvm.I64(step))
    size = builder.select(builder.icmp_signed("<", size, zero), zero, size)
    return first, size, llvm.I64(step)


def _part(lowering: Any, array: Value, place: Any, made: types.Array) -> Any:
    builder = lowering.builder
    parts = llvm.ArrayParts(builder, array._kind, array._value)
    shape, strides, offset = [], [], llvm.I64(0)
    places = _places(place)
    for k, (count, stride) in enumerate(zip(parts.shape, parts.strides, strict=True)):
        one = places[k] if k < len(places) else slice(None)
        if isinstance(one, slice):
            first, size, step = _bounds(lowering, one, count)
            shape.append(size)
            strides.append(builder.mul(stride, step))
        else:
            first = _index(lowering, one, count)
        offset = builder.add(offset, builder.mul(first, stride))
    data = llvm.byte_pointer(builder, parts.data, offset)
    return llvm.make_array(builder, made, data, shape, strides)


def attribute(lowering: Any, thing: Value, name: str) -> Any:
    """Return an attribute of an array, a record or a number."""
    kind = thing._kind
    if isinstance(kind, types.Array):
        return _of_array(lowering, thing, name)
    if isinstance(kind, types.Record):
        return _of_record(lowering, thing, name)
    if name == "view" and isinstance(kind, types.Integer | types.Float):
        return lambda number: _seen_as(lowering, thing, number)
    raise AttributeError(f"{kind} has no attribute '{name}'")


def _of_array(lowering: Any, thing: Value, name: str) -> Any:
    kind, builder = thing._kind, lowering.builder
    parts = llvm.ArrayParts(builder, kind, thing._value)
    if name in ("shape", "strides"):
        found = getattr(parts, name) if builder else [None] * kind.ndim
        return tuple(Value(types.intp, one) for one in found)
    if name == "size":
        sizes = _of_array(lowering, thing, "shape")
        return math.prod(sizes[1:], start=sizes[0]) if sizes else 1
    if name == "ndim":
        return kind.ndim
    if name == "itemsize":
        return np.dtype(str(kind.dtype)).itemsize
    raise AttributeError(f"an array has no attribute '{name}' in a kernel")


def _of_record(lowering: Any, thing: Value, name: str) -> Any:
    kind, builder = thing._kind, lowering.builder
    if name not in kind.fields:
        raise AttributeError(f"a record has no field '{name}'")
    found = kind.typeof(name)
    at = builder and builder.gep(thing._value, [llvm.I64(kind.offset(name))])
    if isinstance(found, types.NestedArray):
        made = types.Array(found.dtype, found.ndim, "C", aligned=False)
        if builder is None:
            return Value(made, None)
        size = llvm.memory_type(found.dtype)
        strides = [
            math.prod(found.shape[k + 1 :]) * found.dtype.bitwidth // 8 for k in range(found.ndim)
        ]
        return Value(made, llvm.make_array(
            builder, made, builder.bitcast(at, size.as_pointer()),
            list(map(llvm.I64, found.shape)), list(map(llvm.I64, strides)),
        ))  # fmt: skip
    if builder is None:
        return lowering.wrapped(found, None)
    at = builder.bitcast(at, llvm.memory_type(found).as_pointer())
    return lowering.wrapped(found, llvm.get(builder, found, at, 1))


def set_attribute(lowering: Any, thing: Value, name: str, value: Any) -> None:
    """Write a field of a record."""
    kind, builder = thing._kind, lowering.builder
    if not isinstance(kind, types.Record) or name not in kind.fields:
        raise AttributeError(f"{kind} has no attribute '{name}' that can be set")
    found = kind.typeof(name)
    if builder is not None:
        at = builder.gep(thing._value, [llvm.I64(kind.offset(name))])
        at = builder.bitcast(at, llvm.memory_type(found).as_pointer())
        llvm.put(builder, found, lowering.lowered(value, found), at, 1)


def _seen_as(lowering: Any, thing: Value, number: Any) -> Value:
    wanted = OPERATIONS[getattr(number, "seen", number)](types.int64).result
    if wanted.bitwidth != thing._kind.bitwidth:
        raise Untraceable("numbers of other widths have other bits")
    builder = lowering.builder
    return Value(wanted, builder and builder.bitcast(thing._value, llvm.register_type(wanted)))


def item_of_tuple(lowering: Any, things: tuple, place: Value) -> Any:
    """Return an item of a tuple at an index known at run time."""
    kinds = [types.unliteral(lowering.kind_of(thing)) for thing in things]
    kind, builder = lowering.unify(*kinds), lowering.builder
    if kind is None:
        raise Untraceable("items of several types at a place that only a run knows")
    if builder is None:
        return lowering.wrapped(kind, None)
    values = [lowering.lowered(thing, kind) for thing in things]
    index = _index(lowering, place, llvm.I64(len(values)))
    room = llvm.room(builder, ir.ArrayType(llvm.memory_type(kind), len(values)))
    for k, value in enumerate(values):
        llvm.put(builder, kind, value, llvm.at(builder, room, 0, k))
    found = builder.gep(room, [llvm.I64(0), index], inbounds=True)
    return lowering.wrapped(kind, llvm.get(builder, kind, found))
