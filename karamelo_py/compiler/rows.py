"""Rows of arrays by where they lie: what goes through them knows no number and types of arrays."""

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.code import I64
from karamelo_py.compiler.compile import implements, index
from karamelo_py.compiler.values import intrinsic


def addresses_of_rows(arrays: Iterable[np.ndarray]) -> np.ndarray:
    """(m, 2) int64: the address of each row of some arrays (..., n), and the bytes of an item.

    Arrays of nothing have none. Addresses are good as long as the arrays live and are not resized.

    Raises
    ------
    ValueError
        If items do not lie one after another, or do not have 4 or 8 bytes.
    """
    found: list[tuple[int, int]] = []
    for array in arrays:
        if not array.size:
            continue
        if array.strides[-1] != array.itemsize:
            raise ValueError("items of a row do not lie one after another")
        if array.itemsize not in (4, 8):
            raise ValueError(f"items of {array.itemsize} bytes, not of 4 or 8")
        places = [array.ctypes.data]
        for count, stride in zip(array.shape[:-1], array.strides[:-1], strict=True):
            places = [place + k * stride for place in places for k in range(count)]
        found += [(place, array.itemsize) for place in places]
    return np.array(found, np.int64).reshape(-1, 2)


def _row(address: int, like: Any, count: int) -> np.ndarray:
    """The `count` items from an address on, whole numbers of the type of `like`."""
    memory = (ctypes.c_char * int(count * like.itemsize)).from_address(int(address))
    return np.frombuffer(memory, like.dtype)


@implements(_row)
@intrinsic
def _row_in_kernels(address, like, count):
    row = types.Array(like, 1, "C")

    def codegen(builder, place, _, size):
        data = builder.inttoptr(place, code.memory_type(like).as_pointer())
        return code.make_array(builder, row, data, [size], [I64(like.bitwidth // 8)])

    return row(types.int64, like, types.int64), codegen


def pick_items(
    address: int, like: Any, order: np.ndarray, room: np.ndarray, c: int, begin: int, end: int
) -> None:
    """``room[c, p]`` becomes item ``order[p]`` of a row, from `begin` to `end`.

    The row has whole numbers of the type of `like`.
    """
    room[c, begin:end] = _row(address, like, order.size)[order[begin:end]]


@implements(pick_items)
def _pick(address, like, order, room, c, begin, end):
    row = _row(address, like, order.size)
    for p in range(begin, end):
        room[c, p] = row[index(order[p])]


def put_items(address: int, like: Any, room: np.ndarray, c: int, begin: int, end: int) -> None:
    """Item p of such a row becomes ``room[c, p]``, from `begin` to `end`."""
    _row(address, like, end)[begin:end] = room[c, begin:end]


@implements(put_items)
def _put(address, like, room, c, begin, end):
    row = _row(address, like, end)
    for p in range(begin, end):
        row[index(p)] = room[c, p]
