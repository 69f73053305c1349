"""States of points for a page, thinned, in single precision."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

PAGE = Path(__file__).with_name("run.html")
POINTS = 1_000_000  # approximate number of points in a frame
BYTES = 1 << 29  # maximum size of all frames
COUNT = 400
SEEN = 1.0  # seconds for which a page's request counts


class Frame(NamedTuple):
    step: int
    time: float
    column: str
    numbers: np.ndarray  # (d + 1, n) positions and the column
    of: int  # number of points before the frame was thinned

    @classmethod
    def of_columns(
        cls, step: int, time: float, axes: str, column: str, *, read: Callable[[str], np.ndarray]
    ) -> Frame:
        columns = [np.asarray(read(name)) for name in (*axes, column)]
        count = len(columns[0])
        if count > POINTS:
            some = few_of(*(np.asarray(read(name)).astype(int) for name in ("id", "type")))
            columns = [each[some] for each in columns]
        return cls(step, time, column, np.array(columns, np.float32), count)


def few_of(ids: np.ndarray, solids: np.ndarray) -> np.ndarray:
    """Return a mask of about `POINTS` points, the same in all states. Small solids are complete."""
    counts = np.bincount(solids)
    least = np.minimum(counts, POINTS // (10 * np.count_nonzero(counts)))
    small = counts * POINTS < least * len(ids)
    fraction = least / np.maximum(counts, 1)
    fraction[~small] = (POINTS - least[small].sum()) / counts[~small].sum()
    chance = np.random.default_rng(0).random(ids.max() + 1, np.float32)
    return chance[ids] < fraction[solids]


class KeptFrames:
    """States by number. If there are too many states, every second one is dropped."""

    def __init__(self) -> None:
        self._kept: dict[int, Frame] = {}
        self._next, self._every = 0, 1
        self._new: deque[tuple[int, float]] = deque()  # numbers of new states, and times of arrival
        self._lock = threading.Lock()

    def add(self, frame: Frame) -> None:
        with self._lock:
            now = time.perf_counter()
            self._kept[self._next] = frame
            self._new.append((self._next, now))
            self._next += 1
            while self._new[0][1] < now - SEEN:
                self._new.popleft()
            size = sum(each.numbers.nbytes for each in self._kept.values())
            stay = sum(not k % self._every for k in self._kept)
            self._every *= 2 if stay > COUNT or size > BYTES else 1
            for number in [k for k in self._kept if k % self._every and k < self._new[0][0]]:
                del self._kept[number]

    def replace_last(self, take: Callable[[], Frame]) -> None:
        with self._lock:
            self._kept[self._next - 1] = take()
            self._new[-1] = (self._next - 1, time.perf_counter())

    def listed(self) -> list[list]:
        with self._lock:
            return [[k, f.step, plain(f.time), f.column, f.of] for k, f in self._kept.items()]

    def answer(self, words: Mapping[str, str]) -> bytes | None:
        with self._lock:
            frame = self._kept.get(number_in(words))
        return None if frame is None else frame.numbers.tobytes()


def number_in(words: Mapping[str, str]) -> int:
    text = words.get("k", "")
    return int(text) if text.isdecimal() and len(text) < 19 else -1


def plain(value: object) -> object:
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value
