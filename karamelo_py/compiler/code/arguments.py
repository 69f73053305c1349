"""Arguments of kernels: words in memory, whose address is passed."""

import ctypes
import functools
import struct
import weakref
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import typeof, types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.trace.choices import tag_class
from karamelo_py.compiler.trace.held import HeldTuple, held_type, is_held
from karamelo_py.compiler.trace.session import session


class _Array(NamedTuple):
    """An array that is in use: NumPy does not resize arrays to which there are references."""

    alive: weakref.ref  # detects a reused id
    shape: tuple[int, ...]
    writeable: bool
    kind: int  # equal for arrays of the same type
    words: tuple[int, ...]  # words of the array as kernels get them


def _array(array: np.ndarray) -> _Array:
    number = id(array)
    entry = session.arrays.get(number)
    if (
        entry is None
        or entry.alive() is not array
        or entry.shape != array.shape
        or entry.writeable is not array.flags.writeable
    ):
        flags = array.flags
        kind = (
            array.dtype, array.ndim, flags.c_contiguous, flags.f_contiguous, flags.aligned,
            flags.writeable,
        )  # fmt: skip
        words = (array.ctypes.data, *array.shape, *array.strides)
        kinds = session.array_types
        kept = kinds[kind] if kind in kinds else kinds.setdefault(kind, next(session.numbers))
        alive = weakref.ref(array, functools.partial(_drop, number))
        entry = _Array(alive, array.shape, flags.writeable, kept, words)
        session.arrays[number] = entry
    return entry


def _drop(number: int, alive: weakref.ref) -> None:
    entry = session.arrays.get(number)
    if entry is not None and entry.alive is alive:
        session.arrays.pop(number, None)


def forget_array(array: np.ndarray) -> None:
    session.arrays.pop(id(array), None)


class Address(int):
    """Address of a Python function, which lives as long as this object."""

    callback: Any


class Plan(NamedTuple):
    text: struct.Struct
    tuples: tuple[tuple[int, int], ...]  # index of each nested tuple's word, and its start
    first: int  # start of the outermost tuple
    types: tuple[types.Type, ...]  # types of the arguments


class ArgumentBuffer:
    """Words of the arguments' tuples, inner ones first."""

    __slots__ = ("kinds", "words")

    def __init__(self, arguments: tuple):
        self.kinds: list = []  # kinds of the words, which determine the argument types
        self.words: list = []  # numbers in the tuples; 0 for a nested tuple
        words, _ = self._of(arguments)
        self.words += words

    def _of(self, items: tuple) -> tuple[list, bool]:
        words: list = []
        arrays = False
        kinds = self.kinds
        kinds.append(type(items))
        kinds.append(len(items))
        for item in items:
            kind = type(item)
            if issubclass(kind, np.ndarray):
                entry = _array(item)
                kinds.append(entry.kind)
                words += entry.words
                arrays = True
            elif kind is float or kind is int or kind is bool:
                kinds.append(kind)
                words.append(item)
            elif kind is Address:
                kinds.append(int)
                words.append(item)
            elif issubclass(kind, tuple):
                inner, has_arrays = self._of(item)
                if has_arrays:
                    self.words += inner
                    words.append(0)
                    arrays = True
                else:
                    words += inner
            elif issubclass(kind, np.generic):
                kinds.append(item.dtype)
                signed = item.view(f"i{item.itemsize}") if item.dtype.kind == "u" else item
                words.append(signed.item())  # same bits, but signed as words are
            else:  # nothing is written for None and classes
                kinds.append(item)
                words.append(0)
        return words, arrays

    def in_memory(self, plan: Plan, at: int | None = None) -> tuple[bytearray, int]:
        """Write the arguments for memory at `at`; return the bytes and the tuple's address."""
        memory = bytearray(max(plan.text.size, 1))
        if at is None:
            at = ctypes.addressof(ctypes.c_char.from_buffer(memory))
        words = self.words
        for k, begin in plan.tuples:
            words[k] = at + begin
        plan.text.pack_into(memory, 0, *words)
        return memory, at + plan.first


_CODES = {8: "b", 16: "h", 32: "i", 64: "q"}


def _aligned(at: int, to: int) -> int:
    return -(-at // to) * to


def _lay(kind: ir.Type, at: int, places: list[tuple[int, str]]) -> tuple[int, int]:
    if isinstance(kind, ir.ArrayType | ir.Aggregate):
        items = [kind.element] * kind.count if isinstance(kind, ir.ArrayType) else kind.elements
        to = max([_lay(item, 0, [])[1] for item in items], default=1)
        at = _aligned(at, to)
        for item in items:
            at, _ = _lay(item, at, places)
        return _aligned(at, to), to
    if isinstance(kind, ir.IntType):
        code = _CODES[kind.width]
    else:
        code = {ir.FloatType: "f", ir.DoubleType: "d"}.get(type(kind), "q")
    size = struct.calcsize(f"={code}")
    at = _aligned(at, size)
    places.append((at, code))
    return at + size, size


def plan_for(arguments: tuple) -> Plan:
    places: list[tuple[int, str]] = []
    tuples: list[tuple[int, int]] = []
    end = 0

    def lay(kind: Any) -> int:
        """Return the offset of a tuple in memory, after the tuples that it contains."""
        nonlocal end
        inner = [lay(item) if is_held(item) else None for item in kind]
        model = kind.register_type().pointee
        at = begin = _aligned(end, 16)
        for k, kind in enumerate(model.elements):
            if inner[k] is not None:
                tuples.append((len(places), inner[k]))
            at, _ = _lay(kind, at, places)
        end = at
        return begin

    outer = HeldTuple(tuple(held_type(typeof(argument)) for argument in arguments))
    first = lay(outer)
    text, at = "=", 0
    for offset, word in places:
        text += f"{offset - at}x{word}"
        at = offset + struct.calcsize(f"={word}")
    return Plan(struct.Struct(text), tuple(tuples), first, outer.types)


def reader(kind: types.Type) -> tuple[int, Callable[[bytearray], Any]]:
    places: list[tuple[int, str]] = []
    size, _ = _lay(llvm.memory_type(kind), 0, places)

    def made(kind: types.Type, numbers: Iterator) -> Any:
        if isinstance(kind, types.BaseTuple):
            items = [made(item, numbers) for item in kind]
            named = tag_class(kind)
            return named(*items) if named else tuple(items)
        number = next(numbers)
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, types.Integer) and not kind.signed:
            return number % 2**kind.bitwidth
        return bool(number) if isinstance(kind, types.Boolean) else number

    def read(memory: bytearray) -> Any:
        numbers = (struct.unpack_from(f"={text}", memory, offset)[0] for offset, text in places)
        return made(kind, numbers)

    return max(size, 1), read
