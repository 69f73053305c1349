"""Disk cache of compiled kernels; its errors never stop a run.

A file holds one kernel for one list of argument types. Its name contains the fingerprint of all
that the code depends on (:mod:`~karamelo_py.compiler.fingerprint`); a checksum shows whether it is
complete. Since its content is executed, only files that nobody but this user or the administrator
can write are read. If anything is wrong with a file or the folder, the kernel is compiled as
without it, and the user is warned once.
"""

import contextlib
import contextvars
import errno
import functools
import hashlib
import os
import pickle
import platform
import re
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import platformdirs

from karamelo_py.compiler import compile_lock, machine
from karamelo_py.compiler.choices import WHOLE, Unknown, name_of
from karamelo_py.compiler.fingerprint import describe, fingerprint

VARIANTS = 4  # of a kernel for the same types: source versions kept
ROOM = 400e6  # bytes; above it, the least recently used files are deleted

_ENDING, _LOCK = ".kernel", ".lock"
_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_AS_IT_IS = (  # not a link, without waiting for a pipe
    getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
)
_OURS = re.compile(r"[\w.]+-[0-9a-f]{24}-[0-9a-f]{24}\.kernel")


def folder() -> Path:
    """Return the cache folder."""
    home = os.environ.get("KARAMELO_PY_CACHE") or platformdirs.user_cache_dir("karamelo-py")
    return Path(home) / "kernels"


def _refuse_of_others(about: os.stat_result) -> None:
    """Refuse a file that another user may have written."""
    if hasattr(os, "geteuid"):
        if about.st_uid not in (0, os.geteuid()):
            raise PermissionError(errno.EACCES, "it belongs to another user")
        if about.st_mode & _BY_OTHERS:
            raise PermissionError(errno.EACCES, "other users may write there")


def _guard(place: Path) -> None:
    """Refuse a folder that others can write to; close this user's folders to others."""
    for one in (place, place.parent):
        about = one.stat()
        if about.st_mode & stat.S_ISVTX:  # others may not delete files there
            continue
        if hasattr(os, "geteuid") and about.st_uid == os.geteuid() and about.st_mode & _BY_OTHERS:
            one.chmod(stat.S_IMODE(about.st_mode) & ~_BY_OTHERS)
            about = one.stat()
        _refuse_of_others(about)


def read(path: Path) -> bytes:
    """Read a file that only this user or the administrator can have written.

    Raises OSError if it belongs to another user, and ValueError if its content is damaged.
    """
    with open(os.open(path, os.O_RDONLY | _AS_IT_IS), "rb") as file:
        _guard(path.parent)
        _refuse_of_others(os.fstat(file.fileno()))
        data = file.read()
    if hashlib.sha256(data[32:]).digest() != data[:32]:
        raise ValueError("not what was written")
    return data[32:]


# Python shows a warning once for each text.
_warn = functools.partial(warnings.warn, category=RuntimeWarning)
_told = contextvars.ContextVar[Callable[[str], None]]("told", default=_warn)


def _trouble(error: OSError) -> None:
    _told.get()(f"compiled loops cannot be kept in {folder()}: {error.strerror or error}")


@contextlib.contextmanager
def telling(tell: Callable[[str], None]) -> Iterator[None]:
    """Report problems with the folder through `tell`, once, within this context."""
    told: list[str] = []

    def tell_once(text: str) -> None:
        if not told:
            told.append(text)
            tell(text)

    before = _told.get()
    _told.set(tell_once)
    try:
        yield
    finally:
        _told.set(before)


