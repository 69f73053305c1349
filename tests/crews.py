"""Processes that share a scene, as threads of one: what MPI does, without it."""

import copy
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from karamelo_py.run.mpi.crew import Crew
from karamelo_py.run.mpi.load import Work

PATIENCE = 60  # seconds that one waits for the others


class Threads(Crew):
    """One of several threads, each with a scene of its own, which talk as ranks do."""

    def __init__(self, rank: int, size: int, barrier: threading.Barrier, board: list):
        self.rank, self.size = rank, size
        self._barrier, self._board = barrier, board

    def everyone(self, thing: Any) -> list:
        self._board[self.rank] = thing
        self._barrier.wait(PATIENCE)
        found = copy.deepcopy(self._board)
        self._barrier.wait(PATIENCE)
        return found

    def meet(self, word: int, patience: float = PATIENCE) -> np.ndarray:
        return np.array(self.everyone(word))

    def told(self, thing: Any = None) -> Any:
        return self.everyone(thing)[0]

    def gathered(self, thing: Any) -> list | None:
        found = self.everyone(thing)
        return found if self.leads else None

    def lined_up(self, own: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        assert own.flags.c_contiguous  # which kernels and MPI rely on
        found = self.everyone(own)
        if self.leads:
            assert [len(one) for one in found] == list(counts)
            out[:] = np.concatenate(found)

    def handed_out(self, things: Sequence | None) -> Any:
        return self.everyone(things)[0][self.rank]

    def traded(self, things: dict[int, Any]) -> dict[int, Any]:
        of_all = self.everyone(things)
        return {rank: of_all[rank][self.rank] for rank in things}

    def swapped(self, numbers: np.ndarray) -> np.ndarray:
        return np.array([of[self.rank] for of in self.everyone(numbers)])

    def added(self, array: np.ndarray) -> np.ndarray:
        return sum(self.everyone(array))

    def largest(self, array: np.ndarray) -> np.ndarray:
        array[...] = np.max(self.everyone(array), axis=0)
        return array

    def linked(self, given: list, taken: list) -> Any:
        return given, taken

    def start(self, link: Any) -> None:
        pass

    def unlink(self, link: Any) -> None:
        pass

    def finish(self, link: Any) -> None:
        given, taken = link
        of_all = self.everyone(given)
        for rank in range(self.size):  # what nobody takes would be taken for another message
            mine = [array for to, array in of_all[rank] if to == self.rank]
            those = [array for of, array in taken if of == rank]
            for array, found in zip(those, mine, strict=True):
                array[...] = found

    def abandon(self, status: int = 1) -> None:
        self._barrier.abort()


def learn_at_random(work: Work, _: Crew) -> None:
    """In the place of measured costs, others each time: tiles go to and fro, alike in all runs."""
    work.looks = getattr(work, "looks", 0) + 1
    work.costs = np.random.default_rng(work.looks).uniform(size=len(work.costs)) ** 4


def together(size: int, act: Callable[[Crew], Any]) -> list:
    """What `act` returns to each of so many; the first error of any is raised."""
    barrier, board = threading.Barrier(size), [None] * size
    found: list = [None] * size
    errors: list[BaseException] = []

    def run(rank: int) -> None:
        try:
            found[rank] = act(Threads(rank, size, barrier, board))
        except BaseException as error:
            errors.append(error)
            barrier.abort()

    threads = [
        threading.Thread(target=run, args=(rank,), name=f"rank {rank}") for rank in range(size)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for error in errors:
        if not isinstance(error, threading.BrokenBarrierError):
            raise error
    if errors:
        raise errors[0]
    return found
