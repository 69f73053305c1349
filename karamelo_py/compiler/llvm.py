"""LLVM types of kernels in registers and in memory, and access to parts of values."""

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

I1, I8, I32, I64 = (ir.IntType(bits) for bits in (1, 8, 32, 64))
NOTHING = I8.as_pointer()  # type of None, classes and functions
_REALS = {32: ir.FloatType(), 64: ir.DoubleType()}


class LaneType(types.Type):
    width: int


class Lanes(LaneType):
    """`width` numbers of a scalar type in a vector register."""

    def __init__(self, scalar: types.Type, width: int):
        self.scalar, self.width = scalar, width
        super().__init__(name=f"Lanes({scalar}, {width})")

    def register_type(self) -> ir.VectorType:
        return ir.VectorType(register_type(self.scalar), self.width)


def per_type(function: Callable) -> Callable:
    """Cache results by Numba's type numbers, as hashing types is slow."""
    results: dict[int, Any] = {}

    def cached(kind: types.Type) -> Any:
        if kind._code not in results:
            results[kind._code] = function(kind)
        return results[kind._code]

    return cached


@per_type
def register_type(kind: types.Type) -> ir.Type:
    if hasattr(kind, "register_type"):
        return kind.register_type()
    if isinstance(kind, types.Boolean):
        return I1
    if isinstance(kind, types.Integer):
        return ir.IntType(kind.bitwidth)
    if isinstance(kind, types.Float):
        return _REALS[kind.bitwidth]
    if isinstance(kind, types.Array):
        sizes = ir.ArrayType(I64, kind.ndim)
        return ir.LiteralStructType([memory_type(kind.dtype).as_pointer(), sizes, sizes])
    if isinstance(kind, types.BaseTuple):
        return ir.LiteralStructType(map(register_type, kind))
    return NOTHING


@per_type
def memory_type(kind: types.Type) -> ir.Type:
    """Return the LLVM type in memory, where booleans take a byte."""
    if isinstance(kind, types.Boolean):
        return I8
    if isinstance(kind, types.Record):
        return ir.ArrayType(I8, kind.size)
    if isinstance(kind, types.BaseTuple) and not hasattr(kind, "register_type"):
        return ir.LiteralStructType(map(memory_type, kind))
    return register_type(kind)


@per_type
def is_empty(kind: types.Type) -> bool:
    """Return True for types without a value, such as None and tuples of tags."""
    if isinstance(kind, types.BaseTuple) and not hasattr(kind, "register_type"):
        return all(map(is_empty, kind))
    return register_type(kind) == NOTHING and not isinstance(kind, types.Record)


def nothing() -> ir.Constant:
    return ir.Constant(NOTHING, None)


@per_type
def constants(kind: types.Type) -> Callable[[Any], ir.Constant]:
    """Return a function that makes constants of a type, once for each number."""
    made, is_real = register_type(kind), isinstance(kind, types.Float)

    def new(value: Any) -> ir.Constant:
        return ir.Constant(
            made, float(value) if is_real or isinstance(value, float) else int(value)
        )

    cached = functools.lru_cache(None, typed=True)(new)
    return lambda value: cached(value) if value else new(value)  # 0.0 and -0.0 are equal


@per_type
def number_in(kind: types.Type) -> types.Type | None:
    """Return the type of a number or of numbers in lanes, without a literal value."""
    scalar = types.unliteral(scalar_of(kind))
    return scalar if isinstance(scalar, types.Number | types.Boolean) else None


@functools.cache
def int32(k: int) -> ir.Constant:
    return ir.Constant(I32, k)


def constant_array(builder: ir.IRBuilder, kind: types.Array, value: np.ndarray) -> ir.Value:
    value = np.ascontiguousarray(value)
    item = memory_type(kind.dtype)
    value = value.view(np.uint8) if value.dtype == np.bool_ else value
    content = ir.Constant(ir.ArrayType(item, value.size), value.ravel().tolist())
    data = builder.bitcast(in_module(builder, content, "array"), item.as_pointer())
    return make_array(
        builder, kind, data, [I64(n) for n in value.shape], [I64(n) for n in value.strides]
    )


def in_module(builder: ir.IRBuilder, content: ir.Constant, name: str) -> ir.GlobalVariable:
    name = builder.module.get_unique_name(name)
    variable = ir.GlobalVariable(builder.module, content.type, name)
    variable.initializer, variable.global_constant, variable.linkage = content, True, "internal"
    return variable


