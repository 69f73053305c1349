"""Communication between processes; here for one. :mod:`karamelo_py.run.mpi.comm` has several."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from karamelo_py.script.errors import ScriptError


class SerialComm:
    """The interface of several processes, for one that has the whole scene.

    All processes execute the same Python statements, and call these methods collectively.
    """

    rank, size = 0, 1
    beside = 1  # processes on the cores of this one, including it
    on_machine = 1  # processes on this machine
    waited = 0.0  # seconds in steps spent waiting for others
    failed_within = False  # an error occurred inside a collective operation
    at_end = False  # all processes have reached the same final end of the run

    @property
    def leads(self) -> bool:
        """Tell whether this is rank 0, which writes."""
        return self.rank == 0

    @property
    def share_here(self) -> float:
        """Fraction of the scene on this machine."""
        return self.on_machine / self.size

    @contextmanager
    def joint(self) -> Iterator[None]:
        """Record an error in a collective operation, in which the others would wait forever."""
        try:
            yield
        except BaseException:
            self.failed_within = True
            raise

    def barrier(self) -> None:
        """Wait for all processes."""

    def end_together(self) -> None:
        """Wait for all processes at the end of a run, which each reports in the same words."""
        self.barrier()
        self.at_end = True

    def agree(self, word: int, patience: float = np.inf) -> np.ndarray | None:
        """Gather a word from each process (size,); None if one is late by `patience` seconds."""
        return np.array([word])

    def bcast(self, thing: Any = None) -> Any:
        """Send an object of rank 0 to all."""
        return thing

    def gather(self, thing: Any) -> list | None:
        """Gather an object from each process at rank 0; None elsewhere."""
        return [thing]

    def allgather(self, thing: Any) -> list:
        """Gather an object from each process at all."""
        return [thing]

    def everyone(self, what: str, thing: Any) -> list:
        """Gather an object from each process; all must pass the same `what`, else an error."""
        asked, found = zip(*self.allgather((what, thing)), strict=True)
        if other := next((one for one in asked if one != asked[0]), None):
            raise ScriptError(
                f"a function in Python comes to {asked[0]} on one process, and to {other} on "
                "another",
                hint="points.total(terms) and nodes.total(terms) have to be asked for by all "
                "processes, those without points too",
            )
        return list(found)

    def at_first(self, make: Callable[[list], list], thing: Any) -> Any:
        """Gather objects at rank 0, make an answer for each, and scatter the answers."""
        found = self.gather(thing)
        return self.scatter(None if found is None else make(found))

    def gather_rows(self, own: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        """Concatenate the numbers of all processes into `out` of rank 0."""
        assert out is not None
        out[:] = own

    def scatter(self, things: Sequence | None) -> Any:
        """Send an object of rank 0 to each process."""
        assert things is not None
        return things[0]

    def exchange(self, things: dict[int, Any]) -> dict[int, Any]:
        """Exchange objects with some processes, by rank; both sides must name each other."""
        return {}

    def alltoall(self, numbers: np.ndarray) -> np.ndarray:
        """Exchange a number (size,) with each process."""
        return numbers

    def allreduce(self, array: np.ndarray) -> np.ndarray:
        """Sum integers over all processes; for integers the order does not matter."""
        return array

    def allreduce_max(self, array: np.ndarray) -> np.ndarray:
        """Take the maximum of each number over all processes, in place."""
        return array

    def in_turn(self, act: Callable[[], None]) -> None:
        """Let rank 0 act, then all others, which find what it has made."""
        act()
