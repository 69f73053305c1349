"""Items and slices of arrays, and fields of records."""

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code.arithmetic import OPERATIONS
from karamelo_py.compiler.trace.values import Emitted, Untraceable, Value


def _indices(index: Any) -> tuple:
    return index if isinstance(index, tuple) else (index,)


def is_part(kind: types.Array, index: Any) -> bool:
    places = _indices(index)
    return len(places) < kind.ndim or any(isinstance(one, slice) for one in places)


def part_type(kind: types.Array, index: Any) -> types.Array:
    places = _indices(index)
    if len(places) > kind.ndim:
        raise Untraceable(f"an array of {kind.ndim} dimensions has no {len(places)} indices")
    slices = [k for k, one in enumerate(places) if isinstance(one, slice)]
    whole = not slices or (slices == [len(places) - 1] and places[-1].step is None)
    layout = "C" if kind.layout == "C" and whole else "A"
    return kind.copy(ndim=kind.ndim - len(places) + len(slices), layout=layout)


def _index(lowering: Any, thing: Any, count: Any) -> Any:
    """Compute an index, from the end if negative."""
    kind = types.unliteral(lowering.kind_of(thing))
    if not isinstance(kind, types.Integer | types.Boolean):
        raise Untraceable(f"{kind} is not an index")
    value = lowering.lowered(thing, types.intp)
    is_positive = isinstance(thing, int) and thing >= 0
    if is_positive or isinstance(kind, types.Boolean) or not kind.signed:
        return value
    return _from_the_end(lowering.builder, value, count)


def _from_the_end(builder: ir.IRBuilder, value: ir.Value, count: ir.Value) -> ir.Value:
    negative = builder.icmp_signed("<", value, llvm.I64(0))
    return builder.select(negative, builder.add(value, count), value)


def item_address(lowering: Any, array: Value, index: Any) -> Any:
    parts = llvm.ArrayParts(lowering.builder, array._kind, array._value)
    pairs = zip(_indices(index), parts.shape, strict=True)
    indices = [_index(lowering, one, count) for one, count in pairs]
    return llvm.item_pointer(lowering.builder, array._kind, array._value, indices)


def _align(kind: types.Array) -> int | None:
    return None if kind.aligned else 1


def get(lowering: Any, array: Value, index: Any) -> Any:
    kind, builder = array._kind, lowering.builder
    if is_part(kind, index):
        made = part_type(kind, index)
        return Value(made, _part(lowering, array, index, made))
    at = item_address(lowering, array, index)
    if isinstance(kind.dtype, types.Record):
        return Value(kind.dtype, builder.bitcast(at, llvm.NOTHING))
    return lowering.wrapped(kind.dtype, llvm.get(builder, kind.dtype, at, _align(kind)))


def put(lowering: Any, array: Value, index: Any, value: Any) -> None:
    kind, builder = array._kind, lowering.builder
    kind_of_value = types.unliteral(lowering.kind_of(value))
    if not isinstance(kind_of_value, types.Number | types.Boolean | types.Array):
        raise Untraceable(f"{kind_of_value} cannot be put into an array")
    if not kind.mutable:
        raise Untraceable("an array that must not be changed")
    if not is_part(kind, index):
        number = lowering.lowered(value, kind.dtype)
        llvm.put(builder, kind.dtype, number, item_address(lowering, array, index), _align(kind))
        return
    made = part_type(kind, index)
    _fill(lowering, Value(made, _part(lowering, array, index, made)), value)


def _fill(lowering: Any, array: Value, value: Any, outer: tuple = ()) -> None:
    builder, kind = lowering.builder, array._kind
    parts = llvm.ArrayParts(builder, kind, array._value)
    if len(outer) < kind.ndim:
        if not outer and not isinstance(lowering.kind_of(value), types.Array):
            value = Value(kind.dtype, lowering.lowered(value, kind.dtype))
        with llvm.counted(builder, parts.shape[len(outer)]) as index:
            _fill(lowering, array, value, (*outer, index))
        return
    if isinstance(value._kind, types.Array):
        source = value._kind
        at = llvm.item_pointer(builder, source, value._value, outer[kind.ndim - source.ndim :])
        value = Value(source.dtype, llvm.get(builder, source.dtype, at, _align(source)))
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


def _part(lowering: Any, array: Value, index: Any, made: types.Array) -> Any:
    builder = lowering.builder
    parts = llvm.ArrayParts(builder, array._kind, array._value)
    shape, strides, offset = [], [], llvm.I64(0)
    places = _indices(index)
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
        return tuple(Value(types.intp, one) for one in getattr(parts, name))
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
    field = kind.typeof(name)
    at = builder.gep(thing._value, [llvm.I64(kind.offset(name))])
    if isinstance(field, types.NestedArray):
        made = types.Array(field.dtype, field.ndim, "C", aligned=False)
        size = llvm.memory_type(field.dtype)
        strides = [
            math.prod(field.shape[k + 1 :]) * field.dtype.bitwidth // 8 for k in range(field.ndim)
        ]
        return Value(made, llvm.make_array(
            builder, made, builder.bitcast(at, size.as_pointer()),
            list(map(llvm.I64, field.shape)), list(map(llvm.I64, strides)),
        ))  # fmt: skip
    at = builder.bitcast(at, llvm.memory_type(field).as_pointer())
    return lowering.wrapped(field, llvm.get(builder, field, at, 1))


def set_attribute(lowering: Any, thing: Value, name: str, value: Any) -> None:
    kind, builder = thing._kind, lowering.builder
    if not isinstance(kind, types.Record) or name not in kind.fields:
        raise AttributeError(f"{kind} has no attribute '{name}' that can be set")
    field = kind.typeof(name)
    at = builder.gep(thing._value, [llvm.I64(kind.offset(name))])
    at = builder.bitcast(at, llvm.memory_type(field).as_pointer())
    llvm.put(builder, field, lowering.lowered(value, field), at, 1)


def _seen_as(lowering: Any, thing: Value, number: Any) -> Value:
    wanted = OPERATIONS[number.seen if isinstance(number, Emitted) else number](types.int64).result
    if wanted.bitwidth != thing._kind.bitwidth:
        raise Untraceable("numbers of other widths have other bits")
    bits = lowering.builder.bitcast(thing._value, llvm.register_type(wanted))
    return Value(wanted, bits)


def item_of_tuple(lowering: Any, things: tuple, index: Value) -> Any:
    kinds = [types.unliteral(lowering.kind_of(thing)) for thing in things]
    kind, builder = lowering.unify(*kinds), lowering.builder
    if kind is None:
        raise Untraceable("items of different types at an index that is known only at run time")
    values = [lowering.lowered(thing, kind) for thing in things]
    index = _index(lowering, index, llvm.I64(len(values)))
    room = llvm.room(builder, ir.ArrayType(llvm.memory_type(kind), len(values)))
    for k, value in enumerate(values):
        llvm.put(builder, kind, value, llvm.at(builder, room, 0, k))
    pointer = builder.gep(room, [llvm.I64(0), index], inbounds=True)
    return lowering.wrapped(kind, llvm.get(builder, kind, pointer))
