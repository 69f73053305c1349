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
    file = _taken(path) if fcntl else None
    try:
        yield
    finally:
        if file is not None:
            # Who waits has this very file open, and finds the kernel when it has the lock.
            path.unlink(missing_ok=True)
            fcntl.flock(file, fcntl.LOCK_UN)  # for a process that was forked meanwhile, too
            os.close(file)


def _taken(path: Path) -> int | None:
    """Open the file of a lock that is held now; None where there is none to be had."""
    global waits
    file = None
    with contextlib.suppress(OSError):  # nothing can be written there, or nothing locked
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        if _locked(file):
            return file
        if waits:
            with waiting():
                waits = _locked_in_time(file)
            if waits:
                return file
    if file is not None:
        os.close(file)
    return None


def _locked(file: int) -> bool:
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _locked_in_time(file: int) -> bool:
    end = time.monotonic() + PATIENCE
    while not (locked := _locked(file)) and time.monotonic() < end:
        time.sleep(PAUSE)
    return locked
