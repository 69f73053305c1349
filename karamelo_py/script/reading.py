"""Files of scripts become text."""

import difflib
from pathlib import Path

from karamelo_py.script.errors import ScriptError

_LARGEST_SCRIPT = 100_000_000


# What programs write beside scripts.
_WRITTEN = (
    *(".png", ".pdf", ".svg", ".gif", ".mp4", ".gz", ".bin", ".h5", ".vtu", ".pvd", ".csv", ".txt"),
    *(".LAMMPS", ".log", ".part"),
)


def scripts_in(folder: Path) -> list[str]:
    """List names of the files in a folder that may be scripts."""
    files = folder.iterdir() if folder.is_dir() else ()
    return sorted(file.name for file in files if file.suffix not in _WRITTEN and file.is_file())


def read_script(path: Path) -> str:
    """Read the text of a script file.

    Raises
    ------
    ScriptError
        If there is no such file, it cannot be read, or it is no text.
    """
    try:
        if path.is_dir():
            raise ScriptError(f"{path} is a folder", expected="the name of a script")
        if path.stat().st_size > _LARGEST_SCRIPT:
            raise ScriptError(f"{path} is too large for a script", expected="at most 100 MB")
        data = path.read_bytes()
    except FileNotFoundError:
        parent = path.parent
        close = difflib.get_close_matches(path.name, scripts_in(parent), n=1, cutoff=0.7)
        raise ScriptError(
            f"there is no file {path}"
            if parent.is_dir()
            else f"there is no file {path}: the folder {parent} does not exist",
            expected="the name of a script",
            hint=f"did you mean {parent / close[0]}?" if close else None,
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScriptError(f"{path} cannot be read: {reason}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data:
        raise ScriptError(f"{path} is not a text file", expected="a script")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Old editors write comments in Latin-1, where every byte is a character.
        return data.decode("latin-1")
