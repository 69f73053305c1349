"""A folder in which one program writes: claimed while it does, however it ends."""

import errno
import os
import weakref
from pathlib import Path


class Claim:
    """Hold a folder, until `release` or the end of the program."""

    def __init__(self, handle: int):
        self.release = weakref.finalize(self, os.close, handle)


# Within a program a folder is claimed once: it knows of its own simulations.
_held: weakref.WeakValueDictionary[tuple[int, int], Claim] = weakref.WeakValueDictionary()


def claim(folder: Path) -> Claim | None:
    """Claim a folder; None where another program does.

    Of file systems without locks, and of Windows, others are none of our business.
    """
    try:
        import fcntl

        handle = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        return Claim(os.open(os.devnull, os.O_RDONLY))
    about = os.fstat(handle)
    key = about.st_dev, about.st_ino
    known = _held.get(key)
    if known is not None and known.release.alive:
        os.close(handle)
        return known
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            os.close(handle)
            return None
    _held[key] = made = Claim(handle)
    return made