class KernelFiles:
    """The cached kernels of one function; a kernel that `load` cannot load does not count.

    `about` and the names of functions in its closure distinguish functions of one name (a function
    may create several); `beside` are other functions that its kernels may call.
    """

    def __init__(
        self, function: Callable, load: Callable[[Any], Any], about: str = "", beside: tuple = ()
    ):
        self._function, self._load, self._about = function, load, about
        self._roots = [function, *beside]

    def kernel(self, kinds: tuple, result: Any, compiled: Callable[[], tuple[Any, Any]]) -> Any:
        """Read a kernel, or compile it while other processes wait for the file."""
        try:
            key = self._key(kinds, result)
        except Unknown as what:
            self._tell_of_unknown(what)
            return compiled()[0]
        found = self._found(kinds, key)
        if found is None:
            with compile_lock.lock(folder() / f"{key}{_LOCK}"):
                # Another process may have compiled it in the meantime.
                found = self._found(kinds, key)
                if found is None:
                    found, codes = compiled()
                    self._save(kinds, key, found, codes)
        return found

    def _found(self, kinds: tuple, key: str) -> Any:
        """Read the kernel in a file; report and delete an incomplete one."""
        for path in self._files(key):
            try:
                choices, code = pickle.loads(read(path))
                stamp = fingerprint(self._roots, kinds, frozenset(choices))
                if stamp[:24] != path.stem.rpartition("-")[2]:
                    continue
                unit = pickle.loads(code)
                self._load(unit)
            except (FileNotFoundError, Unknown):  # deleted, or from sources that no longer exist
                continue
            except OSError as error:
                _trouble(error)
                continue
            except Exception:
                _told.get()(f"a file in {folder()} is damaged; the loop in it is compiled anew")
                with contextlib.suppress(OSError):
                    path.unlink()
                continue
            with contextlib.suppress(OSError):
                os.utime(path)
            return unit
        return None

    def _save(self, kinds: tuple, key: str, unit: Any, codes: Any) -> None:
        try:
            if isinstance(codes, Unknown):
                raise codes
            stamp = fingerprint(self._roots, kinds, unit.choices, codes)
            content = pickle.dumps((tuple(sorted(unit.choices)), pickle.dumps(unit)))
            path = folder() / f"{key}-{stamp[:24]}{_ENDING}"
            write(path, content)
            self._forget(key)
        except Unknown as what:
            self._tell_of_unknown(what)
        except OSError as error:
            _trouble(error)

    def _tell_of_unknown(self, what: Unknown) -> None:
        # Never silently: every run would compile it.
        _told.get()(f"the loop {self._name()} is compiled in every run: {what} cannot be followed")

    def _name(self) -> str:
        return re.sub(r"[^\w.]", "", f"{self._function.__module__}.{self._function.__qualname__}")

    def _key(self, kinds: tuple, result: Any) -> str:
        """Return the name of the function with a hash of the types and the machine."""
        words = [name_of(self._function), *_closed_over(self._function), *map(describe, kinds)]
        words += [describe(result) if result is not None else "", repr(machine.describe())]
        words.append(self._about)
        digest = hashlib.sha256("|".join([*words, _SETTING]).encode()).hexdigest()
        return f"{self._name()}-{digest[:24]}"

    def _files(self, key: str) -> list[Path]:
        try:
            names = [name for name in os.listdir(folder()) if name.startswith(key)]
        except (FileNotFoundError, NotADirectoryError):  # reported when a file is written
            return []
        except OSError as error:
            _trouble(error)
            return []
        return [folder() / name for name in names if _OURS.fullmatch(name)]

    def _forget(self, key: str) -> None:
        """Make room: delete old source versions of this kernel, and the oldest files."""
        ages = []
        for path in folder().iterdir():
            if _OURS.fullmatch(path.name):
                with contextlib.suppress(FileNotFoundError):
                    about = path.stat()
                    ages.append((about.st_mtime, about.st_size, path))
        ages.sort(reverse=True, key=lambda item: item[0])
        variants = [path for _, _, path in ages if path.name.startswith(key)]
        old = set(variants[VARIANTS:])
        room = ROOM
        for _, size, path in ages:
            room -= size
            if room < 0:
                old.add(path)
        for path in old:
            path.unlink(missing_ok=True)


def _closed_over(function: Callable) -> Iterator[str]:
    """Yield the names of the functions in the closure of a function."""
    for cell in getattr(function, "__closure__", None) or ():
        with contextlib.suppress(ValueError):  # it is still empty
            if hasattr(cell.cell_contents, "__qualname__"):
                yield name_of(cell.cell_contents)


_VERSIONS = platform.python_version(), numba.__version__, llvmlite.__version__, np.__version__
_SETTING = repr((_VERSIONS, [Path(file).read_bytes() for file in WHOLE]))  # common to all kernels


def write(path: Path, content: bytes) -> None:
    """Write a file for `read`, completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _guard(path.parent)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix="new-")
    try:
        with open(handle, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
