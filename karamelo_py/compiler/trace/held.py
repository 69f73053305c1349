"""Tuples of arrays that are stored in memory and passed as a pointer.

A setup has about forty arrays, each described by seven to nine numbers. As three hundred arguments,
these numbers would be half of the code to compile. Therefore a (nested) tuple with arrays is stored
in memory, and kernels get a pointer to the tuple. The type of the tuple is still a tuple type.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.trace.choices import tag_class
from karamelo_py.compiler.trace.session import session
from karamelo_py.compiler.trace.values import HeldValue, builtin


def _words(kind: Any) -> str:
    if isinstance(kind, types.BaseTuple) and not isinstance(kind, HeldTuple):
        tag = tag_class(kind) or tuple
        return f"{tag.__module__}.{tag.__qualname__}({', '.join(map(_words, kind))})"
    return str(kind)


class Struct(ir.LiteralStructType):
    """A struct that the text of a module names, so that the text of instructions is short."""

    def __init__(self, name: str, elements: Iterable):
        self.name = name
        super().__init__(elements)

    def _to_string(self) -> str:
        return self.name

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Struct) and self.name == other.name

    __hash__ = ir.LiteralStructType.__hash__


def text_with_types(module: ir.Module) -> str:
    """Return the text of a module, with the types that it names."""
    text = str(module)
    names, declared = set(_NAME.findall(text)), {}
    while names:
        name = names.pop()
        declared[name] = session.structs[name].structure_repr()
        names |= set(_NAME.findall(declared[name])) - declared.keys()
    head, blank, body = text.partition("\n\n")
    return "\n".join([head, *(f"{k} = type {declared[k]}" for k in sorted(declared)), blank + body])


_NAME = re.compile(r"%T\.[0-9a-f]{16}")


class HeldTuple(types.BaseTuple):
    fields: tuple[str, ...] = ()
    instance_class: Any = None

    def __init__(self, items: tuple, instance_class: type | None = None):
        self.types = items
        self.count = len(items)
        word = ""
        if instance_class is not None:
            self.fields, self.instance_class = tuple(instance_class._fields), instance_class
            word = f"{instance_class.__module__}.{instance_class.__qualname__}"
        text = f"{word}({', '.join(map(_words, items))})"
        # The hash is short, as it is part of function names.
        self.hash = hashlib.sha256(text.encode()).hexdigest()[:16]
        super().__init__(f"Held{word}_{self.hash}")

    @property
    def key(self):
        return self.instance_class, self.types

    def register_type(self) -> ir.Type:
        name = f"%T.{self.hash}"
        if name not in session.structs:
            session.structs[name] = Struct(name, map(llvm.memory_type, self.types))
        return session.structs[name].as_pointer()

    def __getitem__(self, k: int) -> types.Type:
        return self.types[k]

    def __len__(self) -> int:
        return len(self.types)

    def __iter__(self) -> Iterator:
        return iter(self.types)


def _has_arrays(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return isinstance(kind, HeldTuple) or any(map(_has_arrays, kind))
    return isinstance(kind, types.Array)


def held_type(kind: Any) -> Any:
    """Return the type of a held value; tuples without arrays are not held."""
    is_tuple = isinstance(kind, types.BaseTuple) and not isinstance(kind, HeldTuple)
    if not is_tuple or not _has_arrays(kind):
        return kind
    return HeldTuple(tuple(map(held_type, kind)), tag_class(kind))


def hold(value: Any) -> Any:
    """In kernels, make a held tuple of `value` if it has arrays.

    The tuple exists until the calling function returns, so it may be passed on, but not returned.
    """
    return value


@builtin(hold)
def _hold(lowering: Any, thing: Any) -> Any:
    kind = types.unliteral(lowering.kind_of(thing))
    wanted = held_type(kind)
    return thing if wanted == kind else held_as(lowering, thing, wanted)


def held_as(lowering: Any, things: Iterable, kind_of_tuple: HeldTuple) -> HeldValue:
    builder = lowering.builder
    items = [_hold(lowering, thing) for thing in things]
    room = llvm.room(builder, kind_of_tuple.register_type().pointee)
    for k, (kind, item) in enumerate(zip(kind_of_tuple, items, strict=True)):
        llvm.put(builder, kind, lowering.lowered(item, kind), llvm.at(builder, room, 0, k))
    return HeldValue(kind_of_tuple, room)


def item_of(builder: ir.IRBuilder, kind: HeldTuple, pointer: ir.Value, k: int) -> ir.Value:
    return llvm.get(builder, kind[k], llvm.at(builder, pointer, 0, k))


def item_at(builder: ir.IRBuilder, kind: HeldTuple, pointer: ir.Value, k: ir.Value) -> ir.Value:
    """Return an item of a tuple of alike items, whose number is only known at run time."""
    items = builder.bitcast(pointer, llvm.memory_type(kind[0]).as_pointer())
    return llvm.get(builder, kind[0], builder.gep(items, [k]))


def at_hand(value: Any) -> Any:
    """Copy a held tuple to private memory before a loop, so that LLVM can use registers."""
    return value


@builtin(at_hand)
def _at_hand(lowering: Any, value: Any) -> Any:
    if not isinstance(value, HeldValue):
        return value
    return HeldValue(value._kind, _copy(lowering.builder, value._kind, value._value))


def _copy(builder: ir.IRBuilder, kind: HeldTuple, source: ir.Value) -> ir.Value:
    room = llvm.room(builder, source.type.pointee)
    builder.store(builder.load(source), room)
    for k, item in enumerate(kind):
        if is_held(item):
            at = llvm.at(builder, room, 0, k)
            builder.store(_copy(builder, item, builder.load(at)), at)
    return room


def is_held(kind: Any) -> bool:
    return isinstance(kind, HeldTuple)
