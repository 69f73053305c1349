"""Movies from pictures: GIF through Pillow, MP4 through ffmpeg where there is one."""

import io
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from karamelo_py.output.files import whole
from karamelo_py.script.errors import ScriptError


def movie_format(path: Path) -> str:
    """Read the format that the name of a movie asks for: gif, or mp4 where it can be made."""
    ending = path.suffix.lower().lstrip(".")
    if ending not in ("gif", "mp4") or "*" in path.name:
        raise ScriptError(
            f"'{path.name}' is no name for a movie",
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
    """Pictures that become a movie of `fps` in a second. They are kept as PNG, which are small."""

    remembers = ("_frames",)

    def __init__(self, fps: float):
        self.fps = fps
        self._frames: list[bytes] = []
        self._saved = 0

    def add(self, draw: Callable[[BinaryIO], None]) -> None:
        """Take a picture that `draw` writes as PNG."""
        file = io.BytesIO()
        draw(file)
        self._frames.append(file.getvalue())

    def save(self, path: Path) -> None:
        """Write the movie, if there is a frame that it does not have yet."""
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

        first, *others = (Image.open(io.BytesIO(frame)) for frame in self._frames)
        first.save(
            file,
            format="GIF",
            save_all=True,
            append_images=others,
            # Hundredths of a second is what a GIF knows, and viewers slow down what is below two.
            duration=max(20, 10 * round(100 / self.fps)),
            loop=0,
        )

    def _save_mp4(self, path: Path, file: BinaryIO) -> None:
        command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "image2pipe", "-c:v", "png"]
        command += ["-framerate", f"{self.fps:g}", "-i", "-"]
        # Players want even sizes and colours at half the resolution.
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
        command += ["-f", "mp4", file.name]
        done = subprocess.run(command, input=b"".join(self._frames), capture_output=True)
        if done.returncode != 0:
            last = (done.stderr.decode(errors="replace").strip().splitlines() or ["?"])[-1]
            raise ScriptError(f"ffmpeg could not make {path}: {last}")
