"""A lock: one process compiles a kernel while other processes wait for its file.

The lock only saves work. Without locks (in read-only folders and on some file systems), and after a
timeout, each process compiles. The system releases a lock when its process ends.
"""

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

from karamelo_py.compiler.trace.session import session

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PATIENCE = 120.0  # seconds after which the lock's holder has probably been stopped
PAUSE = 0.02  # seconds between attempts

waiting = contextlib.nullcontext  # context of a waiting process, which reports compilation


@contextlib.contextmanager
def lock(path: Path) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # folders may be read-only or without locks
            _take(path, stack)
        yield


def _take(path: Path, stack: contextlib.ExitStack) -> None:
    if fcntl is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    stack.callback(os.close, file)
    if not _locked(file, 0.0):
        if not session.waits:
            return
        with waiting():
            session.waits = _locked(file, PATIENCE)
        if not session.waits:
            return
    stack.callback(fcntl.flock, file, fcntl.LOCK_UN)  # also unlocks if forked since
    # Waiting processes have this file open, and find the kernel when they get the lock.
    stack.callback(_take_away, path)


def _take_away(path: Path) -> None:
    with contextlib.suppress(OSError):  # the folder may have been deleted
        path.unlink()


def _locked(file: int, patience: float) -> bool:
    end = time.monotonic() + patience
    while True:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(PAUSE)
