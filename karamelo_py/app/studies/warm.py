"""Begin runs as copies (forks) of a process that has imported the program.

A run is a process like any other: the study waits for it, and nothing that happens to it affects
others. On Linux, where the study can adopt orphaned processes; elsewhere, and where any
of this fails, a run starts from nothing.
"""

import ctypes
import gc
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
import weakref
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NoReturn

from karamelo_py.app.leaving import STUDY

TRIES = 3  # to start the process
PATIENCE = 20.0  # seconds for an answer: a start takes some hundredths, the import two or so
SUBREAPER = 36  # of Linux's prctl: adopts processes whose parents have ended
LONGEST = 1 << 16  # bytes of a request
BEGIN = "from karamelo_py.app.studies.warm import serve; serve()"


class WarmProcess:
    """The process that runs are copies of; it is started when first needed."""

    def __init__(self, environment: Mapping[str, str]):
        self.environment = environment
        self.tries = TRIES if sys.platform == "linux" else 0
        self.lock = threading.Lock()
        self.held: list[tuple[socket.socket, int]] = []  # its link and number
        self.finalizer = weakref.finalize(self, _end, self.held)

    def start(self, words: list[str], folder: Path, out: BinaryIO, err: BinaryIO) -> int | None:
        """Begin a run; returns the number of the process, a child of this one, or None."""
        with self.lock:
            while self.tries:
                try:
                    if not self.held:
                        self._begin()
                    link, _ = self.held[0]
                    said = json.dumps([str(folder.absolute()), *words]).encode()
                    socket.send_fds(link, [said], [out.fileno(), err.fileno()])
                    return int(link.recv(32))
                except (OSError, ValueError):
                    _end(self.held)
                    self.tries -= 1
        return None

    def _begin(self) -> None:
        if ctypes.CDLL(None, use_errno=True).prctl(SUBREAPER, 1, 0, 0, 0):
            raise OSError("cannot adopt")
        mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        mine.settimeout(PATIENCE)  # TimeoutError is an OSError
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-c", BEGIN], stdin=theirs.fileno(), stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env=self.environment, start_new_session=True,
            )  # fmt: skip
        process.returncode = 0  # `_end` waits for it
        self.held.append((mine, process.pid))


def _end(held: list[tuple[socket.socket, int]]) -> None:
    while held:
        link, pid = held.pop()
        link.close()
        with suppress(OSError):
            os.kill(pid, signal.SIGKILL)  # it has nothing to lose
            for _ in range(100):  # at most a second: the system may hold it
                if os.waitpid(pid, os.WNOHANG)[0]:
                    break
                time.sleep(0.01)


# ---- in the warm process -------------------------------------------------------------------------


def serve() -> NoReturn:
    """Import the program, and begin runs of it as copies of this process until the study ends."""
    import karamelo_py.app.cli
    import karamelo_py.run.loop  # noqa: F401

    gc.collect()
    gc.freeze()
    gc.disable()
    link = socket.socket(fileno=os.dup(0))
    os.chdir("/")  # no folder is in use by it
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    while True:
        said, files, *_ = socket.recv_fds(link, LONGEST, 2)
        if not said:
            os._exit(0)
        read, write = os.pipe()
        between = os.fork()
        if not between:
            pid = os.fork()
            if pid:
                os.write(write, str(pid).encode())
                os._exit(0)
            link.close()
            os.close(read)
            os.close(write)
            _run(json.loads(said), *files)
        os.waitpid(between, 0)  # from here on the run is a child of the study
        os.close(write)
        link.send(os.read(read, 32))
        for file in (read, *files):
            os.close(file)


def _run(said: list[str], out: int, err: int) -> NoReturn:
    """Carry out a run in this process, as the program does."""
    from karamelo_py.app.start import main

    folder, *sys.argv[1:] = said
    study = os.environ.get(STUDY, "")
    for _ in range(1000):  # until the study has adopted it, after some thousandths of a second
        if str(os.getppid()) == study:
            break
        time.sleep(0.002)
    os.setsid()  # Ctrl-C is of the study alone
    os.chdir(folder)
    for file, at in ((out, 1), (err, 2)):
        os.dup2(file, at)
        os.close(file)
    try:
        status = main()
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    os._exit(status)
