"""Read text files in the usual encodings; refuse endless pipes."""

import difflib
import os
import re
import stat
from pathlib import Path

from karamelo_py.script.errors import ScriptError

LARGEST = 100_000_000  # bytes of a script or a table
_CODES = (
    (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"), (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)  # fmt: skip
# Paths of pipes, and of process substitutions <(command) in a shell.
_PIPED = re.compile(r"/dev/(?:stdin|fd/\d+)|/proc/self/fd/\d+")
# Endings of files that runs write next to their scripts.
_WRITTEN = (
    *(".png", ".pdf", ".svg", ".gif", ".mp4", ".gz", ".bin", ".h5", ".vtu", ".pvd", ".csv", ".txt"),
    *(".LAMMPS", ".log", ".part"),
)


def read_bytes(path: Path, largest: int | None = LARGEST) -> bytes:
    """Read at most `largest` bytes; raises OSError."""
    piped = _PIPED.fullmatch(str(path)) is not None
    # Opening a pipe that has no writer would block; Windows lacks this flag.
    more = 0 if piped else vars(os).get("O_NONBLOCK", 0)
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | more)) as file:
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
    """Read a text. Raises OSError, or ValueError if the file is not a text."""
    data = read_bytes(path, largest)
    for mark, code in _CODES:
        if data.startswith(mark):
            return data.decode(code, errors="replace")
    if b"\0" in data:
        raise ValueError("it is not a text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Old editors use Latin-1, in which all bytes are valid.
        return data.decode("latin-1")


def refuse_decimal_commas(path: Path, text: str, argument: str) -> None:
    """Raise ScriptError if a table has decimal commas between other separators."""
    for number, line in enumerate(text.splitlines(), 1):
        row = line.partition("#")[0].strip()
        if re.search(r"\d,\d", row) and re.search(r"[;\t]|\d,\d+ +[-+]?\d+,\d", row):
            message = f"line {number} of {path} has decimal commas: {row}"
            expected = "decimal points: " + row.replace(",", ".")
            raise ScriptError(message, expected=expected, argument=argument)


def read_script(path: Path) -> str:
    try:
        return read_text(path)
    except IsADirectoryError:
        expected = "the name of a script"
        raise ScriptError(f"{path} is a folder", expected=expected, code="file") from None
    except FileNotFoundError:
        parent = path.parent
        files = parent.iterdir() if parent.is_dir() else ()
        scripts = sorted(f.name for f in files if f.suffix not in _WRITTEN and f.is_file())
        close = difflib.get_close_matches(path.name, scripts, n=1, cutoff=0.75)
        where = "" if parent.is_dir() else f": the folder {parent} does not exist"
        raise ScriptError(
            f"there is no file {path}{where}",
            code="no-file",
            expected="the name of a script",
            hint=f"did you mean {parent / close[0]}?" if close else None,
        ) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        message = f"{path} cannot be read: {reason}"
        raise ScriptError(message, expected="a script, which is a text file", code="file") from None
