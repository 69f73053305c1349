"""The MPI processes of a scene, through mpi4py."""

import os
import socket
import time
import traceback
from collections.abc import Callable, Sequence
from math import inf
from typing import Any
from zlib import crc32

import numpy as np

from karamelo_py.language.scene import Scene
from karamelo_py.scene.comm import SerialComm, T
from karamelo_py.script.errors import Quit, ScriptError

INSTALL = "pip install '.[mpi]' in the folder of karamelo-py"
# Environment variables of MPI launchers: number of processes, and rank.
LAUNCHED = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
# Answers other than step numbers, which are positive.
WELL, HERE, FAILED = 0, -1, -2
RankArray = tuple[int, np.ndarray]
PAUSE = 0.005  # seconds between checks of other processes


def launched() -> tuple[int, int]:
    for size, rank in LAUNCHED:
        if os.environ.get(size, "").isdigit():
            return int(os.environ[size]), int(os.environ.get(rank, 0))
    return 1, 0


class MpiComm(SerialComm):
    """Communicator of all processes of a run, by mpi4py; rank 0 writes files.

    `ends` reports an error and ends all processes.
    """

    parted = False
    _ends: Callable[[BaseException], None] | None = None

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
        # With pkl5, messages may exceed 2 GB.
        self.world = world = pkl5.Intracomm(MPI.COMM_WORLD)
        self.rank, self.size = world.Get_rank(), world.Get_size()
        self._aside = world.Dup()  # agreements, independent of other messages
        self._between = world.Dup()  # messages within steps
        cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
        mine = socket.gethostname(), cores
        self.beside = self.allgather(mine).count(mine)
        near = MPI.COMM_WORLD.Split_type(MPI.COMM_TYPE_SHARED)
        self.on_machine = near.Get_size()
        near.Free()

    def barrier(self) -> None:
        if (self.agree(HERE) == FAILED).any():
            self.parted = True
            raise Quit

    def agree(self, word: int, patience: float = inf) -> np.ndarray | None:
        word_sent, words = np.array([word], np.int64), np.empty(self.size, np.int64)
        request = self._aside.Iallgather(word_sent, words)
        end = time.monotonic() + patience
        while not request.Test():
            if time.monotonic() > end:
                return None
            time.sleep(PAUSE)
        return words

    def bcast(self, thing: Any = None) -> Any:
        return self.world.bcast(thing)

    def gather(self, thing: T) -> list[T] | None:
        return self.world.gather(thing)

    def allgather(self, thing: T) -> list[T]:
        return self.world.allgather(thing)

    def gather_rows(self, rows: np.ndarray, out: np.ndarray | None, counts: Sequence[int]) -> None:
        self.world.Gatherv(rows, (out, counts) if self.leads else None)

    def scatter(self, things: Sequence | None) -> Any:
        return self.world.scatter(things)

    def exchange(self, things: dict[int, Any]) -> dict[int, Any]:
        sent = [self.world.isend(thing, rank) for rank, thing in things.items()]
        received = {rank: self.world.recv(source=rank) for rank in things}
        for one in sent:
            one.wait()
        return received

    def alltoall(self, numbers: np.ndarray) -> np.ndarray:
        out = np.empty_like(numbers)
        self.world.Alltoall(numbers, out)
        return out

    def allreduce(self, array: np.ndarray) -> np.ndarray:
        out, begun = np.empty_like(array), time.perf_counter()
        self.world.Allreduce(array, out)
        self.waited += time.perf_counter() - begun
        return out

    def allreduce_max(self, array: np.ndarray) -> np.ndarray:
        begun = time.perf_counter()
        self.world.Allreduce(self.mpi.IN_PLACE, array, self.mpi.MAX)
        self.waited += time.perf_counter() - begun
        return array

    def in_turn(self, act: Callable[[], None]) -> None:
        if self.leads:
            act()
        self.barrier()
        if not self.leads:
            act()

    def connect(self, sent: list[RankArray], taken: list[RankArray]) -> Any:
        requests = [self._between.Recv_init(array, rank) for rank, array in taken]
        return requests + [self._between.Send_init(array, rank) for rank, array in sent]

    def start(self, link: list) -> None:
        self.mpi.Prequest.Startall(link)

    def finish(self, link: list) -> None:
        begun = time.perf_counter()
        self.mpi.Request.Waitall(link)
        self.waited += time.perf_counter() - begun

    def disconnect(self, link: list) -> None:
        for request in link:
            request.Free()

    def fail(self, error: BaseException) -> None:
        """End all processes because of an error that cannot be raised here."""
        if self._ends is not None:
            self._ends(error)
            return
        traceback.print_exception(error)
        self.abort()

    def abort(self, status: int = 1) -> None:
        self.world.Abort(status)


def check_same_run(hub: Scene) -> None:
    """Check that all processes begin the same run; if not, one of them reports it and all quit."""
    comm = hub.settings.comm
    present = [hub.mark and (hub.mark.file, hub.mark.line), len(hub.runs)]
    words = comm.agree(1 + crc32(repr((present, hub.interpreter.presets)).encode()))
    if (words == words[0]).all():
        return
    comm.parted = True
    # A process that has failed reports its own error.
    if (words == FAILED).any() or comm.rank != int((words > 0).argmax()):
        raise Quit
    raise ScriptError(
        "the processes have reached different runs",
        mark=hub.mark,
        expected="the same script, files and variables for all of them",
    )
