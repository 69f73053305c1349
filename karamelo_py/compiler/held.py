"""Tuples of arrays stored in memory and passed as one pointer.

A setup has about forty arrays of seven to nine numbers. Passed separately, they would be three
hundred arguments of each call, and half of the code to compile. Therefore a kernel holds its setup
when it starts: a tuple with arrays becomes a pointer to its items, and so do nested tuples. The
type of a held tuple is still a tuple type (items by name and index, selection by class); tuples
without arrays remain values.
"""

import hashlib
from collections.abc import Iterable, Iterator
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.values import HeldValue, builtin


def _words(numba_type: Any) -> str:
    """Name a type, with the modules of its classes, which Numba's names omit."""
    if isinstance(numba_type, types.BaseTuple) and not isinstance(numba_type, HeldTuple):
        kind = getattr(numba_type, "instance_class", tuple)
        inner = ", ".join(_words(item) for item in numba_type)
        return f"{kind.__module__}.{kind.__qualname__}({inner})"
    return str(numba_type)


class HeldTuple(types.BaseTuple):
    """Type of a pointer to the items of a tuple or NamedTuple."""

    def __init__(self, items: tuple, instance_class: type | None = None):
        self.types = items
        self.count = len(items)
        word = ""
        if instance_class is not None:
            self.fields, self.instance_class = tuple(instance_class._fields), instance_class
            word = f"{instance_class.__module__}.{instance_class.__qualname__}"
        text = f"{word}({', '.join(_words(item) for item in items)})"
        # Short, because it is part of function names.
        super().__init__(f"Held{word}_{hashlib.sha256(text.encode()).hexdigest()[:16]}")

    @property
    def key(self):
        return getattr(self, "instance_class", None), self.types

    def register_type(self) -> ir.Type:
        """LLVM type: a pointer to a structure of the items."""
        return ir.LiteralStructType(map(code.memory_type, self.types)).as_pointer()

    def __getitem__(self, k: int) -> types.Type:
        return self.types[k]

    def __len__(self) -> int:
        return len(self.types)

    def __iter__(self) -> Iterator:
        return iter(self.types)


def _has_arrays(numba_type: Any) -> bool:
    if isinstance(numba_type, types.BaseTuple):
        return isinstance(numba_type, HeldTuple) or any(_has_arrays(item) for item in numba_type)
    return isinstance(numba_type, types.Array)


def held_type(numba_type: Any) -> Any:
    """Return the type of a value when held; unchanged without tuples that contain arrays."""
    if (
        not isinstance(numba_type, types.BaseTuple)
        or isinstance(numba_type, HeldTuple)
        or not _has_arrays(numba_type)
    ):
        return numba_type
    items = tuple(held_type(item) for item in numba_type)
    return HeldTuple(items, getattr(numba_type, "instance_class", None))


def hold(value: Any) -> Any:
    """Hold `value`: in kernels, tuples with arrays become held tuples.

    A held tuple lives until the calling function returns: pass it on, but do not return it.
    """
    return value


@builtin(hold)
def _hold(lowering: Any, thing: Any) -> Any:
    kind = types.unliteral(lowering.kind_of(thing))
    held = held_type(kind)
    return thing if held == kind else held_as(lowering, thing, held)


def held_as(lowering: Any, things: Iterable, held: HeldTuple) -> HeldValue:
    """Store things in memory as a held tuple of this type."""
    builder = lowering.builder
    items = [_hold(lowering, thing) for thing in things]
    place = builder and code.room(builder, held.register_type().pointee)
    if builder:
        for k, (item, part) in enumerate(zip(held, items, strict=True)):
            code.put(builder, item, lowering.lowered(part, item), code.at(builder, place, 0, k))
    return HeldValue(held, place)


def item_of(builder: Any, held: HeldTuple, place: Any, k: int) -> Any:
    """Write code that reads item `k` of a held tuple."""
    return code.get(builder, held[k], code.at(builder, place, 0, k))


def at_hand(held: Any) -> Any:
    """Copy a held tuple to private memory, so that its items stay in registers.

    For kernels with loops, before the loops; inside, LLVM cannot know that the items do not change.
    """
    return held


@builtin(at_hand)
def _at_hand(lowering: Any, held: Any) -> Any:
    if not isinstance(held, HeldValue) or lowering.builder is None:
        return held
    return HeldValue(held._kind, _copy(lowering.builder, held._kind, held._value))


def _copy(builder: Any, held: HeldTuple, there: Any) -> Any:
    """Write code that copies a held tuple and the held tuples in it."""
    place = code.room(builder, there.type.pointee)
    builder.store(builder.load(there), place)
    for k, item in enumerate(held):
        if is_held(item):
            at = code.at(builder, place, 0, k)
            builder.store(_copy(builder, item, builder.load(at)), at)
    return place


def is_held(numba_type: Any) -> bool:
    """Tell whether a type is a held tuple."""
    return isinstance(numba_type, HeldTuple)
