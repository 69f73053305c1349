"""Declared fields: data of points and nodes, declared by the part that owns it.

A field is a class derived from `Field`, with one member, its array. Kernels look it up by class;
its attributes are used by lowering, sorting, restarts, dumps and `karamelo-py check`::

    class Dose(Field):
        \"\"\"Radiation that a point has taken up, in gray.\"\"\"

        columns = ("dose",)

shape
    number of components, a function of the kinematics (`scalar` by default, `vector`, `tensor`,
    `planar`);
kept
    whether values persist between steps and runs (default `True`);
start
    initial value: a number (default 0), or a function of the kinematics, a number per component;
summed
    whether points add to this nodal field (default `False`), tile by tile
    (:mod:`karamelo_py.kernels.sums`);
columns
    names of the components in dumps, the log, plots and pictures.

A part names its fields in ``point_fields`` or ``node_fields``. Point arrays have shape (components,
points), node arrays (nodes, components).
"""

import ctypes
import re
from collections.abc import Iterable
from math import nan, prod
from typing import Any, NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.llvm import I64
from karamelo_py.compiler.trace.primitives import implements, index, real, where
from karamelo_py.compiler.trace.values import intrinsic
from karamelo_py.compiler.tuples import count_in, flat, nested_as

LINE = 64  # bytes per cache line


def scalar(kin: Any) -> int:
    return 1


def pair(kin: Any) -> int:
    return 2


def triple(kin: Any) -> int:
    return 3


def vector(kin: Any) -> int:
    return kin.dimension


def unknowns(kin: Any) -> int:
    return len(kin.Unknown._fields)


def tensor(kin: Any) -> int:
    """Return the number of components, including hoop components."""
    return kin.tensor_size


def planar(kin: Any) -> int:
    return kin.dimension**2


def numbers(count: int, per_direction: int = 0) -> Any:
    return staticmethod(lambda kin: count + per_direction * kin.dimension)


class Field(NamedTuple):
    """Base of fields: numbers of each point or node."""

    array: Any

    shape = scalar
    kept = True
    family = ""  # a field continues the values of another one of its family in an earlier run
    start = 0.0
    columns = ()
    filled = False  # nodes: four numbers from a multiple of four on are loaded and stored at most

    @staticmethod
    def shown(values: np.ndarray, table: Any) -> np.ndarray:
        """Return the values (n, components) of the columns, from values in a table of points."""
        return values

    @staticmethod
    def position(kin: Any) -> int | None:
        """Return the first component that is a position, which periodic directions shift."""
        return None

    @staticmethod
    def needed(tag: Any) -> bool:
        """Return True if points of a law, or nodes of a basis, have this field."""
        return True


class StepField(Field):
    """A field that does not outlive a step."""

    kept = False


class SummedField(StepField):
    """A nodal field that points add to in a step."""

    summed = True


class FieldMappedAgain(SummedField):
    """A nodal field of sums over moved points, made with the momentum that is mapped again."""


def name_of(kind: type) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind.__name__).lower()


def fields_of(owner: Any, attribute: str) -> tuple[type[Field], ...]:
    return getattr(owner, attribute, ())


def declared(owners: Iterable[Any], attribute: str) -> tuple[type[Field], ...]:
    return tuple(dict.fromkeys(kind for owner in owners for kind in fields_of(owner, attribute)))


def rows_of_points(
    shape: tuple[int, ...], dtype: type, room: np.ndarray | None = None
) -> np.ndarray:
    """Make an array (..., n) for points: rows start at cache lines, an odd number of lines apart.

    Then no vector load crosses a cache line, and the dozens of rows that a pass reads in parallel
    are in different cache sets (contiguous rows would be in the same set for n = 512 or 512 000).
    Rows always have gaps: an array without gaps has another type, so kernels would be compiled
    again. Memory `room` (k,) is used if it is long enough (`length_of_rows`).
    """
    if room is None:
        room = np.empty(length_of_rows(shape, dtype), dtype)
    *rows, count = shape
    stride = _distance_of_rows(count, dtype)
    first = _first_of_line(room)
    return room[first : first + prod(rows) * stride].reshape(*rows, stride)[..., :count]


def _first_of_line(room: np.ndarray) -> int:
    return -room.ctypes.data % LINE // room.itemsize


def length_of_rows(shape: tuple[int, ...], dtype: type) -> int:
    *rows, count = shape
    return prod(rows) * _distance_of_rows(count, dtype) + LINE // np.dtype(dtype).itemsize


