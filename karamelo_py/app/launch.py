"""karamelo-py --ranks N: start processes by mpiexec; they report and end together.

Each process reports over a socket to the `Launcher` in the user's process. Rank 0 gets the terminal
and the signals. Output of mpiexec is shown only if no process has started.
"""

import errno
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

from karamelo_py.app.leaving import INTERRUPTED, SIGNALLED
from karamelo_py.run.mpi import comm as mpi
from karamelo_py.scene.comm import ENDING, handled_signals
from karamelo_py.script.errors import FAILURES, ScriptError, render_message

if TYPE_CHECKING:
    from karamelo_py.scene.hub import Hub

Message = dict[str, Any]
ERROR = 1
# Errors due to disks and permissions, not to the program.
OF_THE_SYSTEM = tuple(
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EROFS", "EFBIG", "EIO", "EACCES", "EPERM", "EMFILE", "ENFILE",
                 "ESTALE")
    if hasattr(errno, name)
)  # fmt: skip
SOCKET = "KARAMELO_PY_LAUNCHER"
# Allow several threads per process; let waiting processes yield if there are few cores; allow root.
OPEN_MPI = {
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
# Large pages make four processes of a million points 10 % faster; NumPy needs a request.
PAGES = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
PAUSE = 0.05  # seconds between polls
GRACE = 2.0  # seconds after the end of mpiexec in which processes must end
AT_ONCE = 3  # number of signals after which processes are killed
LONGEST_FOLDER = 70  # characters, since names of sockets must be short
A_CORE = 16  # processes per core; a larger number is a mistake
# Seconds until a failed process ends the other processes. Meanwhile, rank 0 can report the error.
PATIENCE, LONGER = 2.0, 6.0


def outcome_of(act: Callable[[], int], *, debugging: bool = False) -> tuple[int, str]:
    try:
        return act(), ""
    except (KeyboardInterrupt, *FAILURES) as error:
        return _ended_by(error, debugging=debugging)


def _ended_by(error: BaseException, *, debugging: bool) -> tuple[int, str]:
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, render_message("error", "interrupted")
    if isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError):
        sys.stderr.close()
        return ERROR, ""
    if debugging:
        traceback.print_exception(error)
    return ERROR, rendered(error)


def rendered(error: BaseException) -> str:
    if isinstance(error, ScriptError):
        return error.render()
    if isinstance(error, OSError) and error.errno in OF_THE_SYSTEM:
        file = f"{error.filename}: " if error.filename else ""
        return render_message("error", f"{file}{error.strerror}")
    if isinstance(error, MemoryError):
        message = "the scene does not fit into memory"
        hint = "a coarser grid, fewer points per cell, or precision(single)"
    else:
        message = f"internal error: {type(error).__name__}: {error}"
        hint = "run again with --debug to see where, and please report it"
    return render_message("error", message, hint=hint)


def launch(ranks: int, arguments: Sequence[str], module: str = "karamelo_py.app.start") -> int:
    cores = os.cpu_count() or 1
    if ranks > A_CORE * cores:
        raise ScriptError(
            f"--ranks {ranks}: this machine has {cores} cores",
            hint=f"--ranks {cores}, or mpiexec with a list of machines",
        )
    beside = Path(sys.executable).parent / "mpiexec"
    mpiexec = str(beside) if beside.exists() else shutil.which("mpiexec")
    if not hasattr(socket, "send_fds"):
        raise ScriptError(
            f"--ranks {ranks}: here, mpiexec has to be started by hand",
            hint=f"mpiexec -n {ranks} karamelo-py SCRIPT",
        )
    if mpiexec is None:
        raise ScriptError(f"--ranks {ranks}: there is no mpiexec here", hint=mpi.INSTALL)
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        raise ScriptError(f"--ranks {ranks} needs mpi4py", hint=mpi.INSTALL) from None
    command = [mpiexec, "-n", str(ranks), sys.executable, "-m", module, *arguments]
    base = tempfile.gettempdir() if len(tempfile.gettempdir()) < LONGEST_FOLDER else "/tmp"
    with (
        tempfile.TemporaryFile() as said,
        tempfile.TemporaryDirectory(prefix="karamelo-", dir=base) as folder,
    ):
        return Launcher(ranks, command, f"{folder}/s", said).run()


