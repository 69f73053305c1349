"""One of several processes compiles a kernel, the others wait for its file and read it.

A lock that the system drops when its process ends, on a file beside the kernel. It only saves work:
where there is no such lock, on a folder that is read-only or a file system that knows none, and
after a while in any case, each process compiles for itself.
"""

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from numba.core import event

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

WAITS = "karamelo_py:waits"  # an event of Numba's: to the user it is as if it compiled
PATIENCE = 120.0  # seconds; who holds a lock so long has been stopped, perhaps with others
PAUSE = 0.02  # seconds between two looks


class Turns(event.Listener):
    """The locks that this process holds, each until its kernel is written.

    Where one cannot be compiled all are given up: the process may stay for hours.
    """

    def __init__(self) -> None:
        self._held: dict[Path, int] = {}
        self._waits = True  # until that was in vain
        event.register("numba:compile", self)

    def on_start(self, _: event.Event) -> None:
        """Numba compiles."""

    def on_end(self, _: event.Event) -> None:
        """It has, or failed."""
        if sys.exc_info()[0] is not None:  # what the event itself says of this is wrong
            for path in [*self._held]:
                self.give(path)

    def take(self, path: Path) -> None:
        """Have the lock on `path`, if it can be had in time; others have done their work then."""
        if fcntl is None or path in self._held:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:  # nothing can be written there
            return
        locked = False
        try:
            locked = _locked(file)
            if not locked and self._waits:
                with event.trigger_event(WAITS):
                    self._waits = locked = _locked_in_time(file)
        except OSError:  # a file system without locks
            return
        finally:
            if locked:
                self._held[path] = file
            else:
                os.close(file)

    def give(self, path: Path) -> None:
        """Let others have the lock, if it is held."""
        file = self._held.pop(path, None)
        if file is not None:
            # Who waits has this very file open, and finds the kernel when it has the lock.
            with contextlib.suppress(OSError):
                path.unlink()
            with contextlib.suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_UN)  # for a process that was forked meanwhile, too
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


@contextlib.contextmanager
def giving(turns: Turns, path: Path) -> Iterator[None]:
    """Let others have the lock behind this, whatever happens."""
    try:
        yield
    finally:
        turns.give(path)
