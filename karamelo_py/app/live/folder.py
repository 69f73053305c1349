"""Live page of a folder with dumps and a log."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.live import frames
from karamelo_py.app.live.frames import Frame, number_in, plain
from karamelo_py.app.live.server import Server
from karamelo_py.app.plot import read_log
from karamelo_py.output.snapshots import Snapshot, read
from karamelo_py.script.errors import ScriptError

PAUSE = 0.5  # seconds between polls
FILES = 8  # files read per poll, few so that the first ones appear early
WHOLE = (".h5", ".hdf5", ".pvd")  # files that contain many states


class FolderPage:
    """The page of a folder; raises ScriptError without a log or particle dump."""

    def __init__(self, folder: Path):
        if not folder.is_dir():
            raise ScriptError(f"{folder} is not a folder", expected="the folder of a run")
        self.folder = folder
        self._states: list[tuple[Path, int, int, float, int]] = []
        self._seen: dict[Path, float] = {}
        self._read: dict[Path, int] = {}
        self._widths: dict[str, int] = {}  # number of columns by dump name
        self._log: dict[str, np.ndarray] = {}
        self._columns: list[str] = []
        self._dimension, self._column, self._more = 2, "", False
        self.look()
        if not self._states and not self._log:
            raise ScriptError(
                f"there is neither a log nor a dump of points in {folder}",
                expected="the folder of a run: log.mpm, files of dump particle, hdf5 or vtk",
            )
        self.server = Server(
            frames.PAGE, self._news, {"frame": self._frame}, {"column": self._choose}
        )

    def follow(self) -> None:
        while True:
            if self.look():
                self.server.changed()
            if not self._more:
                time.sleep(PAUSE)

    def look(self) -> bool:
        log, before = read_log(self.folder), len(self._states)
        grown = len(next(iter(log.values()), ())) != len(next(iter(self._log.values()), ()))
        self._log, files = log, 0
        for path in self._dumps():
            if files == FILES:
                break
            try:
                changed = path.stat().st_mtime
                if self._seen.get(path) == changed:
                    continue
                count = self._read.get(path, 0)
                for index, snapshot in enumerate(read(path, count), count):
                    self._add(path, index, snapshot)
                    self._read[path] = index + 1
                self._seen[path], files = changed, files + 1
            except (ScriptError, OSError):
                continue
        self._more = files == FILES
        return grown or len(self._states) > before

    def _dumps(self) -> list[Path]:
        kinds: dict[str, list[Path]] = {}
        for path in sorted(self.folder.iterdir()):
            if path.is_file() and (path.suffix in WHOLE or _is_text_dump(path)):
                kinds.setdefault(re.sub(r"\d+", "#", path.name), []).append(path)
        for kind, paths in kinds.items():
            if not self._widths.get(kind):
                self._widths[kind] = _width(paths[0])
        return kinds[max(kinds, key=self._widths.__getitem__)] if kinds else []

    def _add(self, path: Path, index: int, snapshot: Snapshot) -> None:
        columns = snapshot.columns
        if not len(columns.get("x", ())):  # there are no points or no positions
            return
        self._columns = self._columns or [name for name in columns if name not in "xyz"]
        if not self._states:
            directions = [axis for axis in "yz" if np.ptp(columns.get(axis, 0.0)) > 0]
            self._dimension = 3 if "z" in directions else 1 + len(directions)
            preferred = [name for name in ("seq", "type") if name in columns]
            self._column = [*preferred, *self._columns][0]
        self._states.append((path, index, snapshot.step, float(snapshot.time), len(columns["x"])))

    def _news(self, seen: int) -> tuple[int, dict]:
        log = self._log
        count = len(next(iter(log.values()), ()))
        times = log.get("Time", log.get("Step", np.arange(count)))
        rows = [
            {
                "step": int(log["Step"][k]) if "Step" in log else k,
                "time": float(times[k]), "gain": None, "limit": "",
                "dt": plain(float(log["dt"][k])) if "dt" in log else None,
                "log": {name: plain(_number(values[k])) for name, values in log.items()},
            }
            for k in range(seen, count)
        ]  # fmt: skip
        listed = [
            [k, step, plain(time), self._column, count]
            for k, (_, _, step, time, count) in sorted(
                enumerate(self._states), key=lambda state: state[1][2]
            )
        ]
        news: dict[str, Any] = {
            "rows": rows, "frames": listed, "flags": [], "paused": False,
            "unwatched": "shown on the page of a run; a log does not contain it",
        }  # fmt: skip
        if not seen:
            news["about"] = {
                "title": self.folder.resolve().name, "dimension": self._dimension,
                "columns": self._columns, "column": self._column,
                "method": "", "bounds": [], "steers": False,
            }  # fmt: skip
        return count, {**news, "over": False}

    def _frame(self, words: Mapping[str, str]) -> bytes | None:
        k = number_in(words)
        if not 0 <= k < len(self._states):
            return None
        path, index, step, moment, _ = self._states[k]
        columns = next(read(path, index)).columns
        count, axes = len(columns["x"]), "xyz"[: self._dimension]
        columns = {"id": np.arange(count), "type": np.zeros(count), **columns}
        frame = Frame.of_columns(step, moment, axes, self._column, read=columns.__getitem__)
        return frame.numbers.tobytes()

    def _choose(self, words: Mapping[str, str]) -> None:
        if words.get("name") in self._columns:
            self._column = words["name"]
            self.server.changed()


def _is_text_dump(path: Path) -> bool:
    if path.suffix == ".gz":
        return True
    try:
        with path.open("rb") as file:
            return file.read(6) == b"ITEM: "
    except OSError:
        return False


def _width(path: Path) -> int:
    try:
        return len(next(read(path)).columns)
    except (ScriptError, StopIteration, OSError):
        return 0


def _number(value: object) -> float | None:
    return float(value) if np.issubdtype(np.asarray(value).dtype, np.number) else None
