"""Run the cases of a study; cases with known outcomes do not run again."""

from __future__ import annotations

import gc
import json
import os
import socket
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from karamelo_py.app.studies import variables
from karamelo_py.app.studies.case import (
    CaseOutcome,
    Launch,
    Refused,
    Row,
    folder_name,
    kind_of,
    record_of,
)
from karamelo_py.app.studies.records import Recorded, row, write
from karamelo_py.output.console import duration
from karamelo_py.output.files import Claim, claim, reported, write_whole
from karamelo_py.output.record import surroundings
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.terms import number_of

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from karamelo_py.app.live.study import StudyPage

_FACTS = ("seconds", "points", "steps")
HERE = socket.gethostname()
OF_MACHINE = ("processor", "cores", "system", "versions")
_STATUS = 24  # smallest width of the status while facts are shown
LISTED = 10  # first and last rows shown on the terminal


class Pool(Protocol):
    size: int  # number of simultaneous cases

    def submit(self, case: Mapping[str, str], folder: Path) -> Future:
        """Start a case whose files go to `folder`; return a future of its outcome."""

    def machine(self, folder: Path) -> str:
        """Return the machine on which the case of a folder runs, if known."""

    def close(self) -> None:
        """End all running cases."""


class Here:
    def __init__(self, launch: Launch, jobs: int):
        self.launch, self.size, self.pool = launch, jobs, ThreadPoolExecutor(jobs)

    def submit(self, case: Mapping[str, str], folder: Path) -> Future:
        return self.pool.submit(self.launch.run, case, folder)

    def machine(self, folder: Path) -> str:
        return HERE

    def close(self) -> None:
        self.launch.stop.set()
        self.pool.shutdown(wait=True, cancel_futures=True)


