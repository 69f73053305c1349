"""Read text files in the usual encodings; refuse endless pipes."""

import os
import re
import stat
from pathlib import Path

LARGEST = 100_000_000  # bytes of a script or a table
_CODES = (
    (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"), (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)  # fmt: skip
# Shell substitutions <(command), and the read end of a pipe.
_PIPED = re.compile(r"/dev/(?:stdin|fd/\d+)|/proc/self/fd/\d+")


def read_bytes(path: Path, largest: int | None = LARGEST) -> bytes:
    """Read a regular file of at most `largest` bytes (None: any size).

    OSError if it is not regular or cannot be read.
    """
    piped = _PIPED.fullmatch(str(path)) is not None
    # Opening a pipe without a writer would block.
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0)
    flags |= 0 if piped else getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb") as file:
        mode = os.fstat(file.fileno()).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(0, "it is a folder")
        if not stat.S_ISREG(mode) and not (piped and stat.S_ISFIFO(mode)):
            raise OSError(0, "it is a pipe or a device, not a file")
        data = file.read() if largest is None else file.read(largest + 1)
    if largest is not None and len(data) > largest:
        raise OSError(0, f"it has more than {largest // 1_000_000} MB")
    return data


def read_text(path: Path, largest: int | None = LARGEST) -> str:
    """OSError as in `read_bytes`, ValueError if it is not text."""
    data = read_bytes(path, largest)
    for mark, code in _CODES:
        if data.startswith(mark):
            return data.decode(code, errors="replace")
    if b"\0" in data:
        raise ValueError("it is not a text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Old editors write Latin-1, in which every byte is valid.
        return data.decode("latin-1")