def _distance_of_rows(count: int, dtype: type) -> int:
    line = LINE // np.dtype(dtype).itemsize
    return (count // line + 1 | 1) * line


def as_rows_of_points(array: np.ndarray) -> np.ndarray:
    array = np.asarray(array)
    if array.ndim == 1 or not array.flags.c_contiguous:
        return array
    rows = rows_of_points(array.shape, array.dtype)
    rows[...] = array
    return rows


def some_points(array: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Select from an array (..., n); ``np.take`` would first copy arrays with gaps between rows."""
    return np.ascontiguousarray(array[..., points])


def at_points(kind: type[Field], kin: Any, count: int, real: type) -> Any:
    """Make a field (components, count) with initial values."""
    array = rows_of_points((kind.shape(kin), count), real)
    array[:] = _start(kind, kin, real)[:, None]
    return kind(array)


def _start(kind: type[Field], kin: Any, real: type) -> np.ndarray:
    start = kind.start
    return np.array(start(kin) if callable(start) else [start], real)


def records(count: int, width: int, real: type) -> np.ndarray:
    """Return zeros (count, width); unused pages take no memory, and rows cross no cache lines."""
    room = np.zeros(count * width + LINE // np.dtype(real).itemsize, real)
    first = _first_of_line(room)
    return room[first : first + count * width].reshape(count, width)


def at_nodes(kind: type[Field], kin: Any, count: int, real: type) -> NamedTuple:
    """Make a field (count, components) with initial values."""
    width = kind.shape(kin)
    # Three numbers are loaded and stored as four, which fill a register.
    array = records(count, width if width < 3 else -(-(width + (not kind.filled)) // 4) * 4, real)
    if (start := _start(kind, kin, real)).any():
        array[:, :width] = start
    return kind(array)


def field(fields: tuple, kind: type) -> Any:
    """Return the array of the field of class `kind`, or of a derived class, or None."""
    for one in fields:
        if kind is not None and isinstance(one, kind):
            return one.array
    return None


def load(array, p, template):
    """Load as many components of point `p` as `template` has; () without an array."""
    if array is None:
        return ()
    if type(template) is tuple:
        return tuple([array[k, p] for k in range(len(template))])
    return nested_as(template, tuple([array[k, p] for k in range(count_in(template))]))


def store(array, p, values):
    store_from(array, p, 0, values)


def store_from(array, p, first, values):
    if array is not None:
        values = flat(values)
        for k in range(first, len(values)):
            array[k, p] = values[k]


def increase(array, p, values):
    if array is not None:
        for k, value in enumerate(values):
            array[k, p] += value


def forget(array, p, which):
    if array is not None:
        for k, chosen in enumerate(which):
            value = array[k, p]
            array[k, p] = where(chosen > 0, real(nan, value), value)


def load_vector(kin, array, p):
    return kin.Vector._make([array[k, p] for k in range(kin.dimension)])


def addresses_of_rows(arrays: Iterable[np.ndarray]) -> np.ndarray:
    """Return address and item size in bytes (m, 2), int64, of each row of arrays (..., n).

    Empty arrays have no rows. Addresses are valid while arrays live and are not resized. Raises
    ValueError if items are not contiguous, or do not have 4 or 8 bytes.
    """
    rows: list[tuple[int, int]] = []
    for array in arrays:
        if not array.size:
            continue
        if array.strides[-1] != array.itemsize:
            raise ValueError("items of a row do not lie one after another")
        if array.itemsize not in (4, 8):
            raise ValueError(f"items of {array.itemsize} bytes, not of 4 or 8")
        addresses = [array.ctypes.data]
        for count, stride in zip(array.shape[:-1], array.strides[:-1], strict=True):
            addresses = [address + k * stride for address in addresses for k in range(count)]
        rows += [(address, array.itemsize) for address in addresses]
    return np.array(rows, np.int64).reshape(-1, 2)


def _row(address: int, template: Any, count: int) -> np.ndarray:
    """View `count` items at an address as integers like `template`."""
    memory = (ctypes.c_char * int(count * template.itemsize)).from_address(int(address))
    return np.frombuffer(memory, template.dtype)


@implements(_row)
@intrinsic
def _row_in_kernels(address, template, count):
    row = types.Array(template, 1, "C")

    def codegen(builder, pointer, _, size):
        data = builder.inttoptr(pointer, llvm.memory_type(template).as_pointer())
        return llvm.make_array(builder, row, data, [size], [I64(template.bitwidth // 8)])

    return row(types.int64, template, types.int64), codegen


def pick_items(
    address: int, template: Any, order: np.ndarray, room: np.ndarray, c: int, begin: int, end: int
) -> None:
    """Set ``room[c, p]`` to item ``order[p]`` of a row of integers, for p in [begin, end)."""
    row = _row(address, template, order.size)
    for p in range(begin, end):
        room[c, p] = row[index(order[p])]


def put_items(address: int, template: Any, room: np.ndarray, c: int, begin: int, end: int) -> None:
    """Set item p of a row to ``room[c, p]``, for p in [begin, end)."""
    row = _row(address, template, end)
    for p in range(begin, end):
        row[index(p)] = room[c, p]
