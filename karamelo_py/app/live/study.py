"""The live page of a study."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.live.frames import plain
from karamelo_py.app.live.server import Server
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies.case import COLUMNS, Row, command_of, said_in, worded

MOST = 400  # rows of a log drawn on a page
LINES = 12


class StudyPage:
    """The page of a study. `stopped` is set if a viewer ends the study on the page.

    `recorded` are names of recorded values, `axes` the initial axes of the chart; folders are
    relative to `base`.
    """

    def __init__(
        self, script: Path, names: Sequence[str], recorded: Sequence[str], *,
        axes: Sequence[str] = (), base: Path = Path(),
    ):  # fmt: skip
        self.stopped = threading.Event()
        self._judged: Callable[[Row], Row] = dict
        self._script, self._names, self._base = script, [*names], base
        self._about = {
            "title": str(script), "names": self._names, "recorded": [*recorded],
            "facts": [name for name in COLUMNS if name != "seconds_spread"], "axes": [*axes],
        }  # fmt: skip
        self._rows: list[Row] = []
        self._running: list[tuple[str, float, str]] = []
        self._progress: dict[str, Any] = {}
        self._folders: dict[str, Path] = {}
        self._cases: dict[str, dict[str, str]] = {}
        self.server = Server(
            Path(__file__).with_name("study.html"), self._news, {"run": self._run},
            {"stop": lambda words: self.stopped.set()},
        )  # fmt: skip
        atexit.register(self._end)

    def _end(self) -> None:
        whole = len(self._rows) >= self._progress.get("of", 0) or self._progress.get("most")
        ended = "been stopped" if self.stopped.is_set() else "finished" if whole else "ended early"
        self._running, self._progress = [], {**self._progress, "over": True, "ended": ended}
        self.server.changed()
        self.server.close()

    def judge(self, judged: Callable, colours: Mapping[str, str]) -> None:
        """Colour runs by class.

        ``judged(row)`` adds class and reason to a row; `colours` gives the colour of each class.
        """
        self._judged, self._about["classes"] = judged, {**colours}

    def follow(
        self,
        rows: Sequence[Row],
        waiting: Sequence[tuple[Mapping[str, str], Path]],
        running: Sequence[tuple[Mapping[str, str], Path, float, str]],
        **progress: Any,
    ) -> None:
        for row in rows[len(self._rows) :]:
            case = {name: row[name] for name in self._names}
            self._rows.append({**self._judged(row), "title": worded(case)})
            self._cases[worded(case)] = case
            self._folders[worded(case)] = self._base / row["folder"]
        for case, folder in (*waiting, *((case, folder) for case, folder, *_ in running)):
            self._folders[worded(case)] = folder
            self._cases[worded(case)] = dict(case)
        self._running = [(worded(case), since, at) for case, _, since, at in running]
        self._progress = progress
        self.server.changed()

    def _news(self, seen: Any) -> tuple[Any, dict]:
        first_row, first_case = seen or (0, 0)
        rows, cases = self._rows[first_row:], [*self._cases.items()][first_case:]
        news = {
            "running": self._running, "cases": dict(cases),
            "rows": [{name: plain(value) for name, value in row.items()} for row in rows],
            **self._progress,
        }  # fmt: skip
        if not seen:
            news["about"] = self._about
        return (first_row + len(rows), first_case + len(cases)), news

    def _run(self, words: Mapping[str, str]) -> dict | None:
        folder = self._folders.get(words.get("title", ""))
        if folder is None:
            return None
        lines = [line for name in ("err.txt", "out.txt") for line in
                 said_in(folder / name).splitlines()]  # fmt: skip
        columns = {
            name: [plain(float(value)) for value in values[_some(len(values))]]
            for name, values in read_log(folder).items()
            if np.issubdtype(values.dtype, np.number)
        }
        command = command_of(self._script, self._cases[words["title"]])
        return {"said": lines[-LINES:], "columns": columns, "command": command}


def _some(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int))
