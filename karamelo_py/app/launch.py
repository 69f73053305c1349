"""karamelo-py --ranks N: mpiexec starts the processes, and this one stands for them all.

Each process reports to this one through a socket (:mod:`karamelo_py.app.together`). The first gets
the terminal, or whatever output and errors go to, and the signals that come; the others say what
they know that it does not. What mpiexec says is shown only where no process was started.
"""

import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from karamelo_py.app.leaving import SIGNALLED
from karamelo_py.run.mpi.comm import ENDING, INSTALL, handled_signals
from karamelo_py.script.errors import ScriptError, render_message

# Where the launcher of this program waits for the processes to report.
SOCKET = "KARAMELO_PY_LAUNCHER"
# What Open MPI is told: more processes than cores are the user's choice, each has threads of its
# own, one that waits lets others work, and a container's root may start it.
OPEN_MPI = {
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
# Large pages for what the processes reserve, where Linux gives them to who asks: NumPy asks for the
# arrays that it makes, not for those that grow. Four processes of a million points: a tenth faster.
PAGES = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
PAUSE = 0.05  # seconds between two looks at mpiexec
GRACE = 2.0  # seconds that processes have to end after it
LONGEST = 15.0  # ... after one of them has failed; twice that where mpiexec does not heed
LOOK, STANDS = 1.0, 10.0  # seconds between two looks at processes, and until one is told of
AT_ONCE = 3  # so many signals end all without waiting for the step
LONGEST_NAME = 90  # of a socket
A_CORE = 16  # processes at most: who asks for more means another number


def launch(ranks: int, arguments: Sequence[str], module: str = "karamelo_py.app.start") -> int:
    """Run a program on so many processes of this machine; returns the exit status."""
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
        raise ScriptError(f"--ranks {ranks}: there is no mpiexec here", hint=INSTALL)
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        raise ScriptError(f"--ranks {ranks} needs mpi4py", hint=INSTALL) from None
    command = [mpiexec, "-n", str(ranks), sys.executable, "-m", module]
    with tempfile.TemporaryFile() as said, _folder() as folder:
        return Launcher(ranks, [*command, *arguments], f"{folder}/s", said).run()


@contextmanager
def _folder() -> Iterator[str]:
    """Make a folder for a socket, whose name may not be long."""
    usual = tempfile.gettempdir()
    place = usual if len(usual) < LONGEST_NAME - 20 else "/tmp"
    with tempfile.TemporaryDirectory(prefix="karamelo-", dir=place) as folder:
        yield folder


class Launcher:
    """The processes of a run as one: its signals, its exit status, its last word."""

    def __init__(self, ranks: int, command: list[str], name: str, said: BinaryIO):
        self.ranks, self.command, self.name, self.said = ranks, command, name, said
        self.unknown: list[socket.socket] = []  # have not said yet who they are
        self.links: dict[socket.socket, dict[str, Any]] = {}
        self.reports: dict[int, dict[str, Any]] = {}
        self.lost: list[dict[str, Any]] = []  # ended without a report, in this order
        self.over = False  # the first has done all
        self.failed = 0.0  # when one has told that it failed
        self.signals: list[int] = []
        self.stopped: dict[int, float] = {}  # since when
        self.told: set[int] = set()  # of these
        self.looked = 0.0
        self.process: Any = None

    def run(self) -> int:
        """Start them and see them end; returns the exit status."""
        with socket.socket(socket.AF_UNIX) as self.door, handled_signals(self._pass_on):
            self.door.bind(self.name)
            self.door.listen(self.ranks)
            environment = {**OPEN_MPI, **PAGES, **os.environ, SOCKET: self.name}
            # A session of its own: Ctrl-C comes to this process alone.
            self.process = subprocess.Popen(
                self.command, env=environment, stdin=subprocess.DEVNULL, stdout=self.said,
                stderr=self.said, start_new_session=True,
            )  # fmt: skip
            while self.process.poll() is None:
                self._listen()
                self._tell_of_those_that_stand()
                self._end_those_that_stay()
            end = time.monotonic() + GRACE
            while self.links and time.monotonic() < end:
                self._listen()
            for one in self.links.values():  # mpiexec was ended, and not they
                with suppress(ProcessLookupError):
                    os.kill(one["pid"], signal.SIGKILL)
        status = self._outcome()
        if "--debug" in self.command and (words := self._words()):
            self._say(words)
        return status

    # --- while they run ---------------------------------------------------------------------------

    def _pass_on(self, number: int, _: Any) -> None:
        self.signals.append(number)
        first = next((link for link, one in self.links.items() if one["rank"] == 0), None)
        for pid in self._stopped():  # the run ends with their part of its last state
            os.kill(pid, signal.SIGCONT)
        if first is not None and 0 not in self.reports and len(self.signals) < AT_ONCE:
            with suppress(OSError):
                first.sendall(bytes([number]))
        elif self.process is not None:
            self.process.terminate()

    def _end_those_that_stay(self) -> None:
        """End mpiexec where a process has failed long ago, and others have not seen it."""
        if any(one["status"] for one in self.reports.values()):
            self.failed = self.failed or time.monotonic()
            late = time.monotonic() - self.failed
            if late > 2 * LONGEST:
                self.process.kill()
            elif late > LONGEST:
                self.process.terminate()

    def _stopped(self) -> list[int]:
        """Processes that somebody has stopped, as far as the system tells."""
        found = []
        for one in self.links.values():
            with suppress(OSError):
                state = Path(f"/proc/{one['pid']}/stat").read_text().rpartition(")")[2].split()[0]
                found += [one["pid"]] * (state == "T")
        return found

    def _tell_of_those_that_stand(self) -> None:
        """Say so where all wait for a process that somebody has stopped."""
        now = time.monotonic()
        if now < self.looked + LOOK:
            return
        self.looked, stopped = now, self._stopped()
        self.stopped = {pid: self.stopped.get(pid, now) for pid in stopped}
        for pid, since in self.stopped.items():
            if now - since > STANDS and pid not in self.told:
                self.told.add(pid)
                rank = next(one["rank"] for one in self.links.values() if one["pid"] == pid)
                text = f"process {rank + 1} of {self.ranks} (pid {pid}) is stopped: all wait for it"
                self._say(render_message("warning", text, hint=f"kill -CONT {pid}"))

    def _listen(self) -> None:
        ready, *_ = select.select([self.door, *self.unknown, *self.links], [], [], PAUSE)
        for link in ready:
            if link is self.door:
                self.unknown.append(link.accept()[0])
                continue
            for line in _received(link).splitlines():
                self._heard(link, json.loads(line))
            if link.fileno() < 0:
                self.unknown = [one for one in self.unknown if one is not link]
                one = self.links.pop(link, None)
                if one is not None and one["rank"] not in self.reports:
                    self.lost.append(one)

    def _heard(self, link: socket.socket, message: dict[str, Any]) -> None:
        if "over" in message:
            self.over = True
            return
        if link in self.links:
            self.reports[self.links[link]["rank"]] = message
            return
        self.unknown.remove(link)
        self.links[link] = message
        if message["rank"] == 0:
            socket.send_fds(link, [b"0"], [1, 2])

    # --- when they have ended ---------------------------------------------------------------------

    def _outcome(self) -> int:
        """Find the exit status, and say what no process could say."""
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
            what = "interrupted" if first == signal.SIGINT else f"ended by {first.name}"
            self._say(render_message("error", what))
            return SIGNALLED + self.signals[0]
        status = self.process.returncode
        status = SIGNALLED - status if status < 0 else status or 1
        self._say(self._loss(status) if self.lost else self._no_start())
        return status

    def _loss(self, status: int) -> str:
        one, sent = self.lost[0], status - SIGNALLED
        by = f" by {signal.Signals(sent).name}" if sent in signal.valid_signals() else ""
        who = f"process {one['rank'] + 1} of {self.ranks} (pid {one['pid']}) was ended{by}"
        if self.over:
            return render_message("error", f"{who} when the runs were over: all files are complete")
        return render_message(
            "error",
            f"{who}, and the run with it: files are complete up to there",
            hint="the system does that to who takes too much memory"
            if sent not in ENDING
            else None,
        )

    def _no_start(self) -> str:
        text = f"{self.command[0]} has not started {self.ranks} processes"
        return "\n".join([render_message("error", text), self._words()]).rstrip()

    def _words(self) -> str:
        """Read what mpiexec said, and libraries of C through it."""
        self.said.seek(0)
        return self.said.read().decode(errors="replace").strip()

    def _say(self, text: str) -> None:
        with suppress(OSError):
            print(text, file=sys.stderr, flush=True)


def _received(link: socket.socket) -> bytes:
    """Read what has come; the link is closed where its other end is."""
    found = b""
    with suppress(OSError):
        while part := link.recv(1 << 16):
            found += part
            if found.endswith(b"\n"):
                return found
    link.close()
    return found
