"""The processes that share a scene, and how they talk to each other (MPI, through mpi4py)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.script.errors import ScriptError

INSTALL = "pip install 'karamelo-py[mpi]'"
# What the launchers of MPI tell each process: how many there are, and which it is.
LAUNCHED = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("MPI_LOCALNRANKS", "MPI_LOCALRANKID"),
)


def launched() -> tuple[int, int]:
    """How many processes a launcher of MPI has started, and which of them this is."""
    for size, rank in LAUNCHED:
        if size in os.environ:
            return int(os.environ[size]), int(os.environ.get(rank, 0))
    return 1, 0


class Crew:
    """All processes of a run, in the order of their ranks. The first leads.

    Parameters
    ----------
    world
        A communicator of mpi4py; that of all processes by default.

    Raises
    ------
    ScriptError
        If mpi4py is not there, or finds no MPI.
    """

    def __init__(self, world: Any = None):
        if world is None:
            try:
                from mpi4py import MPI
            except (ImportError, RuntimeError) as error:
                raise ScriptError(
                    f"several processes of one scene need mpi4py, which does not load: {error}",
                    hint=INSTALL,
                ) from None
            world = MPI.COMM_WORLD
        self.world = world
        self.rank, self.size = world.Get_rank(), world.Get_size()

    @property
    def leads(self) -> bool:
        """Whether this is the first."""
        return self.rank == 0

    def told(self, thing: Any = None) -> Any:
        """What the first says to all."""
        return self.world.bcast(thing)

    def gathered(self, thing: Any) -> list | None:
        """What each has, for the first; None for the others."""
        return self.world.gather(thing)

    def everyone(self, thing: Any) -> list:
        """What each has, for all."""
        return self.world.allgather(thing)

    def lined_up(self, own: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        """Put the numbers of all, one after another, into `out` of the first."""
        self.world.Gatherv(own, (out, counts) if self.leads else None)

    def handed_out(self, things: Sequence | None) -> Any:
        """The own one of the things that the first has for each."""
        return self.world.scatter(things)

    def swapped(self, things: Sequence) -> list:
        """What each has for this one, where this one has `things` for each."""
        return self.world.alltoall(things)

    def added(self, array: np.ndarray) -> np.ndarray:
        """The sum of whole numbers over all: for such, order does not matter."""
        out = np.empty_like(array)
        self.world.Allreduce(array, out)
        return out

    def largest(self, array: np.ndarray) -> np.ndarray:
        """The largest of each number of all."""
        from mpi4py import MPI

        out = np.empty_like(array)
        self.world.Allreduce(array, out, op=MPI.MAX)
        return out

    def passed(self, given: dict[int, np.ndarray], taken: dict[int, np.ndarray]) -> None:
        """Send arrays to some others and fill those that they send, by rank."""
        from mpi4py import MPI

        waiting = [self.world.Irecv(array, rank) for rank, array in taken.items()]
        waiting += [self.world.Isend(array, rank) for rank, array in given.items()]
        MPI.Request.Waitall(waiting)

    def abandon(self) -> None:
        """End all processes at once."""
        self.world.Abort(1)
