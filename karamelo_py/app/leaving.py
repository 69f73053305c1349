"""The end of a program that is interrupted before it has begun, with a word about it.

An interrupt in the midst of an import can come out as any error; while nothing is open yet, the
program just ends.
"""

import os

SIGNALLED = 128  # as a shell reports a program that a signal ended: this and its number
INTERRUPTED = SIGNALLED + 2


def _leave(*_):
    os.write(2, b"error: interrupted\n")
    os._exit(INTERRUPTED)


# Nothing more is imported here: until `leaving_at_once` is at work, Python tells of an interrupt.
try:
    import signal
except KeyboardInterrupt:
    _leave()


STUDY = "KARAMELO_PY_STUDY"  # the number of the process whose run this one is
_DEATH_SIGNAL = 1  # of Linux's prctl: sent when the parent ends


def end_with(study: int) -> None:
    """Let this run end with its study, however that ends; of Linux."""
    import ctypes
    import sys

    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    try:
        os.kill(study, 0)
    except ProcessLookupError:  # it has ended before that
        os._exit(SIGNALLED + signal.SIGKILL)
    except OSError:
        pass


class leaving_at_once:
    """Let Ctrl-C end the program on the spot: for imports."""

    def __enter__(self) -> None:
        try:
            self.before = signal.signal(signal.SIGINT, _leave)
        except ValueError:  # not in the main thread, which gets the signals
            self.before = None

    def __exit__(self, *_) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)
