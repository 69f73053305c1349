"""Files in the cache folder."""

import contextlib
import contextvars
import errno
import functools
import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import platformdirs

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
# Where the system has these flags, links are not followed and pipes not waited for.
_AS_IT_IS = sum(vars(os).get(flag, 0) for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))


def folder() -> Path:
    home = os.environ.get("KARAMELO_PY_CACHE") or platformdirs.user_cache_dir("karamelo-py")
    return Path(home) / "kernels"


def _refuse_of_others(about: os.stat_result) -> None:
    if hasattr(os, "geteuid"):
        if about.st_uid not in (0, os.geteuid()):
            raise PermissionError(errno.EACCES, "it belongs to another user")
        if about.st_mode & _BY_OTHERS:
            raise PermissionError(errno.EACCES, "other users can write to it")


def _guard(directory: Path) -> None:
    """Raise an error if other users can write to a folder; make the user's folders private."""
    for one in (directory, directory.parent):
        about = one.stat()
        if about.st_mode & stat.S_ISVTX:  # other users may not delete files there
            continue
        if hasattr(os, "geteuid") and about.st_uid == os.geteuid() and about.st_mode & _BY_OTHERS:
            one.chmod(stat.S_IMODE(about.st_mode) & ~_BY_OTHERS)
            about = one.stat()
        _refuse_of_others(about)


def read(path: Path) -> bytes:
    """Read a file that only this user or the administrator can have written.

    Raises OSError if another user can write it, and ValueError if it is damaged.
    """
    with open(os.open(path, os.O_RDONLY | _AS_IT_IS), "rb") as file:
        _guard(path.parent)
        _refuse_of_others(os.fstat(file.fileno()))
        data = file.read()
    if hashlib.sha256(data[32:]).digest() != data[:32]:
        raise ValueError("the checksum is wrong")
    return data[32:]


_warn = functools.partial(warnings.warn, category=RuntimeWarning)
_reporter = contextvars.ContextVar[Callable[[str], None]]("reporter", default=_warn)


def report(text: str) -> None:
    _reporter.get()(text)


def report_error(error: OSError) -> None:
    report(f"compiled loops cannot be stored in {folder()}: {error.strerror or error}")


@contextlib.contextmanager
def telling(tell: Callable[[str], None]) -> Iterator[None]:
    """Report problems through `tell` in this context, each once."""
    texts: list[str] = []

    def tell_once(text: str) -> None:
        if not texts:
            texts.append(text)
            tell(text)

    before = _reporter.set(tell_once)
    try:
        yield
    finally:
        _reporter.reset(before)


def write(path: Path, content: bytes) -> None:
    """Write a file that `read` accepts, completely or not at all."""
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
