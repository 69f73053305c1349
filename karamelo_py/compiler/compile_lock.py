"""One of several processes compiles a kernel, the others wait for its file and read it.

A lock that the system drops when its process ends, on a file beside the kernel. It only saves work:
where there is no such lock, on a folder that is read-only or a file system that knows none, and
after a while in any case, each process compiles for itself.
"""

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PATIENCE = 120.0  # seconds; who holds a lock so long has been stopped, perhaps with others
PAUSE = 0.02  # seconds between two looks

waits = True  # until that was in vain
waiting = contextlib.nullcontext  # within it a process waits: to the user it is as if it compiled


@contextlib.contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the lock on `path`, if it can be had in time; others have done their work then."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):  # nothing can be written there, or nothing locked
            _take(path, held)
        yield


def _take(path: Path, held: contextlib.ExitStack) -> None:
    """Take the lock; `held` gives it back."""
    global waits
    if fcntl is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    held.callback(os.close, file)
    if not _locked(file, 0.0):
        if not waits:
            return
        with waiting():
            waits = _locked(file, PATIENCE)
        if not waits:
            return
    held.callback(fcntl.flock, file, fcntl.LOCK_UN)  # for a process that was forked meanwhile, too
    # Who waits has this very file open, and finds the kernel when it has the lock.
    held.callback(_take_away, path)


def _take_away(path: Path) -> None:
    with contextlib.suppress(OSError):  # the folder may be gone
        path.unlink()


def _locked(file: int, patience: float) -> bool:
    """Lock a file within so many seconds; whether that was possible."""
    end = time.monotonic() + patience
    while True:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(PAUSE)
