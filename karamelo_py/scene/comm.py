"""Signals, and the communicator of a single process (see also :mod:`karamelo_py.run.mpi.comm`)."""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

import numpy as np

from karamelo_py.script.errors import ScriptError

T = TypeVar("T")
# SIGINT: Ctrl-C; SIGTERM: batch systems and kill; SIGHUP: closed terminals (not on Windows).
NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
ENDING = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]


@contextmanager
def handled_signals(
    handler: Callable[[int, FrameType | None], None], numbers: Sequence[int] = ENDING
) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in numbers}
    # Signals that the process ignores remain ignored, as with nohup.
    heeded = [number for number, now in before.items() if now != signal.SIG_IGN]
    for number in heeded:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])


class SerialComm:
    """Communicator of one process; methods are collective."""

    rank, size = 0, 1
    beside = 1  # number of processes on the same cores, including this one
    on_machine = 1
    waited = 0.0  # seconds spent waiting for other processes
    failed_within = False
    at_end = False  # True if all processes have reached the same end of the run

    @property
    def leads(self) -> bool:
        return self.rank == 0

    @property
    def share_here(self) -> float:
        return self.on_machine / self.size

    @contextmanager
    def joint(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.failed_within = True
            raise

    def barrier(self) -> None:
        pass

    def end_together(self) -> None:
        self.barrier()
        self.at_end = True

    def agree(self, word: int, patience: float = np.inf) -> np.ndarray | None:
        """Return the words (size,) of all processes.

        The result is None if a process is late by more than `patience` seconds.
        """
        return np.array([word])

    def bcast(self, thing: T | None = None) -> Any:
        return thing

    def gather(self, thing: T) -> list[T] | None:
        return [thing]

    def allgather(self, thing: T) -> list[T]:
        return [thing]

    def everyone(self, request: str, thing: T) -> list[T]:
        """Gather the objects of all processes; raise ScriptError if their `request` differs."""
        asked, answers = zip(*self.allgather((request, thing)), strict=True)
        if other := next((one for one in asked if one != asked[0]), None):
            raise ScriptError(
                f"a function in Python reaches {asked[0]} on one process, and {other} on another",
                hint="all processes have to call points.total(terms) and nodes.total(terms), "
                "even without points",
            )
        return list(answers)

    def at_first(self, make: Callable[[list[T]], list], thing: T) -> Any:
        gathered = self.gather(thing)
        return self.scatter(None if gathered is None else make(gathered))

    def gather_rows(self, rows: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        """Concatenate the rows of all processes into `out` of rank 0."""
        assert out is not None
        out[:] = rows

    def scatter(self, things: Sequence | None) -> Any:
        assert things is not None
        return things[0]

    def exchange(self, things: dict[int, T]) -> dict[int, T]:
        return {}

    def alltoall(self, numbers: np.ndarray) -> np.ndarray:
        return numbers

    def allreduce(self, array: np.ndarray) -> np.ndarray:
        """Sum integers over processes; the result is exact in any order."""
        return array

    def allreduce_max(self, array: np.ndarray) -> np.ndarray:
        return array

    def in_turn(self, act: Callable[[], None]) -> None:
        act()
