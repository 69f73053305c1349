"""Lock on an output folder, so that two programs do not write to it at once."""

import errno
import os
import weakref
from pathlib import Path


class Claim:
    """Lock on a folder, held until `release` or the end of the program."""

    def __init__(self, handle: int):
        self.release = weakref.finalize(self, os.close, handle)


# One claim per folder and process: simulations of one process may both use it.
_held: weakref.WeakValueDictionary[tuple[int, int], Claim] = weakref.WeakValueDictionary()


def claim(folder: Path) -> Claim | None:
    """Lock a folder; return None if another program has locked it.

    On file systems without locks, and on Windows, the folder is always granted.
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
