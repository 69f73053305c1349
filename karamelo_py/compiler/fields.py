"""Declared fields: what points and nodes carry, each declared once, by the part that owns it.

A field is a NamedTuple class with one member, its array. The class is what kernels ask for it by,
and its attributes are all that lowering, sorting, restarts, dumps and `karamelo-py check` need::

    class Dose(Field):
        \"\"\"Radiation that a point has taken up, in gray.\"\"\"

        columns = ("dose",)

shape
    function of the kinematics: the number of components (`scalar` by default, `vector`, `tensor`,
    `planar`);
kept
    whether it outlives a step (the default): then it is carried from run to run;
start
    what it starts from: a number (0 by default), or a function of the kinematics that returns one
    number for each component;
summed
    whether points give to this field of the nodes (`False` by default): what they give is summed
    tile by tile (:mod:`karamelo_py.kernels.p2g`);
columns
    names under which dumps, the log, plots and pictures show its components.

A part names its fields in ``point_fields`` or ``node_fields``. Arrays of points have the shape
(components, points), those of nodes (nodes, components).
"""

import ctypes
import re
from collections.abc import Iterable
from math import nan, prod
from typing import Any, NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.code import I64
from karamelo_py.compiler.compile import implements, index, real, where
from karamelo_py.compiler.tuples import count_in, flat, nested_as
from karamelo_py.compiler.values import intrinsic

LINE = 64  # bytes that caches get at once


def scalar(kin: Any) -> int:
    """One number."""
    return 1


def pair(kin: Any) -> int:
    """Two numbers."""
    return 2


def triple(kin: Any) -> int:
    """Three numbers."""
    return 3


def vector(kin: Any) -> int:
    """The components of a vector."""
    return kin.dimension


def tensor(kin: Any) -> int:
    """The components of a tensor, the one around the axis among them."""
    return kin.tensor_size


def planar(kin: Any) -> int:
    """The components of a plain matrix of two vectors."""
    return kin.dimension**2


class Field(NamedTuple):
    """Numbers of each point or node: the base of fields."""

    array: Any

    shape = scalar
    is_followed = True  # its functions of the kinematics: the key of a kernel has the class


class StepField(Field):
    """One that does not outlive a step."""

    kept = False


class SummedField(StepField):
    """One of nodes, to which points give in a step."""

    summed = True


def name_of(kind: type) -> str:
    """The name of a field: that of its class, in small letters."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind.__name__).lower()


def is_kept(kind: type) -> bool:
    """Check that a field outlives a step."""
    return getattr(kind, "kept", True)


def columns_of(kind: type) -> tuple[str, ...]:
    """Names under which the components of a field are shown, perhaps none."""
    return getattr(kind, "columns", ())


def declared(owners: Iterable[Any], attribute: str) -> tuple[type, ...]:
    """The fields that the `owners` declare in ``point_fields`` or ``node_fields``, each once."""
    return tuple(dict.fromkeys(kind for owner in owners for kind in getattr(owner, attribute, ())))


def rows_of_points(
    shape: tuple[int, ...], dtype: type, room: np.ndarray | None = None
) -> np.ndarray:
    """An array (..., n) for points: rows begin where lines of caches do, an odd number of them on.

    Nothing that is loaded at once lies in two lines then, and a visit, which goes along dozens of
    rows side by side, has them in different sets of a cache for any number of points; with rows one
    after another all would be in one set for 512 points, say, or 512 000. No row ends where the
    next one begins: rows without gaps are of another type, for which loops are compiled anew.

    `room` (k,) is used where it is long enough: `length_of_rows`.
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
    """Of the memory that `rows_of_points` of this shape takes, in numbers."""
    *rows, count = shape
    return prod(rows) * _distance_of_rows(count, dtype) + LINE // np.dtype(dtype).itemsize


