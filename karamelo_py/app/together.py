"""One of several processes that carry out a script: what it may say, and how all end together."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import TYPE_CHECKING, NamedTuple, TextIO

from karamelo_py.app.launch import SOCKET
from karamelo_py.app.leaving import INTERRUPTED
from karamelo_py.run.mpi.comm import FAILED, WELL, MpiComm, launched
from karamelo_py.script.errors import ScriptError

if TYPE_CHECKING:
    from karamelo_py.scene.hub import Hub

# Seconds that one that has failed waits for the others, before it ends them. The first tells what
# is wrong; others do where it does not know.
PATIENCE, LONGER = 2.0, 6.0


class Outcome(NamedTuple):
    """The end of a command line."""

    status: int
    text: str = ""  # what is left to be said


class Link:
    """To the launcher of this program, where that has started this process."""

    def __init__(self) -> None:
        self.socket: socket.socket | None = None

    def make(self, rank: int) -> None:
        """Report to the launcher; the first gets its output and errors, and its signals."""
        name = os.environ.pop(SOCKET, None)
        if name is None:
            return
        link = socket.socket(socket.AF_UNIX)
        try:
            link.connect(name)
            link.sendall(_line({"rank": rank, "pid": os.getpid()}))
            if rank == 0:
                # What libraries write to the usual ones is left to mpiexec.
                out, err = (_stream(fd) for fd in socket.recv_fds(link, 1, 2)[1])
                sys.stdout = sys.__stdout__ = out
                sys.stderr = sys.__stderr__ = err
        except OSError:  # it is on another machine
            return
        self.socket = link
        if rank == 0:
            threading.Thread(target=_heed, args=(link,), daemon=True).start()

    def tell_of_end(self) -> None:
        """Tell the launcher that all is done, and that the others are waited for."""
        if self.socket is not None:
            with suppress(OSError):
                self.socket.sendall(_line({"over": True}))

    def report(self, status: int, text: str = "") -> None:
        """Tell the launcher how this process ends."""
        with suppress(OSError):
            self.socket.sendall(_line({"status": status, "text": text}))


def _stream(fd: int) -> TextIO:
    usual = sys.__stderr__  # shows what it cannot encode
    return open(fd, "w", buffering=1, encoding=usual.encoding, errors=usual.errors)


def _line(message: dict) -> bytes:
    return json.dumps(message).encode() + b"\n"


def _heed(link: socket.socket) -> None:
    """Take signals from the launcher; where that has gone, the run is to end."""
    with suppress(OSError):
        while number := link.recv(1):
            os.kill(os.getpid(), number[0])
    os.kill(os.getpid(), signal.SIGTERM)


link = Link()


def keep_to_oneself() -> None:
    """All processes but the first are silent, and the first reports to its launcher."""
    size, rank = launched()
    if size > 1:
        link.make(rank)
        if rank > 0:
            sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def has_terminal() -> bool | None:
    """False where mpiexec passes on what this process writes: it pretends to be a terminal."""
    return False if "OMPI_COMM_WORLD_SIZE" in os.environ and link.socket is None else None


def together(
    asked: int | None,
    run: Callable[[MpiComm], int],
    outcome: Callable[[Callable[[], int]], Outcome],
) -> int:
    """Carry out `run` as one of all processes; returns the exit status.

    Parameters
    ----------
    asked
        How many there are to be, where somebody has said so.
    run
        What each does; returns an exit status.
    outcome
        Calls a function, and makes a message of what it raises.
    """
    size, rank = launched()
    comm: MpiComm | None = None

    def act() -> int:
        nonlocal comm
        comm = join(asked, fail)
        return run(comm)

    def fail(error: BaseException) -> None:
        def again() -> int:
            raise error

        end(*outcome(again), tells=True, stays=False)

    def end(status: int, text: str, *, tells: bool, stays: bool) -> int:
        if text and tells:
            _tell(text, rank, size)
        if link.socket is not None:
            link.report(status, _signed(text, rank, size) if tells and rank else "")
        sys.stdout.flush()
        if not stays:
            comm.abort(status)
        # mpiexec would have its own say about a status, and the launcher knows it.
        return 0 if link.socket is not None and comm is not None else status

    status, text = outcome(act)
    if comm is None:
        end(status, text, tells=rank == 0, stays=True)
        if status == INTERRUPTED:  # while others join: they would be waited for at the end
            os._exit(status)
        return status
    if comm.parted:
        return end(status, text, tells=True, stays=True)
    patience = inf
    if not status and rank == 0:
        link.tell_of_end()
    if status:
        patience = LONGER if rank else PATIENCE
        if status == INTERRUPTED or comm.failed_within:
            patience = 0.0
        if comm.at_end:
            patience = inf
    words = comm.agree(FAILED if status else WELL, patience)
    alone = words is None
    return end(status, text, tells=alone or rank == int(words.argmin()), stays=not alone)


def _tell(text: str, rank: int, size: int) -> None:
    with suppress(OSError, ValueError):
        if rank == 0:
            print(text, file=sys.stderr, flush=True)
        elif link.socket is None:
            print(_signed(text, rank, size), file=sys.__stderr__, flush=True)


def _signed(text: str, rank: int, size: int) -> str:
    return f"{text}\nin process {rank + 1} of {size}" if text else ""


def join(asked: int | None, ends: Callable[[BaseException], None]) -> MpiComm:
    """Join the processes that mpiexec has started; `ends` as of `MpiComm`."""
    size, _ = launched()
    if asked is not None and asked != size:
        raise ScriptError(
            f"--ranks {asked}: mpiexec has started {size} processes",
            expected="one of the two: mpiexec -n N, or --ranks N",
        )
    comm = MpiComm(ends)
    if comm.size != size:
        raise ScriptError(
            f"{size} processes were started, and mpi4py sees {comm.size} of them",
            expected="the mpiexec of the MPI that mpi4py has found; with Slurm, srun --mpi=pmix",
        )
    return comm


def share(hub: Hub, comm: MpiComm) -> None:
    """Let all processes step a scene together, of which the first writes. One needs no other."""
    if comm.size > 1:
        hub.settings.comm = comm
    if not comm.leads:
        hub.output.writes = False
