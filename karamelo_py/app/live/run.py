"""The live page of a run."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from karamelo_py.advice import energy
from karamelo_py.app.launch import rendered
from karamelo_py.app.live import frames
from karamelo_py.app.live.frames import Frame, KeptFrames, plain
from karamelo_py.app.live.server import Server
from karamelo_py.kernels.watch import FEW, WITHIN
from karamelo_py.output.rhythm import Rhythmic
from karamelo_py.run.energy import unknown_work
from karamelo_py.run.listening import Listener
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import FAILURES

WINDOW = 2000  # rows of the log that a page gets when it is opened
GRACE = 10.0  # seconds in which a page may be reloaded


class Row(NamedTuple):
    step: int
    time: float
    dt: float
    limit: str
    gain: float | None  # energy gain in %, None if it is not tracked
    log: dict[str, float]


class RunPage(Rhythmic, Listener):
    remembers = ()
    id, mark = "live", None

    def __init__(self, hub: Hub, title: str):
        self.hub, self.title, self.every = hub, title, 1
        self.frames = KeptFrames()
        if hub.output.log.rows is None:
            hub.output.log.rows = []
        self._rows: list[Row] = []
        self._paused = self._once = False
        self._column, self._unwatched = "seq", ""
        self._ended, self._failed = "", ""
        self.server = Server(
            frames.PAGE, self._news, {"frame": self.frames.answer},
            {"pause": self._pause, "go": self._go, "step": self._step, "stop": self._stop,
             "column": self._choose},
        )  # fmt: skip
        hub.output.pages.append(self)
        hub.listeners.append(self)

    def signalled(self, number: int) -> None:
        self._paused = False

    def write(self) -> None:
        """Send the state to pages, and wait while they pause the run."""
        hub, simulation = self.hub, self.hub.simulation
        self.every = hub.output.log.every  # every run starts with output
        names, numbers = hub.output.log.rows[-1] if hub.output.log.rows else ([], [])
        log = {name: n for name, n in zip(names, numbers, strict=True) if not isinstance(n, str)}
        watch = simulation.control.energy[0]
        has_gain = watch.watch_energy and watch.looks >= FEW  # the mean is over `FEW` checks
        gain = -100 * simulation.energy_watch.lost_fraction() if has_gain else None
        why = unknown_work(hub)
        self._unwatched = f"energy is {energy.not_watched(why)}" if why else ""
        limit = "load steps" if simulation.implicit else simulation.ruling_limit
        self._rows.append(Row(hub.update.step, hub.update.time, hub.update.dt, limit, gain, log))
        self.frames.add(self._taken())
        self.server.changed()
        self._wait()

    def end(self, *, waits: bool = False, stopped: bool = False) -> None:
        """Send the last state, and wait until all pages close.

        With `waits`, also wait for a first page.
        """
        server = self.server
        error = sys.exception()
        ended = "stopped" if stopped or error is not None else "finished"
        if isinstance(error, FAILURES):
            ended, self._failed = "failed", rendered(error)
            self.hub.warned.append((self.hub.update.time, self._failed))
        self._ended = ended  # set last: until then, pages show a running run
        server.changed()
        server.flush()
        waits = waits and self.hub.console.terminal and not server.opened
        if server.watched or waits:
            self.hub.console.say(
                f"live: {server.address} stays until it is closed (Ctrl-C ends it)"
            )
            with suppress(KeyboardInterrupt):
                server.stay()
        server.close()

    def detach(self) -> None:
        if self not in self.hub.output.pages:
            return
        self.hub.output.pages.remove(self)
        self._paused = False
        self.server.close()

    def _taken(self) -> Frame:
        update, read = self.hub.update, self.hub.fields.particle
        axes = "xyz"[: self.hub.domain.dimension]
        return Frame.of_columns(update.step, update.time, axes, self._column, read=read)

    def _wait(self) -> None:
        shown, left = self._column, time.perf_counter()
        while self._paused and not self._once:
            time.sleep(0.05)
            left = time.perf_counter() if self.server.watched else left
            if time.perf_counter() - left > GRACE:
                self._paused = False
                self.hub.console.say("the page that paused the run is closed: the run continues")
            if shown != self._column:
                shown = self._column
                self._take_again()
        self._once = False

    def _take_again(self) -> None:
        self.frames.replace_last(self._taken)
        self.server.changed()

    def _news(self, seen: int) -> tuple[int, dict]:
        rows = new = self._rows[seen:]
        if len(rows) > WINDOW:
            rows = [rows[k] for k in np.linspace(0, len(rows) - 1, WINDOW).astype(int)]
        news = {
            "rows": [
                {**row._asdict(), "log": {k: plain(float(v)) for k, v in row.log.items()}}
                for row in rows
            ],
            "frames": self.frames.listed(),
            "flags": [{"time": time, "text": text} for time, text in self.hub.warned],
            "paused": self._paused,
            "unwatched": self._unwatched,
            "over": bool(self._ended),
            "ended": self._ended,
            "failed": self._failed,
        }
        if not seen and self.hub.domain is not None:
            news["about"] = {
                "title": self.title,
                "dimension": self.hub.domain.dimension,
                "columns": self.hub.fields.particle_names(),
                "column": self._column,
                "method": self.hub.update.words,
                "bounds": [-100 * energy.LOSS, 100 * WITHIN],
                "steers": True,
            }
        return seen + len(new), news

    def _choose(self, words: Mapping[str, str]) -> None:
        if words.get("name") in self.hub.fields.particle_names():
            self._column = words["name"]
            if self._rows and not self.hub.in_run:  # no further output would wake the pages
                self._take_again()

    def _pause(self, _: Mapping[str, str]) -> None:
        self._paused = True
        self.server.changed()

    def _go(self, _: Mapping[str, str]) -> None:
        self._paused = False
        self.server.changed()

    def _step(self, _: Mapping[str, str]) -> None:
        self._once = True

    def _stop(self, _: Mapping[str, str]) -> None:
        """Stop the run as Ctrl-C does, so that the last state is written."""
        if self.hub.in_run:
            os.kill(os.getpid(), signal.SIGINT)
