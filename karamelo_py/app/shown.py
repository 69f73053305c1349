"""Columns by name, and pictures, as a simulation in Python shows them."""

from collections.abc import Callable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.script.errors import NoItem, nearest_few


class Columns(Mapping):
    """Columns by name: arrays of numbers."""

    def __init__(self, names: Callable[[], list[str]], column: Callable[[str], np.ndarray]):
        self._names = names
        self._column = column

    def __getitem__(self, name: str) -> np.ndarray:
        names = self._names()
        if name not in names:
            close = nearest_few(str(name), names)
            hint = f"did you mean {' or '.join(map(repr, close))}? " if close else ""
            raise NoItem(f"there is no '{name}'; {hint}there are {', '.join(names) or 'none'}")
        return self._column(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __repr__(self) -> str:
        return f"<columns {', '.join(self)}>"

    def to_pandas(self) -> Any:
        """The columns as a DataFrame."""
        import pandas

        return pandas.DataFrame(dict(self))


class ShownPicture:
    """A picture of the points, which a notebook shows."""

    def __init__(self, png: bytes):
        self.png = png

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, file: str | PathLike) -> None:
        """Write it to a file (PNG)."""
        Path(file).write_bytes(self.png)
