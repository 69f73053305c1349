"""Tuples of arrays held in memory, and passed as one pointer.

A setup has some forty arrays, each of which Numba passes as seven to nine numbers, so that a call
of one function by another is three hundred arguments, and half of what there is to compile are
tuples that are taken apart and put together again. Where a kernel starts it therefore holds its
setup: a tuple with arrays in it becomes a pointer to its items, and what such an item is itself is
a pointer, too. The type of a held tuple is a tuple's (its items can be read by name and number,
point functions are chosen by its class); tuples without arrays stay values.
"""

import hashlib
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin, lower_getattr_generic
from numba.core.types.containers import _HeterogeneousTuple
from numba.extending import intrinsic, models, register_model, type_callable


def _words(numba_type: Any) -> str:
    """A type in words, with the modules of the classes in it; Numba's leave them out."""
    if isinstance(numba_type, types.BaseTuple) and not isinstance(numba_type, _Held):
        kind = getattr(numba_type, "instance_class", tuple)
        inner = ", ".join(_words(item) for item in numba_type)
        return f"{kind.__module__}.{kind.__qualname__}({inner})"
    return str(numba_type)


class _Held(_HeterogeneousTuple):
    """Numba type of a pointer to the items of a tuple."""

    def __init__(self, items: tuple, word: str):
        self.types = items
        self.count = len(items)
        text = f"{word}({', '.join(_words(item) for item in items)})"
        # Short, for it is part of the names of functions.
        super().__init__(f"Held{word}_{hashlib.sha256(text.encode()).hexdigest()[:16]}")

    @property
    def iterator_type(self):
        raise NotImplementedError


class HeldTuple(_Held):
    """A held tuple without names."""

    @property
    def key(self):
        return self.types

    def __init__(self, items: tuple):
        super().__init__(items, "")


class HeldNamedTuple(_Held, types.BaseNamedTuple):
    """A held NamedTuple."""

    def __init__(self, items: tuple, instance_class: type):
        self.fields = tuple(instance_class._fields)
        self.instance_class = instance_class
        super().__init__(items, f"{instance_class.__module__}.{instance_class.__qualname__}")

    @property
    def key(self):
        return self.instance_class, self.types


@register_model(HeldTuple)
@register_model(HeldNamedTuple)
class _HeldModel(models.PrimitiveModel):
    """A pointer to a structure of the items."""

    def __init__(self, manager: Any, held: _Held):
        items = models.StructModel(manager, held, [(f"f{k}", t) for k, t in enumerate(held)])
        super().__init__(manager, held, items.get_data_type().as_pointer())


def _has_arrays(numba_type: Any) -> bool:
    if isinstance(numba_type, types.BaseTuple):
        return isinstance(numba_type, _Held) or any(_has_arrays(item) for item in numba_type)
    return isinstance(numba_type, types.Array)


def held_type(numba_type: Any) -> Any:
    """The type of a value when it is held; its own where it has no tuple with arrays in it."""
    if (
        not isinstance(numba_type, types.BaseTuple)
        or isinstance(numba_type, _Held)
        or not _has_arrays(numba_type)
    ):
        return numba_type
    items = tuple(held_type(item) for item in numba_type)
    if isinstance(numba_type, types.BaseNamedTuple):
        return HeldNamedTuple(items, numba_type.instance_class)
    return HeldTuple(items)


def _hold(context: Any, builder: Any, numba_type: Any, value: Any) -> Any:
    """Code that holds a value."""
    held = held_type(numba_type)
    if held == numba_type:
        return value
    place = cgutils.alloca_once(builder, context.data_model_manager[held].get_data_type().pointee)
    for k, item in enumerate(numba_type):
        part = _hold(context, builder, item, builder.extract_value(value, k))
        _put(context, builder, held, place, k, part)
    return place


def _put(context: Any, builder: Any, held: _Held, place: Any, k: int, part: Any) -> None:
    at = cgutils.gep_inbounds(builder, place, 0, k)
    if part.type == at.type.pointee:
        builder.store(part, at)
    else:  # of truth values
        context.pack_value(builder, held[k], part, at)


def item_of(context: Any, builder: Any, held: _Held, place: Any, k: int) -> Any:
    """Code that reads item `k` of a held tuple."""
    at = cgutils.gep_inbounds(builder, place, 0, k)
    if at.type.pointee == context.get_value_type(held[k]):
        return builder.load(at)
    return context.unpack_value(builder, held[k], at)


def _copy(builder: Any, held: _Held, there: Any) -> Any:
    """Code that copies a held tuple, and those in it."""
    place = cgutils.alloca_once(builder, there.type.pointee)
    builder.store(builder.load(there), place)
    for k, item in enumerate(held):
        if is_held(item):
            at = cgutils.gep_inbounds(builder, place, 0, k)
            builder.store(_copy(builder, item, builder.load(at)), at)
    return place


@lower_getattr_generic(HeldNamedTuple)
def _by_name(context, builder, held, place, attribute):
    return item_of(context, builder, held, place, held.fields.index(attribute))


@lower_builtin("static_getitem", _Held, types.IntegerLiteral)
def _by_number(context, builder, signature, arguments):
    place, number = arguments
    held = signature.args[0]
    return item_of(context, builder, held, place, number % len(held))


def hold(value: Any) -> Any:
    """`value`, in a kernel as a held tuple; what is not a tuple with arrays stays as it is.

    A held tuple lives until the function returns that calls this: pass it on, but not back.
    """
    return value


def at_hand(held: Any) -> Any:
    """A copy of a held tuple that nobody else knows: what is read of it stays in registers.

    For kernels with loops, before them; inside, LLVM cannot know that a pointer's items stay.
    """
    return held


# Not by_type: the memory must be that of the caller.
@type_callable(hold)
def _type_hold(context):
    return lambda value: held_type(value)


@lower_builtin(hold, types.Any)
def _lower_hold(context, builder, signature, arguments):
    return _hold(context, builder, signature.args[0], arguments[0])


@type_callable(at_hand)
def _type_at_hand(context):
    return lambda held: held


@lower_builtin(at_hand, types.Any)
def _lower_at_hand(context, builder, signature, arguments):
    held = signature.args[0]
    return _copy(builder, held, arguments[0]) if is_held(held) else arguments[0]


# --- threads take numbers and arrays only -------------------------------------------------------


def is_held(numba_type: Any) -> bool:
    """Whether a Numba type is that of a held tuple."""
    return isinstance(numba_type, _Held)


@intrinsic
def address(typing_context, held):
    """Where the items of a held tuple are, as a number."""

    def codegen(context, builder, signature, arguments):
        return builder.ptrtoint(arguments[0], ir.IntType(64))

    return types.intp(held), codegen


def at_address(held: _Held) -> Callable:
    """Make the function that takes such a number to the held tuple."""

    def codegen(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(held))

    def typed(typing_context, number):
        return held(types.intp), codegen

    return intrinsic(typed)