def cast(builder: ir.IRBuilder, value: ir.Value, kind: types.Type, wanted: types.Type) -> ir.Value:
    if kind is wanted:
        return value
    if isinstance(wanted, types.Literal):
        wanted = types.unliteral(wanted)
    if kind == wanted:
        return value
    if isinstance(wanted, types.BaseTuple) and isinstance(kind, types.BaseTuple):
        parts = zip(unpack(builder, value), kind, wanted, strict=True)
        return make_tuple(builder, wanted, [cast(builder, *items) for items in parts])
    if isinstance(wanted, Lanes) and not isinstance(kind, Lanes):
        return splat(builder, cast(builder, value, kind, wanted.scalar), wanted)
    to, of = register_type(wanted), kind
    if isinstance(kind, Lanes) and isinstance(wanted, Lanes):
        kind, wanted = kind.scalar, wanted.scalar
    if isinstance(wanted, types.Boolean) and isinstance(kind, types.Integer):
        return builder.icmp_signed("!=", value, value.type(0))
    if isinstance(wanted, types.Boolean) and isinstance(kind, types.Float):
        return builder.fcmp_unordered("!=", value, value.type(0.0))
    conversion = _conversion(kind, wanted)
    if conversion is not None:
        if conversion == "sitofp" and isinstance(of, Lanes) and kind.bitwidth > 32:
            value = builder.trunc(value, ir.VectorType(I32, of.width))  # can be converted
        return getattr(builder, conversion)(value, to)
    if register_type(of) != to:
        raise TypeError(f"{of} is not a {wanted}")
    return value


def _conversion(kind: types.Type, wanted: types.Type) -> str | None:
    whole, real = types.Integer | types.Boolean, types.Float
    signed = isinstance(kind, types.Integer) and kind.signed
    width = kind.bitwidth if isinstance(kind, types.Integer | real) else 1
    if isinstance(kind, whole) and isinstance(wanted, types.Integer) and width != wanted.bitwidth:
        return "trunc" if width > wanted.bitwidth else "sext" if signed else "zext"
    if isinstance(kind, whole) and isinstance(wanted, real):
        return "sitofp" if signed else "uitofp"
    if isinstance(kind, real) and isinstance(wanted, types.Integer):
        return "fptosi" if wanted.signed else "fptoui"
    if isinstance(kind, real) and isinstance(wanted, real):
        return "fpext" if width < wanted.bitwidth else "fptrunc"
    return None


def scalar_of(kind: types.Type) -> types.Type:
    return kind.scalar if type(kind) is Lanes else kind  # isinstance is slow for Numba's types


def splat(builder: ir.IRBuilder, value: ir.Value, lanes: Lanes) -> ir.Value:
    none = ir.Constant(register_type(lanes), ir.Undefined)
    one = builder.insert_element(none, value, int32(0))
    return shuffle(builder, one, none, [0] * lanes.width)


def lane(builder: ir.IRBuilder, value: ir.Value, k: int) -> ir.Value:
    return builder.extract_element(value, int32(k))


def pack(builder: ir.IRBuilder, values: list, lanes: Lanes) -> ir.Value:
    made = ir.Constant(register_type(lanes), ir.Undefined)
    for k, value in enumerate(values):
        made = builder.insert_element(made, value, int32(k))
    return made


def shuffle(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, order: list[int]) -> ir.Value:
    return builder.shuffle_vector(a, b, _order(tuple(order)))


@functools.cache
def _order(items: tuple[int, ...]) -> ir.Constant:
    return ir.Constant(ir.VectorType(I32, len(items)), list(map(int32, items)))


def overloaded(kind: ir.Type) -> str:
    """Return LLVM's name of a type in function names: f64, v4f64, ..."""
    if isinstance(kind, ir.VectorType):
        return f"v{kind.count}{kind.element.intrinsic_name}"
    return kind.intrinsic_name


def room(builder: ir.IRBuilder, kind: ir.Type) -> ir.Value:
    """Allocate stack memory at the entry of the function, once for all iterations."""
    with builder.goto_entry_block():
        return builder.alloca(kind)


def at(builder: ir.IRBuilder, pointer: ir.Value, *indices: int) -> ir.Value:
    return builder.gep(pointer, list(map(int32, indices)), inbounds=True)


def put(
    builder: ir.IRBuilder,
    kind: types.Type,
    value: ir.Value,
    pointer: ir.Value,
    align: int | None = None,
) -> None:
    value = _converted(builder, kind, value, memory_type, lambda truth: builder.zext(truth, I8))
    builder.store(value, pointer, align=align)


def get(
    builder: ir.IRBuilder, kind: types.Type, pointer: ir.Value, align: int | None = None
) -> ir.Value:
    value = builder.load(pointer, align=align)
    return _converted(builder, kind, value, register_type, lambda byte: builder.trunc(byte, I1))


