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
    file = _taken(path)
    try:
        yield
    finally:
        if file is not None:
            # Who waits has this very file open, and finds the kernel when it has the lock.
            with contextlib.suppress(OSError):
                path.unlink()
            with contextlib.suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_UN)  # for a process that was forked meanwhile, too
            os.close(file)


def _taken(path: Path) -> int | None:
    """Open the file of a lock that is held now; None where there is none to be had."""
    global waits
    if fcntl is None:
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError:  # nothing can be written there
        return None
    locked = False
    try:
        locked = _locked(file)
        if not locked and waits:
            with waiting():
                waits = locked = _locked_in_time(file)
        return file if locked else None
    except OSError:  # a file system without locks
        return None
    finally:
        if not locked:
            os.close(file)


def _locked(file: int) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _locked_in_time(file: int) -> bool:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        time.sleep(PAUSE)
        if _locked(file):
            return True
    return False
