"""Complete files, locks, pictures and movies."""

import errno
import json
import os
import shutil
import subprocess
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

from karamelo_py.script.errors import ScriptError

FORMATS = ("png", "pdf", "svg")
_DISCARDED: ContextVar[Path | None] = ContextVar("discarded", default=None)


@contextmanager
def discarded() -> Iterator[None]:
    with TemporaryDirectory() as folder:
        token = _DISCARDED.set(Path(folder))
        try:
            yield
        finally:
            _DISCARDED.reset(token)


def folder_of_discarded() -> Path | None:
    return _DISCARDED.get()


@contextmanager
def whole(path: Path) -> Iterator[BinaryIO]:
    if folder_of_discarded() is not None:
        yield BytesIO()
        return
    temporary = path.with_name(f"{path.name}.part")
    with reported(path):
        try:
            with temporary.open("w+b") as file:
                yield file
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def write_whole(path: Path, text: str) -> None:
    with whole(path) as file:
        file.write(text.encode())


def read_json(path: Path) -> dict[str, Any]:
    with suppress(OSError, ValueError):
        return json.loads(path.read_text(encoding="utf-8"))
    return {}


@contextmanager
def continued(path: Path, start: int, tail: bytes) -> Iterator[BinaryIO]:
    """Open a file to write from byte `start` on (0: a new file).

    After an error, the file is truncated to `start`, and `tail` is appended.
    """
    with reported(path), path.open("r+b" if start else "wb") as file:
        try:
            file.seek(start)
            file.truncate()
            yield file
            file.flush()
        except BaseException:
            file.seek(start)
            file.truncate()
            file.write(tail)
            raise


def picture_format(path: Path) -> str:
    ending = path.suffix.lower().lstrip(".")
    if ending not in FORMATS:
        raise ScriptError(
            f"cannot draw a picture as '{path.name}'",
            argument="file",
            expected="a file name ending in .png, .pdf or .svg",
        )
    return ending


def savefig(figure: Any, path: Path) -> None:
    import matplotlib

    ending = picture_format(path)
    # Reproducible files need no date, and a fixed salt for the ids in SVG.
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(ending)
    with matplotlib.rc_context({"svg.hashsalt": "karamelo-py"}), unwarned(), whole(path) as file:
        figure.savefig(file, format=ending, metadata=undated)


@contextmanager
def unwarned() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def reported(path: Path, kind: str = "") -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ScriptError(f"cannot write {kind}{path}: {error.strerror or error}") from error


def movie_format(path: Path) -> str:
    ending = path.suffix.lower().lstrip(".")
    if ending not in ("gif", "mp4") or "*" in path.name:
        raise ScriptError(
            f"'{path.name}' is not a name for a movie",
            argument="file",
            expected="a file name without * that ends in .gif or .mp4",
        )
    if ending == "mp4" and shutil.which("ffmpeg") is None:
        raise ScriptError(
            "an .mp4 is made by the program ffmpeg, which is not installed",
            argument="file",
            expected=".gif, or ffmpeg",
            hint=path.stem + ".gif",
        )
    return ending


class Frames:
    remembers = ("_frames",)

    def __init__(self, fps: float):
        self.fps = fps
        self._frames: list[bytes] = []
        self._saved = 0

    def add(self, draw: Callable[[BinaryIO], None]) -> None:
        file = BytesIO()
        draw(file)
        self._frames.append(file.getvalue())

    def save(self, path: Path) -> None:
        if len(self._frames) == self._saved:
            return
        with whole(path) as file:
            if path.suffix.lower() == ".gif":
                self._save_gif(file)
            else:
                self._save_mp4(path, file)
        self._saved = len(self._frames)

    def _save_gif(self, file: BinaryIO) -> None:
        from PIL import Image

        first, *others = (Image.open(BytesIO(frame)) for frame in self._frames)
        hundredths = max(2, round(100 / self.fps))  # viewers slow down frames shorter than 0.02 s
        first.save(
            file,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=10 * hundredths,
            loop=0,
        )

    def _save_mp4(self, path: Path, file: BinaryIO) -> None:
        command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "image2pipe", "-c:v", "png"]
        command += ["-framerate", f"{self.fps:g}", "-i", "-", "-f", "mp4"]
        # Players need even sizes, and chroma at half resolution.
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", file.name]
        done = subprocess.run(command, input=b"".join(self._frames), capture_output=True)
        if done.returncode != 0:
            last = (done.stderr.decode(errors="replace").strip().splitlines() or ["?"])[-1]
            raise ScriptError(f"ffmpeg could not make {path}: {last}")


class Claim:
    """Lock of a folder or file that one program writes, until `release` or the program ends."""

    def __init__(self, handle: int):
        self.release = weakref.finalize(self, os.close, handle)


# Claims by device and inode, so that all simulations of a process use the same one.
_held: weakref.WeakValueDictionary[tuple[int, int], Claim] = weakref.WeakValueDictionary()


def claim(path: Path) -> Claim | None:
    """Lock a path, if the system supports locks; return None if another program has locked it."""
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
