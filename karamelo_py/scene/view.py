"""Fields that hooks in Python read and change, and the rules of the views that show them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import DT, TIME
from karamelo_py.script.errors import NoItem, nearest


class Shown:
    """A field of a view: how it is read and, unless it is read-only, written."""

    def __init__(self, read: Callable):
        self.read = read
        self.write: Callable | None = None
        self.__doc__ = read.__doc__

    def writer(self, write: Callable) -> Callable:
        """Decorate the function that writes the field."""
        self.write = write
        return write

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, view: View | None, owner: type) -> Any:
        if view is None:
            return self
        if self.name not in view._handed_out:
            array = np.array(self.read(view))
            array.flags.writeable = self.write is not None
            view._handed_out[self.name] = array, array.copy() if self.write else array
        return view._handed_out[self.name][0]

    def __set__(self, view: View, value: Any) -> None:
        if self.write is None:
            raise AttributeError(f"{self.name} is read-only")
        now = self.__get__(view, type(view))
        value = np.asarray(value)
        if value.ndim and value.shape != now.shape:
            raise ValueError(f"{self.name} has the shape {now.shape}, not {value.shape}")
        now[...] = value


# Columns of dumps, by the letters around the direction, and the arrays that hold them.
_COLUMN = re.compile("([vfb]?)([xyz])(0?)")
_VECTORS = {
    ("", ""): "position",
    ("", "0"): "reference_position",
    ("v", ""): "velocity",
    ("f", ""): "force",
    ("b", ""): "force",
}


class View:
    """A view whose fields are the only attributes, and take only what fits."""

    _fields: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._handed_out: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._declared: dict[type, tuple[np.ndarray, np.ndarray]] = {}

    def _take_times(self, control: Any) -> None:
        self.dt = float(control.values[DT])
        self.kick = float(control.clock[0].kick)
        self.time = float(control.values[TIME])

    def write_back(self) -> None:
        """Write what a hook has changed; called when it returns."""
        for name, (now, before) in self._handed_out.items():
            write = getattr(type(self), name).write
            if write is not None and not np.array_equal(now, before, equal_nan=True):
                write(self, now)
        for kind, (now, before) in self._declared.items():
            if not np.array_equal(now, before, equal_nan=True):
                self._put(kind, now)

    def _get(self, kind: type) -> np.ndarray:
        """(n, components) of a declared field."""
        raise NotImplementedError

    def _put(self, kind: type, value: np.ndarray) -> None:
        """Write a declared field."""
        raise NotImplementedError

    def __setattr__(self, name: str, value: Any) -> None:
        known = name in self._fields or name.startswith("_")
        if not known and not isinstance(getattr(type(self), name, None), Shown):
            raise self._unknown(name)
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        raise self._unknown(name)

    def __getitem__(self, kind: type) -> np.ndarray:
        """(n, components) of a field that a part declares."""
        if not isinstance(kind, type):
            raise self._no_column(kind)
        if kind not in self._declared:
            array = np.array(self._get(kind))
            self._declared[kind] = array, array.copy()
        return self._declared[kind][0]

    def __setitem__(self, kind: type, value: Any) -> None:
        self[kind][...] = value

    def _no_column(self, name: Any) -> KeyError:
        """The error for a column in brackets, which says the attribute."""
        kind = type(self).__name__
        split = _COLUMN.fullmatch(str(name))
        attribute = _VECTORS.get((split[1], split[3])) if split else name
        if isinstance(getattr(type(self), str(attribute), None), Shown):
            place = f"[:, {'xyz'.index(split[2])}]" if split else ""
            return NoItem(f"{kind} has no ['{name}']: write .{attribute}{place}")
        names = ", ".join(n for n in dir(type(self)) if isinstance(getattr(type(self), n), Shown))
        return NoItem(f"{kind} has no ['{name}']; its attributes are {names}")

    def _unknown(self, name: str) -> AttributeError:
        names = [*self._fields, *(n for n in dir(type(self)) if not n.startswith("_"))]
        close = nearest(name, names)
        return AttributeError(
            f"{type(self).__name__} has no {name}; "
            + (f"did you mean {close}?" if close else f"it has {', '.join(sorted(names))}")
        )
