"""Exit with a message if the program is interrupted during its imports.

An interrupt within an import may surface as any error; nothing is open yet, so the program just
ends.
"""

import os

SIGNALLED = 128  # exit status of a shell for a signal: this plus its number
INTERRUPTED = SIGNALLED + 2


def _leave(*_):
    os.write(2, b"error: interrupted\n")
    os._exit(INTERRUPTED)


# No more imports here: until `leaving_at_once` is active, Python reports an interrupt.
try:
    import signal
except KeyboardInterrupt:
    _leave()


STUDY = "KARAMELO_PY_STUDY"  # process number of the study that started this run
_DEATH_SIGNAL = 1  # of Linux's prctl: signal sent when the parent ends


def end_with(study: int) -> None:
    """End this run when its study ends, for whatever reason (Linux)."""
    import ctypes
    import sys

    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    try:
        os.kill(study, 0)
    except ProcessLookupError:  # it has ended already
        os._exit(SIGNALLED + signal.SIGKILL)
    except OSError:
        pass


class leaving_at_once:
    """Let Ctrl-C end the program immediately, during imports."""

    def __enter__(self) -> None:
        try:
            self.before = signal.signal(signal.SIGINT, _leave)
        except ValueError:  # not in the main thread, which gets signals
            self.before = None

    def __exit__(self, *_) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)