class Launcher:
    def __init__(self, ranks: int, command: list[str], name: str, said: BinaryIO):
        self.ranks, self.command, self.name, self.said = ranks, command, name, said
        self.links: dict[socket.socket, Message] = {}  # empty message until the rank is known
        self.reports: dict[int, Message] = {}
        self.lost: list[Message] = []  # processes that ended without a report, in order
        self.over = False
        self.signals: list[int] = []
        self.process: subprocess.Popen | None = None

    def run(self) -> int:
        with socket.socket(socket.AF_UNIX) as self.door, handled_signals(self._pass_on):
            self.door.bind(self.name)
            self.door.listen(self.ranks)
            environment = {**OPEN_MPI, **PAGES, **os.environ, SOCKET: self.name}
            # Use a separate session, so that Ctrl-C is sent to this process only.
            self.process = subprocess.Popen(
                self.command, env=environment, stdin=subprocess.DEVNULL, stdout=self.said,
                stderr=self.said, start_new_session=True,
            )  # fmt: skip
            while self.process.poll() is None:
                self._listen()
            end = time.monotonic() + GRACE
            while self.links and time.monotonic() < end:
                self._listen()
            for one in filter(None, self.links.values()):  # connections still open
                with suppress(ProcessLookupError):
                    os.kill(one["pid"], signal.SIGKILL)
        status = self._outcome()
        if "--debug" in self.command and (words := self._words()):
            self._say(words)
        return status

    def _pass_on(self, number: int, _: object) -> None:
        self.signals.append(number)
        first = next((link for link, one in self.links.items() if one.get("rank") == 0), None)
        for one in filter(None, self.links.values()):  # mpiexec would wait for a stopped process
            with suppress(ProcessLookupError):
                os.kill(one["pid"], signal.SIGCONT)
        if first is not None and 0 not in self.reports and len(self.signals) < AT_ONCE:
            with suppress(OSError):
                first.sendall(bytes([number]))
        elif self.process is not None:
            self.process.terminate()

    def _listen(self) -> None:
        ready, *_ = select.select([self.door, *self.links], [], [], PAUSE)
        for link in ready:
            if link is self.door:
                self.links[link.accept()[0]] = {}
                continue
            for line in _received(link).splitlines():
                self._heard(link, json.loads(line))
            if link.fileno() < 0:
                one = self.links.pop(link)
                if one and one["rank"] not in self.reports:
                    self.lost.append(one)

    def _heard(self, link: socket.socket, message: Message) -> None:
        if "over" in message:
            self.over = True
        elif self.links[link]:
            self.reports[self.links[link]["rank"]] = message
        else:
            self.links[link] = message
            if message["rank"] == 0:
                socket.send_fds(link, [b"0"], [1, 2])

    def _outcome(self) -> int:
        first = self.reports.get(0)
        failed = [one for _, one in sorted(self.reports.items()) if one["status"]]
        if first is not None and first["status"]:
            return first["status"]
        if failed:
            if text := next((one["text"] for one in failed if one["text"]), None):
                self._say(text)
            return failed[0]["status"]
        if first is not None:
            return 0
        if self.signals:
            first = signal.Signals(self.signals[0])
            message = "interrupted" if first == signal.SIGINT else f"ended by {first.name}"
            self._say(render_message("error", message))
            return SIGNALLED + self.signals[0]
        status = self.process.returncode
        status = SIGNALLED - status if status < 0 else status or 1
        unstarted = f"{self.command[0]} has not started {self.ranks} processes"
        text = f"{render_message('error', unstarted)}\n{self._words()}".rstrip()
        self._say(self._loss(status) if self.lost else text)
        return status

    def _loss(self, status: int) -> str:
        one, sent = self.lost[0], status - SIGNALLED
        by = f" by {signal.Signals(sent).name}" if sent in signal.valid_signals() else ""
        who = f"process {one['rank'] + 1} of {self.ranks} (pid {one['pid']}) was ended{by}"
        if self.over:
            return render_message("error", f"{who} after the last run: all files are complete")
        signalled = sent in ENDING
        hint = None if signalled else "the system ends processes that take too much memory"
        who += ", and the run with it: files are complete up to there"
        return render_message("error", who, hint=hint)

    def _words(self) -> str:
        self.said.seek(0)
        return self.said.read().decode(errors="replace").strip()

    def _say(self, text: str) -> None:
        with suppress(OSError):
            print(text, file=sys.stderr, flush=True)


def _received(link: socket.socket) -> bytes:
    data = b""
    with suppress(OSError):
        while chunk := link.recv(1 << 16):
            data += chunk
            if data.endswith(b"\n"):
                return data
    link.close()
    return data


_link: socket.socket | None = None


