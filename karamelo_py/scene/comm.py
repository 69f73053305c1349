"""The processes that share a scene: here the only one; :mod:`karamelo_py.run.mpi.comm` has more."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from karamelo_py.script.errors import ScriptError


class SerialComm:
    """One process that has the whole scene, with the methods of several.

    All processes carry out the same statements of Python, and call these methods together.
    """

    rank, size = 0, 1
    beside = 1  # so many have the same cores as this one, itself among them
    on_machine = 1  # so many share the memory of its machine
    waited = 0.0  # seconds, for others or for what they sent, in steps
    failed_within = False  # in the midst of what all do together
    at_end = False  # all have come to the same end of a run that does not go on

    @property
    def leads(self) -> bool:
        """Tell whether this is the first process, which writes."""
        return self.rank == 0

    @property
    def share_here(self) -> float:
        """Part of the scene that is on this machine."""
        return self.on_machine / self.size

    @contextmanager
    def joint(self) -> Iterator[None]:
        """Note an error in what all do together: the others would wait for ever."""
        try:
            yield
        except BaseException:
            self.failed_within = True
            raise

    def barrier(self) -> None:
        """Wait for all processes."""

    def end_together(self) -> None:
        """Wait for all processes at the end of a run, which each tells in the same words."""
        self.barrier()
        self.at_end = True

    def agree(self, word: int, patience: float = np.inf) -> np.ndarray | None:
        """Gather a word of each (size,), or None if one has not come in `patience` seconds."""
        return np.array([word])

    def bcast(self, thing: Any = None) -> Any:
        """Hand what the first process has to all."""
        return thing

    def gather(self, thing: Any) -> list | None:
        """Gather what each process has at the first; None at the others."""
        return [thing]

    def allgather(self, thing: Any) -> list:
        """Gather what each process has at all of them."""
        return [thing]

    def everyone(self, what: str, thing: Any) -> list:
        """Gather the things of all processes, which have to ask for the same (in words)."""
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
        """Gather things at the first process, make an answer for each, and scatter the answers."""
        found = self.gather(thing)
        return self.scatter(None if found is None else make(found))

    def gather_rows(self, own: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        """Put the numbers of all processes, one after another, into `out` of the first."""
        assert out is not None
        out[:] = own

    def scatter(self, things: Sequence | None) -> Any:
        """Hand out what the first process has for each."""
        assert things is not None
        return things[0]

    def exchange(self, things: dict[int, Any]) -> dict[int, Any]:
        """Swap things with some other processes, by rank; both sides name each other."""
        return {}

    def alltoall(self, numbers: np.ndarray) -> np.ndarray:
        """Swap a number (size,) with each process."""
        return numbers

    def allreduce(self, array: np.ndarray) -> np.ndarray:
        """Add up whole numbers over all processes: for such, order does not matter."""
        return array

    def allreduce_max(self, array: np.ndarray) -> np.ndarray:
        """Take the largest of each number over all processes, in place."""
        return array

    def in_turn(self, act: Callable[[], None]) -> None:
        """Let the first process act, and then all others: they find what it has made."""
        act()