@dataclass
class Study:
    launch: Launch
    out: Path  # file of the table or picture, next to the folder of the runs
    names: list[str]
    items: Sequence[Recorded]
    place: Pool
    again: bool = False
    title: str = ""
    strict: bool = False  # a refused variant ends the study
    most: int = 0  # largest number of runs of an adaptive study; 0 if `run` gets all cases
    writes: bool = True  # write the table after each run
    page: StudyPage | None = None  # live page (--live)
    facts: dict[str, Any] = field(default_factory=dict)  # written to the file next to the table
    rows: dict[tuple[str, ...], Row] = field(default_factory=dict)
    order: dict[tuple[str, ...], None] = field(default_factory=dict)  # rows of the table, in order
    machines: dict[str, Any] = field(default_factory=dict)  # processor and versions of each machine
    claim: Claim | None = None  # lock of the folder
    ran: int = 0
    next_write: float = 0.0  # time when the table must be written next
    begun: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        self.folder = self.out.with_suffix("")

    def knows(self, case: Mapping[str, str]) -> bool:
        kept = not self.again and self.launch.kept(case, self.folder / folder_name(case))
        return tuple(case.values()) in self.rows or bool(kept)

    def describe(self) -> None:
        how = {"threads": self.launch.threads, "jobs": self.place.size, **surroundings()}
        made = {"script": str(self.launch.script), **self.facts, **how, "machines": self.machines}
        write_whole(self.out.with_suffix(".json"), json.dumps(made, indent=1) + "\n")

    def claim_folder(self) -> None:
        with reported(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        self.claim = claim(self.folder)
        if self.claim is None:
            raise ScriptError(
                f"another study runs in {self.folder}",
                expected="wait for it, or give the table another name",
                hint=f"-o {self.out.stem}-2{self.out.suffix}",
            )

    def write(self) -> None:
        if self.writes and self.rows:
            begun = time.perf_counter()
            write(self.out, [self.rows[key] for key in self.order if key in self.rows])
            self.next_write = time.perf_counter() + 20 * (time.perf_counter() - begun)

    def run(self, cases: Sequence[Mapping[str, str]]) -> list[Row]:
        """Run cases. An interrupt ends running cases; finished ones are stored."""
        waiting = []
        self.order.update(dict.fromkeys(tuple(case.values()) for case in cases))
        for case in cases:
            if tuple(case.values()) in self.rows:
                continue
            folder = self.folder / folder_name(case)
            outcome = None if self.again else self.launch.kept(case, folder)
            if outcome is not None:
                self._put(case, outcome)
            else:
                waiting.append((case, folder))
        self.write()
        if self.page and self.rows and not waiting:
            self.page.follow(list(self.rows.values()), (), (), of=len(cases))
        if waiting:
            try:
                display = _Display(self, len(waiting))
                with display.bar:
                    self._run(waiting, display)
            except KeyboardInterrupt:
                where = f"in {self.out}" if self.writes else "kept"
                of = f"at most {self.most}" if self.most else str(len(cases))
                state = f"{len(self.rows)} of {of} runs are {where}"
                print(f"{state}; the same command continues with the rest", file=sys.stderr)
                raise
        return [self.rows[tuple(case.values())] for case in cases]

    def _run(self, queue: list[tuple[Mapping[str, str], Path]], display: _Display) -> None:
        running: dict[Future, Mapping[str, str]] = {}
        started: set[tuple] = set()
        compiled = {kind_of(key) for key in self.rows}

        def ready() -> Any:
            """Return the next case; the first of a kind starts before others, as it compiles."""
            kinds = (((case, folder), kind_of(case.values())) for case, folder in queue)
            return next((i for i, kind in kinds if kind in compiled or kind not in started), None)

        try:
            while queue or running:
                # Several machines each have a next case ready, and need not wait for this process.
                size = self.place.size
                while len(running) < size + size * (size > 1) and (item := ready()):
                    queue.remove(item)
                    case, folder = item
                    started.add(kind_of(case.values()))
                    running[self.place.submit(case, folder)] = case
                done, _ = wait(running, timeout=0.25, return_when=FIRST_COMPLETED)
                for future in done:
                    case = running.pop(future)
                    self.ran += 1
                    compiled.add(kind_of(case.values()))
                    self._put(case, future.result())
                    display.finish(case, self.rows[tuple(case.values())])
                if done and time.perf_counter() > self.next_write:
                    self.write()
                at_once = [*running.values()][:size]
                for case in at_once:
                    display.started.setdefault(tuple(case.values()), time.perf_counter())
                display.tick(queue, at_once)
                if self.page:
                    self._show(queue, at_once, display)
        finally:
            self.write()

    def _show(self, queue: Sequence[tuple], running: Sequence[Mapping], display: _Display) -> None:
        """Show the state. Raises KeyboardInterrupt if the study was stopped on its page."""
        of = self.most or display.count + len(self.rows) - display.finished
        left = display.left(queue, running)
        folders = [self.folder / folder_name(case) for case in running]
        places = [
            (case, folder, display.since(case), self.place.machine(folder))
            for case, folder in zip(running, folders, strict=True)
        ]
        rows = list(self.rows.values())
        self.page.follow(rows, queue, places, of=of, most=bool(self.most), left=left)
        if self.page.stopped.is_set():
            raise KeyboardInterrupt

    def _put(self, case: Mapping[str, str], outcome: CaseOutcome) -> None:
        if self.strict and outcome.status == "refused":
            raise Refused(case, outcome)
        self.rows[tuple(case.values())] = row(case, outcome, self.items, self.folder.parent)
        if outcome.machine and outcome.machine not in self.machines:
            made = record_of(outcome.folder)
            self.machines[outcome.machine] = {name: made.get(name) for name in OF_MACHINE}
            self.describe()


class _Display:
    def __init__(self, study: Study, count: int):
        from rich.progress import BarColumn, Progress, TextColumn

        self.study, self.count = study, count
        self.finished = 0
        self.started: dict[tuple[str, ...], float] = {}
        seen = sys.stdout.isatty() and os.environ.get("TERM") != "dumb"
        columns = BarColumn(bar_width=30), TextColumn("{task.description}")
        self.bar = Progress(*columns, transient=True, disable=not seen)
        self.task = self.bar.add_task(study.title)

    def finish(self, case: Mapping[str, str], result: Row) -> None:
        self.finished += 1
        numbers = [f"{i.word} {shown(result[i.word])}" for i in self.study.items]
        done, of = self.progress
        number = f"run {done} of at most {of}:" if self.study.most else f"{done}/{of} "
        line = ", ".join([_said(case), *numbers, f"{shown(result['seconds'])} s", ended(result)])
        print(f"{number} {line}", file=sys.stderr, flush=True)

    def tick(self, queue: Sequence[tuple], running: Sequence[Mapping]) -> None:
        if self.bar.disable:
            return
        # An adaptive study does not know how many runs remain.
        left = None if self.study.most else self.left(queue, running)
        done, of = self.progress
        text = f"{done} of {'at most ' if self.study.most else ''}{of} runs"
        text += f", {duration(time.perf_counter() - self.study.begun)}"
        text += f", about {duration(left)} left" if left is not None else ""
        for case in running:
            text += f"\n{_said(case)}: running, {duration(self.since(case))}"
        self.bar.update(self.task, total=of, completed=done, description=text)

    @property
    def progress(self) -> tuple[int, int]:
        most = self.study.most
        return (self.study.ran, most) if most else (self.finished, self.count)

    def since(self, case: Mapping) -> float:
        return time.perf_counter() - self.started[tuple(case.values())]

    def left(self, queue: Sequence[tuple], running: Sequence[Mapping]) -> float | None:
        done = [result for result in self.study.rows.values() if result.get("wall_s")]
        if not self.finished or not done:
            return None
        cases = [{name: result[name] for name in self.study.names} for result in done]
        predict = guessed_time(cases, [result["wall_s"] for result in done])
        rest = sum(predict(case) for case, _ in queue)
        rest += sum(max(predict(case) - self.since(case), 0.0) for case in running)
        return rest / min(self.study.place.size, max(len(queue) + len(running), 1))


def _said(case: Mapping[str, str]) -> str:
    return " ".join(f"{name}={value}" for name, value in case.items())


def guessed_time(
    cases: Sequence[Mapping[str, str]], times: Sequence[float]
) -> Callable[[Mapping[str, str]], float]:
    """Predict the time of a case by ridge regression: powers of numbers, factors of words."""

    def features(case: Mapping[str, str]) -> dict[Any, float]:
        logs: dict[Any, float] = {}
        for name, word in case.items():
            number = number_of(word)
            if number is not None and number > 0:
                logs[name] = np.log(number)
            else:
                logs[name, word] = 1.0
        return logs

    terms = list(dict.fromkeys(term for case in cases for term in features(case)))

    def line(case: Mapping[str, str]) -> list[float]:
        values = features(case)
        return [values.get(term, 0.0) for term in terms]

    matrix = np.array([line(case) for case in cases], float).reshape(len(cases), -1)
    logs = np.log(times)
    centre, mean = matrix.mean(axis=0), logs.mean()
    shifted = matrix - centre
    normal = shifted.T @ shifted + 0.05 * np.eye(matrix.shape[1])
    slopes = np.linalg.solve(normal, shifted.T @ (logs - mean))
    return lambda case: float(np.exp(mean + (np.array(line(case)) - centre) @ slopes))


def shown(value: Any) -> str:
    if value is None or value == "" or value != value:
        return "–"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e5 or value != round(value) else f"{value:.3e}"
    return str(value)


def ended(result: Row) -> str:
    return result["status"] + (f": {result['reason']}" if result["reason"] else "")


def plain_table(words: Sequence[str], numbers: Sequence[str], title: str | None = None) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, title=title, title_justify="left")
    for name in words:
        table.add_column(name, style="cyan", no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def results_table(rows: Sequence[Row], study: Study, console: Console) -> Table:
    from rich.text import Text

    words, facts = [item.word for item in study.items], list(_FACTS)
    omitted = len(rows) - 2 * LISTED
    shown_rows = [*rows[:LISTED], None, *rows[-LISTED:]] if omitted > 1 else rows
    while True:
        columns = [*words, *facts]
        table = plain_table(study.names, columns, study.title or None)
        table.add_column("status", overflow="fold", min_width=_STATUS if facts else 6)
        for each in shown_rows:
            if each is None:
                cells = [""] * (len(study.names) + len(columns) - 1)
                table.add_row("⋮", *cells, f"{omitted} more are in {study.out}")
                continue
            end = ended(each)
            style = {"done": "green", "failed": "red", "refused": "red"}.get(each["status"])
            cells = [shown(each[name]) for name in (*study.names, *columns)]
            said = Text(end if len(end) < 60 else end[:59] + "…", style=style or "yellow")
            table.add_row(*map(Text, cells), said)
        wanted = console.measure(table, options=console.options.update(max_width=1000))
        if not facts or wanted.minimum <= console.width:
            return table
        facts.pop()


def terminal() -> Console:
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=200)


def open_study(
    options: Namespace, plan: variables.StudyPlan, out: Path, items: Sequence[Recorded], *,
    axes: Sequence[str] = (), facts: Row, **settings: Any,
) -> Study:  # fmt: skip
    """Lock the folder, write the `facts` of the study, and open its page with `axes`.

    `settings` are further fields of `Study`.
    """
    gc.enable()  # single runs have disabled garbage collection
    names, again = list(plan.values), options.again
    place: Pool = Here(plan.launch, plan.jobs)
    study = Study(plan.launch, out, names, items, place, again=again, **settings)
    study.facts = {"variables": plan.values, **facts}
    study.claim_folder()
    if options.live:
        from karamelo_py.app.live.study import StudyPage

        words = [item.word for item in items]
        study.page = StudyPage(options.script, names, words, axes=axes, base=study.folder.parent)
        print(f"live: {study.page.server.address}", flush=True)
    if options.on:
        from karamelo_py.app.studies.elsewhere import opened, packed

        parcel = packed(plan.script, plan.launch, plan.values, options.keep, study.folder)
        study.place = opened(options, parcel, plan.jobs, timed=plan.timed)
    options.ends.enter_context(closing(study.place))
    study.describe()
    return study
