"""States of points that a page has at hand: thinned, in single precision, as many as fit."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

PAGE = Path(__file__).with_name("run.html")
POINTS = 200_000  # of a frame at most
BYTES = 1 << 28  # of all frames
COUNT = 400


class Frame(NamedTuple):
    """Points at one moment."""

    step: int
    time: float
    column: str
    numbers: np.ndarray  # (d + 1, n) positions and the column
    of: int  # points before they were thinned

    @classmethod
    def of_columns(
        cls, step: int, time: float, axes: str, column: str, read: Callable[[str], np.ndarray]
    ) -> Frame:
        """Make a frame of columns that ``read(name)`` gives, (n,) each."""
        columns = [np.asarray(read(name)) for name in (*axes, column)]
        count = len(columns[0])
        thin = slice(None, None, -(-count // POINTS) or 1)
        return cls(
            step, time, column, np.array([each[thin] for each in columns], np.float32), count
        )


class KeptFrames:
    """States of points by number; where there are too many, every second goes."""

    def __init__(self) -> None:
        self._kept: dict[int, Frame] = {}
        self._next = 0
        self._lock = threading.Lock()

    def add(self, frame: Frame) -> None:
        """Keep a frame."""
        with self._lock:
            self._kept[self._next] = frame
            self._next += 1
            size = sum(each.numbers.nbytes for each in self._kept.values())
            if len(self._kept) > COUNT or size > BYTES:
                for number in [*self._kept][1:-1:2]:
                    del self._kept[number]

    def drop_last(self) -> None:
        """Forget the newest frame."""
        with self._lock:
            self._kept.popitem()

    def listed(self) -> list[list]:
        """List number, step, time, column and count of each frame."""
        with self._lock:
            return [[k, f.step, plain(f.time), f.column, f.of] for k, f in self._kept.items()]

    def answer(self, words: Mapping[str, str]) -> bytes | None:
        """Give the numbers of a frame, position by position, then the column."""
        with self._lock:
            frame = self._kept.get(number_in(words))
        return None if frame is None else frame.numbers.tobytes()


def number_in(words: Mapping[str, str]) -> int:
    """Read the number of a frame; -1 where there is none."""
    text = words.get("k", "")
    return int(text) if text.isdecimal() else -1


def plain(value: Any) -> Any:
    """Give a number that JSON has; others as they are."""
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value
