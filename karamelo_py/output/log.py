"""The log, in log.mpm (or log.csv) and on the terminal."""

import os
import re
import weakref
from pathlib import Path
from typing import TextIO

from karamelo_py.language.scene import Scene
from karamelo_py.output.files import Claim, claim, reported
from karamelo_py.output.quantity import LIMIT, Quantity
from karamelo_py.output.rhythm import ByTime, Rhythmic
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.terms import number_of

FILE = "log.mpm"
STEP_WIDTH = 10
NUMBER_WIDTH = 16  # characters of -1.234567891e-05


class Log(Rhythmic):
    r"""The log: a header, then rows.

    ``numpy.loadtxt("log.mpm", skiprows=1)`` and ``pandas.read_csv("log.mpm", sep=r"\\s+")`` read
    the log. Later runs append rows. If the columns change, a comment line (``#``) lists the new
    ones. In log.csv, commas separate the columns.
    """

    remembers = ("_header", "_end")

    def __init__(self, hub: Scene):
        self.hub = hub
        self.every: int | ByTime = 1
        self.file = Path(FILE)
        self.is_asked_for = False
        self.columns: list[Quantity] = []  # empty for the default: step, dt, time
        self.last_step: int | None = None
        self._file: TextIO | None = None
        self._claims: list[Claim] = []
        self._is_kept = True
        # Headings and numbers of each row, if a Python program reads them; otherwise None.
        self.rows: list[tuple[list[str], list[float]]] | None = None
        self._header: str | None = None
        self._end = 0
        self._widths: list[int] = []

    @property
    def path(self) -> Path:
        return self.hub.folder / self.file

    def begin(self) -> None:
        """Write the header to the terminal, and to the file if it is new."""
        if not self.columns:
            self.columns = [Quantity(self.hub, name) for name in ("step", "dt", "time")]
        headings = [column.heading for column in self.columns]
        least = {"Step": STEP_WIDTH}
        self._widths = [max(len(name), least.get(name, NUMBER_WIDTH)) for name in headings]
        header = _row(headings, self._widths)
        if self._file is None and self._end:
            self._go_on()
        if header != self._header:
            if self._file is None:
                self._open()
                self._put(headings)
            else:
                self._put(["# " + headings[0], *headings[1:]])
            self._header = header
            self.last_step = None
        self.hub.console.log_line(header, header=True)

    def write(self) -> None:
        numbers = [column.read() for column in self.columns]
        if self.rows is not None:
            self.rows.append(([column.heading for column in self.columns], numbers))
        # A blank leaves room for a minus sign, except in the first column: pandas would add one.
        cells = [str(x) if isinstance(x, int | str) else f"{x: .10g}" for x in numbers]
        cells[0] = cells[0].lstrip()
        self._put(cells)
        self.hub.console.log_line(_row(cells, self._widths))

    def resumed(self) -> None:
        if self._file is not None and self._is_kept:
            self._file.truncate(self._end)

    def close(self) -> None:
        if self._file is not None:
            file, self._file, self._claims = self._file, None, []
            with reported(self.path, "the log file "):  # reports a line that has failed before
                file.close()

    def _go_on(self) -> None:
        if not self.hub.output.writes:
            return
        size = self.path.stat().st_size if self.path.is_file() else 0
        if size < self._end:
            self.hub.warn(
                begins_anew(self.path),
                hint="karamelo-py SCRIPT -restart FILE in the folder of that run",
            )
            self._header, self._end = None, 0
            return
        self._open(self._end)

    def _open(self, end: int = 0) -> None:
        path = self.path
        if not self.hub.output.writes:
            return
        if not end and not self.is_asked_for and not _is_log(path):
            raise ScriptError(
                f"{path} exists and is not the log of a run",
                expected="a folder without such a file",
                hint="-log FILE or -out FOLDER sends the log elsewhere; -log "
                f"{self.file} overwrites it",
            )
        with reported(path, "the log file "):
            # Line buffered: rows reach the file even if the run is killed.
            self._file = path.open("a", buffering=1, encoding="utf-8", newline="\n")
            weakref.finalize(self, self._file.close)
            self._is_kept = path.is_file()  # False for special files such as /dev/null
            for claimed in [self.hub.folder.resolve(), *[path] * self._is_kept]:
                if (lock := claim(claimed)) is None:
                    raise ScriptError(
                        f"another run is writing to {claimed}",
                        expected="a separate folder for each run",
                        hint="-out FOLDER sends all files there",
                        code="busy",
                    )
                self._claims.append(lock)
            if self._is_kept:
                self._file.truncate(end)

    def _put(self, cells: list[str]) -> None:
        if not self.hub.output.writes:
            return
        assert self._file is not None
        if self.file.suffix == ".csv":
            line = ",".join(f'"{c}"' if "," in c else c.strip() for c in cells)
        else:
            line = _row(cells, self._widths)
        with reported(self.path, "the log file "):
            self._file.write(line + "\n")
            self._end = os.fstat(self._file.fileno()).st_size


def _is_log(path: Path) -> bool:
    try:
        with path.open(encoding="utf-8") as file:
            lines = [file.readline(1 << 16) for _ in range(4)]
    except FileNotFoundError:
        return True
    except UnicodeDecodeError:
        return False
    except OSError:
        return True  # when the log is opened, the error is reported
    head, *rows = [re.split(r"[\s,]+", line.strip()) for line in lines if line.strip()] or [[]]
    if not rows:
        return not head or bool({"Step", "dt", "Time"} & set(head))
    words = {k for k, name in enumerate(head) if name == LIMIT}
    return all(
        row[0] == "#"
        or all(k in words or number_of(cell) is not None for k, cell in enumerate(row))
        for row in rows
    )


def _row(cells: list[str], widths: list[int]) -> str:
    return " ".join(c.ljust(w) for c, w in zip(cells, widths, strict=True)).rstrip()


def begins_anew(path: Path) -> str:
    if not path.is_file():
        return f"the resumed run left no {path}: the file starts empty"
    return f"{path} has changed since the resumed run: the file starts empty"