def _converted(
    builder: ir.IRBuilder, kind: types.Type, value: ir.Value, to: Callable, truth: Callable
) -> ir.Value:
    if register_type(kind) == memory_type(kind):
        return value
    if not isinstance(kind, types.BaseTuple):
        return truth(value)
    items = zip(kind, unpack(builder, value), strict=True)
    parts = [_converted(builder, item, value, to, truth) for item, value in items]
    return make_struct(builder, to(kind), parts)


def make_tuple(builder: ir.IRBuilder, kind: types.Type, items: Sequence) -> ir.Value:
    return make_struct(builder, register_type(kind), items)


def make_struct(builder: ir.IRBuilder, kind: ir.Type, items: Sequence) -> ir.Value:
    made = ir.Constant(kind, ir.Undefined)
    for k, item in enumerate(items):
        made = builder.insert_value(made, item, k)
    return made


def unpack(builder: ir.IRBuilder, value: ir.Value) -> list:
    count = len(value.type.elements) if hasattr(value.type, "elements") else value.type.count
    return [builder.extract_value(value, k) for k in range(count)]


def make_array(
    builder: ir.IRBuilder, kind: types.Array, data: Any, shape: Sequence, strides: Sequence
) -> ir.Value:
    made = register_type(kind)
    sizes = [make_struct(builder, made.elements[1], numbers) for numbers in (shape, strides)]
    return make_struct(builder, made, [data, *sizes])


class ArrayParts:
    def __init__(self, builder: ir.IRBuilder, kind: types.Array, value: ir.Value):
        self.builder, self.kind, self.value = builder, kind, value

    @functools.cached_property
    def data(self) -> Any:
        return self.builder.extract_value(self.value, 0)

    @functools.cached_property
    def shape(self) -> list:
        return [self.builder.extract_value(self.value, (1, k)) for k in range(self.kind.ndim)]

    @functools.cached_property
    def strides(self) -> list:
        return [self.builder.extract_value(self.value, (2, k)) for k in range(self.kind.ndim)]


def item_pointer(
    builder: ir.IRBuilder, kind: types.Array, value: ir.Value, indices: Sequence, last: Any = None
) -> ir.Value:
    """Return the address of an item; `last` is the last stride, if known."""
    parts = ArrayParts(builder, kind, value)
    if kind.layout == "C":
        offset = indices[0]
        for index, count in zip(indices[1:], parts.shape[1:], strict=True):
            offset = builder.add(builder.mul(offset, count), index)
        return builder.gep(parts.data, [offset])
    strides = parts.strides if last is None else [*parts.strides[:-1], last]
    products = [builder.mul(s, i) for s, i in zip(strides, indices, strict=True)]
    return byte_pointer(builder, parts.data, functools.reduce(builder.add, products))


def byte_pointer(builder: ir.IRBuilder, pointer: ir.Value, offset: ir.Value) -> ir.Value:
    address = builder.gep(builder.bitcast(pointer, I8.as_pointer()), [offset])
    return builder.bitcast(address, pointer.type)


def external(
    builder: ir.IRBuilder, name: str, result: ir.Type, arguments: Sequence[ir.Type]
) -> ir.Function:
    declared = builder.module.globals.get(name)
    kind = ir.FunctionType(result, arguments)
    return declared if declared is not None else ir.Function(builder.module, kind, name)


def call(builder: ir.IRBuilder, name: str, result: ir.Type, values: list) -> ir.Value:
    """Call a function of LLVM (named with its type) or of the C library."""
    kinds = [value.type for value in values]
    if name.startswith("llvm."):
        name += f".{overloaded(kinds[0])}"
    elif isinstance(kinds[0], ir.FloatType):
        name += "f"
    function = external(builder, name, result, kinds)
    if not name.startswith("llvm."):
        function.attributes.add("nounwind")
        if not any(isinstance(kind, ir.PointerType) for kind in kinds):
            function.attributes.add("readonly")
    return builder.call(function, values)


def of_library(name: str) -> Callable:
    return lambda builder, values: call(builder, name, values[0].type, values)


@contextmanager
def counted(builder: ir.IRBuilder, count: ir.Value) -> Iterator[Any]:
    """Write a loop over [0, count), whose body is written in this context."""
    before = builder.block
    head, body, end = (builder.append_basic_block(name) for name in ("head", "body", "end"))
    builder.branch(head)
    builder.position_at_end(head)
    index = builder.phi(count.type)
    index.add_incoming(count.type(0), before)
    builder.cbranch(builder.icmp_signed("<", index, count), body, end)
    builder.position_at_end(body)
    yield index
    index.add_incoming(builder.add(index, count.type(1), flags=("nsw",)), builder.block)
    builder.branch(head)
    builder.position_at_end(end)
