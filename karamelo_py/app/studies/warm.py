"""Start runs as forks of warm processes, which have already imported the program.

If the study can adopt orphans (Linux), a run leaves a fork of itself, with its kernels, for later
runs of the same kind. If it cannot, or if anything fails, each run starts a new interpreter.
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
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from karamelo_py.app.leaving import STUDY

MOST = 8
TRIES = 3
PATIENCE = 20.0  # seconds; a start takes about 0.01 s, the import 2 s
SUBREAPER = 36  # prctl: adopt processes whose parents have ended
LONGEST = 1 << 16  # bytes of a request
BEGIN = "from karamelo_py.app.studies.warm import begin; begin()"
NOT_OURS = "karamelo_py.styles.fixes.python"


class WarmProcess:
    """A warm process. Without a pid, the process is a run that may leave a warm one."""

    def __init__(self, link: socket.socket, pid: int | None = None):
        self.link, self.pid = link, pid

    def is_ready(self) -> bool:
        """Return True if the process can be forked; raise ConnectionError if it has ended."""
        if self.pid is None:
            with suppress(BlockingIOError):
                answer = self.link.recv(32, socket.MSG_DONTWAIT)
                if not answer:
                    raise ConnectionError
                self.pid = int(answer)
        return self.pid is not None

    def end(self) -> None:
        self.link.close()
        if self.pid is not None:
            with suppress(OSError):
                os.kill(self.pid, signal.SIGKILL)
                for _ in range(100):  # waits at most a second
                    if os.waitpid(self.pid, os.WNOHANG)[0]:
                        break
                    time.sleep(0.01)


class WarmProcesses:
    def __init__(self, environment: Mapping[str, str]):
        self.environment = environment
        self.tries = TRIES if sys.platform == "linux" else 0
        self.lock = threading.Lock()
        self.keepers: dict[tuple[str, ...], WarmProcess] = {}
        self.finalizer = weakref.finalize(self, _end, self.keepers)

    def start(
        self, kind: tuple[str, ...], words: list[str], folder: Path, files: Sequence[BinaryIO]
    ) -> int | None:
        """Start a run that writes output and errors to `files`; return its pid, or None."""
        with self.lock:
            while self.tries:
                key: tuple[str, ...] = ()
                try:
                    key = self._chosen(("kind", *kind))
                    link = self.keepers[key].link
                    link.settimeout(PATIENCE)  # TimeoutError is an OSError
                    stays = self._awaited(("kind", *kind))
                    request = json.dumps([str(folder.absolute()), *words]).encode()
                    handles = [file.fileno() for file in (*files, stays) if file is not None]
                    with stays or nullcontext():
                        socket.send_fds(link, [request], handles)
                    return int(link.recv(32))
                except (OSError, ValueError):
                    self._forget(key)
                    self.tries -= key == ()
        return None

    def _chosen(self, key: tuple[str, ...]) -> tuple[str, ...]:
        process = self.keepers.get(key)
        if process is not None:
            try:
                if process.is_ready():
                    return key
            except ConnectionError:
                self._forget(key)
        if () not in self.keepers:
            self._begin()
        return ()

    def _begin(self) -> None:
        if ctypes.CDLL(None, use_errno=True).prctl(SUBREAPER, 1, 0, 0, 0):
            raise OSError("cannot adopt")
        mine, theirs = _pair()
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-c", BEGIN], stdin=theirs.fileno(), stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env=self.environment, start_new_session=True,
            )  # fmt: skip
        process.returncode = 0  # `WarmProcess.end` waits for the process
        self.keepers[()] = WarmProcess(mine, process.pid)

    def _awaited(self, key: tuple[str, ...]) -> socket.socket | None:
        if key in self.keepers:
            return None
        if len(self.keepers) > MOST:
            self._forget(next(each for each in self.keepers if each))
        mine, theirs = _pair()
        self.keepers[key] = WarmProcess(mine)
        return theirs

    def _forget(self, key: tuple[str, ...]) -> None:
        if key in self.keepers:
            self.keepers.pop(key).end()


def _pair() -> tuple[socket.socket, socket.socket]:
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def _end(keepers: dict[Any, WarmProcess]) -> None:
    while keepers:
        keepers.popitem()[1].end()


def begin() -> NoReturn:
    gc.disable()
    link = socket.socket(fileno=os.dup(0))
    import karamelo_py.app.cli
    import karamelo_py.run.loop  # noqa: F401

    keep(link)


def keep(link: socket.socket) -> NoReturn:
    gc.collect()
    gc.freeze()
    gc.disable()
    os.chdir("/")  # allows the folder of the run to be removed
    with open(os.devnull, "r+b") as nothing:
        for at in range(3):
            os.dup2(nothing.fileno(), at)
    while True:
        request, files, *_ = socket.recv_fds(link, LONGEST, 3)
        if not request:
            os._exit(0)
        read, write = os.pipe()
        between = os.fork()
        if not between:
            pid = os.fork()
            if pid:
                os.write(write, str(pid).encode())
                os._exit(0)
            for end in (link, read, write):
                end.close() if end is link else os.close(end)
            _run(json.loads(request), *files)
        os.waitpid(between, 0)  # makes the run a child of the study
        os.close(write)
        link.send(os.read(read, 32))
        for file in (read, *files):
            os.close(file)


def _run(request: list[str], out: int, err: int, stays: int | None = None) -> NoReturn:
    from karamelo_py.app.start import main

    folder, *sys.argv[1:] = request
    study = os.environ.get(STUDY, "")
    for _ in range(1000):  # until the study has adopted it, within milliseconds
        if str(os.getppid()) == study:
            break
        time.sleep(0.002)
    os.setsid()  # Ctrl-C then reaches the study only
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
    from karamelo_py.language import registry

    clean = NOT_OURS not in sys.modules and not registry.foreign()
    if stays is not None and status == 0 and clean:
        os.environ[STUDY] = study
        with socket.socket(fileno=stays) as link:
            pid = os.fork()
            if not pid:
                keep(link)
            link.send(str(pid).encode())
    os._exit(status)
