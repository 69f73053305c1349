"""The processes that share a scene, and how they talk to each other (MPI, through mpi4py)."""

import os
import signal
import socket
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any

import numpy as np

from karamelo_py.script.errors import ScriptError

INSTALL = "pip install 'karamelo-py[mpi]'"
# What the launchers of MPI tell each process: how many there are, and which it is.
LAUNCHED = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
# Ctrl-C; batch systems, kill; a terminal that is closed (which Windows does not tell).
NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
ENDING = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
# Words at a meeting beside those of runs, which are above zero.
WELL, FAILED = 0, -1
PAUSE = 0.005  # seconds between two looks whether the others have come


@contextmanager
def heeding(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Have signals that end programs call a handler, but for those that are ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in ENDING}
    # Whoever started the program may have it go on when the terminal is closed (nohup).
    heeded = [number for number, now in before.items() if now != signal.SIG_IGN]
    for number in heeded:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])


def launched() -> tuple[int, int]:
    """How many processes a launcher of MPI has started, and which of them this is."""
    for size, rank in LAUNCHED:
        if os.environ.get(size, "").isdigit():
            return int(os.environ[size]), int(os.environ.get(rank, 0))
    return 1, 0


class Crew:
    """All processes of a run, in the order of their ranks. The first leads.

    Parameters
    ----------
    ends
        Ends all of them because of an error, of which it tells.

    Attributes
    ----------
    beside
        How many of them have the same cores as this one, itself among them.
    on_machine
        How many of them share the memory of its machine.
    waited
        Seconds in which this process waited for others, or for what they sent, in steps.
    amid
        Whether this process has failed in the midst of what all do together.
    parted
        Whether the processes do not go on together: one has failed, or has another script.
    signal
        What this process has been sent in a run, which all are to end with.

    Raises
    ------
    ScriptError
        If mpi4py is not there, or finds no MPI.
    """

    beside = on_machine = 1
    waited = 0.0
    signal = 0
    amid = parted = False
    _ends = None

    def __init__(self, ends: Callable[[BaseException], None] | None = None):
        self._ends = ends
        try:
            from mpi4py import MPI
            from mpi4py.util import pkl5
        except (ImportError, RuntimeError) as error:
            raise ScriptError(
                f"several processes of one scene need mpi4py, which does not load: {error}",
                hint=INSTALL,
            ) from None
        self.mpi = MPI
        # Its messages may be longer than 2 GB.
        self.world = world = pkl5.Intracomm(MPI.COMM_WORLD)
        self.rank, self.size = world.Get_rank(), world.Get_size()
        self._aside = world.Dup()  # where they meet, whatever is under way elsewhere
        self._between = world.Dup()  # for what is passed on in steps
        cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
        mine = socket.gethostname(), cores
        self.beside = self.everyone(mine).count(mine)
        near = MPI.COMM_WORLD.Split_type(MPI.COMM_TYPE_SHARED)
        self.on_machine = near.Get_size()
        near.Free()

    @property
    def leads(self) -> bool:
        """Whether this is the first."""
        return self.rank == 0

    def meet(self, word: int, patience: float = inf) -> np.ndarray | None:
        """Wait for all to come to such a point; the word of each (size,).

        The word of a run is above zero. None where somebody has not come in `patience` seconds.
        """
        own, found = np.array([word], np.int64), np.empty(self.size, np.int64)
        request = self._aside.Iallgather(own, found)
        end = time.monotonic() + patience
        while not request.Test():
            if time.monotonic() > end:
                return None
            time.sleep(PAUSE)
        return found

    @contextmanager
    def joint(self) -> Iterator[None]:
        """What all do together: where one fails the others would wait for ever."""
        try:
            yield
        except BaseException:
            self.amid = True
            raise

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

    def traded(self, things: dict[int, Any]) -> dict[int, Any]:
        """What some others have for this one, by rank, where it has `things` for the same."""
        sent = [self.world.isend(thing, rank) for rank, thing in things.items()]
        found = {rank: self.world.recv(source=rank) for rank in things}
        for one in sent:
            one.wait()
        return found

    def swapped(self, numbers: np.ndarray) -> np.ndarray:
        """The number that each has for this one, where this one has `numbers` for each."""
        out = np.empty_like(numbers)
        self.world.Alltoall(numbers, out)
        return out

    def added(self, array: np.ndarray) -> np.ndarray:
        """The sum of whole numbers over all: for such, order does not matter."""
        out, begun = np.empty_like(array), time.perf_counter()
        self.world.Allreduce(array, out)
        self.waited += time.perf_counter() - begun
        return out

    def largest(self, array: np.ndarray) -> np.ndarray:
        """Let each number be the largest of all."""
        begun = time.perf_counter()
        self.world.Allreduce(self.mpi.IN_PLACE, array, self.mpi.MAX)
        self.waited += time.perf_counter() - begun
        return array

    def linked(self, given: list[tuple[int, Any]], taken: list[tuple[int, Any]]) -> Any:
        """Ways on which arrays go to others (rank, array), again and again, and theirs come."""
        requests = [self._between.Recv_init(array, rank) for rank, array in taken]
        return requests + [self._between.Send_init(array, rank) for rank, array in given]

    def start(self, link: Any) -> None:
        """Begin to send what is in the arrays, and to fill others."""
        self.mpi.Prequest.Startall(link)

    def finish(self, link: Any) -> None:
        """Wait until all is sent and there."""
        begun = time.perf_counter()
        self.mpi.Request.Waitall(link)
        self.waited += time.perf_counter() - begun

    def unlink(self, link: Any) -> None:
        """Give up ways."""
        for request in link:
            request.Free()

    def fail(self, error: BaseException) -> None:
        """End all processes because of an error that cannot be raised here."""
        if self._ends is not None:
            self._ends(error)
            return
        traceback.print_exception(error)
        self.abandon()

    def abandon(self, status: int = 1) -> None:
        """End all processes at once."""
        self.world.Abort(status)
