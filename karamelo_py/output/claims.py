"""Locks on output folders and files: two programs never write to one at once."""

import errno
import os
import weakref
from pathlib import Path


class Claim:
    """Lock until `release` or the end of the program."""

    def __init__(self, handle: int):
        self.release = weakref.finalize(self, os.close, handle)


# By device and inode: simulations of one process share a claim.
_held: weakref.WeakValueDictionary[tuple[int, int], Claim] = weakref.WeakValueDictionary()


def claim(path: Path) -> Claim | None:
    """Lock a folder or file, if the system can; None if another program has locked it."""
    try:
        import fcntl

        handle = os.open(path, os.O_RDONLY)
    except (ImportError, OSError):
        return Claim(os.open(os.devnull, os.O_RDONLY))
    about = os.fstat(handle)
    key = about.st_dev, about.st_ino
    current = _held.get(key)
    if current is not None and current.release.alive:
        os.close(handle)
        return current
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            os.close(handle)
            return None
    _held[key] = made = Claim(handle)
    return made