def keep_to_oneself() -> None:
    size, rank = mpi.launched()
    if size > 1:
        _report_to_launcher(rank)
        if rank > 0:
            sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def _report_to_launcher(rank: int) -> None:
    global _link
    name = os.environ.pop(SOCKET, None)
    if name is None:
        return
    link = socket.socket(socket.AF_UNIX)
    try:
        link.connect(name)
        link.sendall(_line(rank=rank, pid=os.getpid()))
        if rank == 0:
            # Redirect only Python's streams: libraries still write to mpiexec.
            out, err = (_stream(fd) for fd in socket.recv_fds(link, 1, 2)[1])
            sys.stdout = sys.__stdout__ = out
            sys.stderr = sys.__stderr__ = err
    except OSError:
        return
    _link = link
    if rank == 0:
        threading.Thread(target=_heed, args=(link,), daemon=True).start()


def _stream(fd: int) -> TextIO:
    usual = sys.__stderr__  # its error handler escapes characters that the encoding lacks
    return open(fd, "w", buffering=1, encoding=usual.encoding, errors=usual.errors)


def _heed(link: socket.socket) -> None:
    with suppress(OSError):
        while number := link.recv(1):
            os.kill(os.getpid(), number[0])
    os.kill(os.getpid(), signal.SIGTERM)


def _line(**message: object) -> bytes:
    return json.dumps(message).encode() + b"\n"


def _report(**message: object) -> None:
    if _link is not None:
        with suppress(OSError):
            _link.sendall(_line(**message))


def has_terminal() -> bool | None:
    """Return False if the output only looks like a terminal because of mpiexec; otherwise None."""
    return False if "OMPI_COMM_WORLD_SIZE" in os.environ and _link is None else None


def together(
    asked: int | None, run: Callable[[mpi.MpiComm], int], *, debugging: bool = False
) -> int:
    size, rank = mpi.launched()
    comm: mpi.MpiComm | None = None

    def act() -> int:
        nonlocal comm
        comm = _join(asked, fail)
        return run(comm)

    def fail(error: BaseException) -> None:
        end(*_ended_by(error, debugging=debugging), tells=True, stays=False)

    def end(status: int, text: str, *, tells: bool, stays: bool) -> int:
        if text and tells:
            _tell(text, rank, size)
        _report(status=status, text=_signed(text, rank, size) if tells and rank else "")
        sys.stdout.flush()
        if not stays:
            comm.abort(status)
        # The launcher already has the exit status, about which mpiexec would print a message.
        return 0 if _link is not None and comm is not None else status

    status, text = outcome_of(act, debugging=debugging)
    if comm is None:
        end(status, text, tells=rank == 0, stays=True)
        if status == INTERRUPTED:  # other processes may still be starting
            os._exit(status)
        return status
    if comm.parted:
        return end(status, text, tells=True, stays=True)
    patience = inf
    if not status and rank == 0:
        _report(over=True)  # reports before it waits for other processes
    if status:
        patience = LONGER if rank else PATIENCE
        if status == INTERRUPTED or comm.failed_within:
            patience = 0.0
        if comm.at_end:
            patience = inf
    words = comm.agree(mpi.FAILED if status else mpi.WELL, patience)
    alone = words is None
    return end(status, text, tells=alone or rank == int(words.argmin()), stays=not alone)


def _tell(text: str, rank: int, size: int) -> None:
    with suppress(OSError, ValueError):
        if rank == 0:
            print(text, file=sys.stderr, flush=True)
        elif _link is None:
            print(_signed(text, rank, size), file=sys.__stderr__, flush=True)


def _signed(text: str, rank: int, size: int) -> str:
    return f"{text}\nin process {rank + 1} of {size}" if text else ""


def _join(asked: int | None, ends: Callable[[BaseException], None]) -> mpi.MpiComm:
    size, _ = mpi.launched()
    if asked is not None and asked != size:
        raise ScriptError(
            f"--ranks {asked}: mpiexec has started {size} processes",
            expected="one of the two: mpiexec -n N, or --ranks N",
        )
    comm = mpi.MpiComm(ends)
    if comm.size != size:
        raise ScriptError(
            f"{size} processes were started, and mpi4py sees {comm.size} of them",
            expected="the mpiexec of the MPI that mpi4py has found; with Slurm, srun --mpi=pmix",
        )
    return comm


def share(hub: "Hub", comm: mpi.MpiComm) -> None:
    if comm.size > 1:
        hub.settings.comm = comm
    if not comm.leads:
        hub.output.writes = False