def _distance_of_rows(count: int, dtype: type) -> int:
    line = LINE // np.dtype(dtype).itemsize
    return (count // line + 1 | 1) * line


def as_rows_of_points(array: np.ndarray) -> np.ndarray:
    """`array`, which may have been read or received, as `rows_of_points`."""
    array = np.asarray(array)
    if array.ndim == 1 or not array.flags.c_contiguous:
        return array
    found = rows_of_points(array.shape, array.dtype)
    found[...] = array
    return found


def some_points(array: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The numbers (..., k) of some points, from those of all (..., n).

    Of arrays with gaps between their rows ``np.take`` makes a copy first, of all points.
    """
    return np.ascontiguousarray(array[..., points])


def at_points(kind: type, kin: Any, count: int, real: type) -> NamedTuple:
    """The field of `count` points, (components, count), as it starts."""
    array = rows_of_points((kind.shape(kin), count), real)
    array[:] = _start(kind, kin, real)[:, None]
    return kind(array)


def _start(kind: type, kin: Any, real: type) -> np.ndarray:
    """The number, or those of all components, that a field starts from."""
    start = getattr(kind, "start", 0.0)
    return np.array(start(kin) if callable(start) else [start], real)


def records(count: int, width: int, real: type) -> np.ndarray:
    """(count, width) zeros of nodes; untouched pages cost no memory, no record is in two lines."""
    room = np.zeros(count * width + LINE // np.dtype(real).itemsize, real)
    first = _first_of_line(room)
    return room[first : first + count * width].reshape(count, width)


def at_nodes(kind: type, kin: Any, count: int, real: type) -> NamedTuple:
    """The field of `count` nodes, (count, components), as it starts."""
    width = kind.shape(kin)
    # Three numbers, wherever they begin, are loaded and stored as four, the width of a register.
    array = records(count, width if width < 3 else -(-(width + 1) // 4) * 4, real)
    if (start := _start(kind, kin, real)).any():
        array[:, :width] = start
    return kind(array)


def field(fields: tuple, kind: type) -> Any:
    """The array of the field of this class, or None where the scene does not have it."""
    for one in fields:
        if type(one) is kind:
            return one.array
    return None


# --- rows of arrays that may be absent --------------------------------------------------------


def load(array, p, like):
    """Components 0, 1, ... of point `p`, as `like` has them; none where there is no array."""
    if array is None:
        return ()
    if type(like) is tuple:
        return tuple([array[k, p] for k in range(len(like))])
    return nested_as(like, tuple([array[k, p] for k in range(count_in(like))]))


def store(array, p, values):
    """Components 0, 1, ... of point `p` become `values`; nothing where there is no array."""
    store_from(array, p, 0, values)


def store_from(array, p, first, values):
    """Components from `first` on of point `p` become those of `values`; earlier ones stay."""
    if array is not None:
        values = flat(values)
        for k in range(first, len(values)):
            array[k, p] = values[k]


def increase(array, p, values):
    """Add `values` to components 0, 1, ... of point `p`; nothing where there is no array."""
    if array is not None:
        for k, value in enumerate(values):
            array[k, p] += value


def forget(array, p, which):
    """Make the components of point `p` unknown (NaN) that are above 0 in `which`."""
    if array is not None:
        for k, chosen in enumerate(which):
            value = array[k, p]
            array[k, p] = where(chosen > 0, real(nan, value), value)


def load_vector(kin, array, p):
    """The first components of point `p` as a vector."""
    return kin.Vector._make([array[k, p] for k in range(kin.dimension)])


# --- rows by where they lie: what goes through them knows no number and types of arrays -----------


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
    row = _row(address, like, order.size)
    for p in range(begin, end):
        room[c, p] = row[index(order[p])]


def put_items(address: int, like: Any, room: np.ndarray, c: int, begin: int, end: int) -> None:
    """Item p of such a row becomes ``room[c, p]``, from `begin` to `end`."""
    row = _row(address, like, end)
    for p in range(begin, end):
        row[index(p)] = room[c, p]
