"""End with a message if the program is interrupted during its imports.

An interrupt during an import can raise any exception.
"""

import os

SIGNALLED = 128  # exit status minus the number of the signal
INTERRUPTED = SIGNALLED + 2


def _leave(*_):
    os.write(2, b"error: interrupted\n")
    os._exit(INTERRUPTED)


# Nothing is imported before `leaving_at_once`, as Python would print a traceback if interrupted.
try:
    import signal
except KeyboardInterrupt:
    _leave()


STUDY = "KARAMELO_PY_STUDY"  # environment variable with the pid of a study
_DEATH_SIGNAL = 1  # argument of prctl: signal to send when the parent ends


def end_with(study: int) -> None:
    import ctypes
    import sys
    from threading import Thread

    if sys.platform != "linux":
        Thread(target=_watch, args=(study,), daemon=True).start()
        return
    ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    try:
        os.kill(study, 0)
    except ProcessLookupError:
        os._exit(SIGNALLED + signal.SIGKILL)
    except OSError:
        pass


def _watch(study: int) -> None:
    """End this process when the study ends, if the system does not end it."""
    import time

    import psutil

    while psutil.pid_exists(study):
        time.sleep(1)
    os._exit(SIGNALLED)


class leaving_at_once:
    def __enter__(self) -> None:
        try:
            self.before = signal.signal(signal.SIGINT, _leave)
        except ValueError:  # this is not the main thread
            self.before = None

    def __exit__(self, *_) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)
