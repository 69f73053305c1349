"""Terminal output: a progress bar by Rich, or plain lines in pipes and files."""

import contextlib
import os
import sys
import time
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, TextIO

# Seconds between redraws of the bar, and between progress lines in a pipe.
REDRAW = 0.1
REPORT = 10.0
# Rich redraws the bar after every line, which takes 0.25 ms. After BURST lines at intervals below
# QUICK seconds, lines are collected and written every LINES seconds.
QUICK = 0.02
BURST = 8
LINES = 0.05


class Console:
    def __init__(
        self,
        out: TextIO | None = None,
        err: TextIO | None = None,
        *,
        terminal: bool | None = None,
        quiet: bool = False,
    ):
        self._out = out
        self._err = err
        self._terminal = terminal
        self.quiet = quiet
        self._broken = self._running = False
        self._progress: Any = None
        self._begin = 0.0, 0, 0.0
        self._shown = 0.0
        self._waiting: list[str] = []
        self._burst = 0
        self._last_line = self._released = 0.0

    @property
    def out(self) -> TextIO:
        return self._out or sys.stdout

    @property
    def err(self) -> TextIO:
        return self._err or sys.stderr

    @property
    def terminal(self) -> bool:
        if self._terminal is None:
            interactive = hasattr(self.out, "isatty") and self.out.isatty()
            self._terminal = interactive and os.environ.get("TERM") != "dumb"
        return self._terminal

    def say(self, text: str = "", style: str | None = None) -> None:
        if self.quiet or self._broken:
            return
        self._release()
        if self._progress is not None:
            self._progress.console.out(text, highlight=False)
        elif style and self.terminal:
            self._rich.out(text, style=style, highlight=False)
        else:
            self._write(text)

    def warn(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            _print(self.err, text)

    def log_line(self, text: str, header: bool = False) -> None:
        if self._progress is None or self.quiet:
            self.say(text, "bold" if header else None)
        else:
            now = time.perf_counter()
            self._burst = self._burst + 1 if now - self._last_line < QUICK else 0
            self._last_line = now
            self._waiting.append(text)
            if self._burst < BURST or now - self._released > LINES:
                self._release()

    def banner(self, title: str, facts: Mapping[str, object]) -> None:
        names = max(map(len, facts), default=0)
        rows = [f"  {name.ljust(names)}  {show(value)}" for name, value in facts.items()]
        self.say(title, "bold")
        self.say("\n".join(rows))

    def summary(
        self,
        facts: Mapping[str, object],
        stages: Sequence[tuple[str, float]] = (),
        title: str = "Run finished",
    ) -> None:
        total = sum(seconds for _, seconds in stages) or 1.0
        parts = {
            f"  {name}": f"{f'{seconds:.3g} s':>8}  {f'{100 * seconds / total:.0f} %':>8}"
            for name, seconds in stages
        }
        self.banner(title, {**facts, **parts})

    def leave(self) -> None:
        self._broken, self._progress = True, None

    def begin_run(self, step: int = 0, fraction: float = 0.0) -> None:
        self._shown = time.perf_counter()
        self._begin = self._shown, step, fraction
        self._running = True
        if self.terminal and not self.quiet:
            from rich.progress import BarColumn, Progress, TextColumn

            # Rich would refresh the bar in a thread, which would have to wait for compiled loops.
            self._progress = Progress(
                BarColumn(bar_width=30), TextColumn("{task.description}"),
                console=self._rich, auto_refresh=False, transient=True,
            )  # fmt: skip
            self._progress.add_task("", total=1.0, completed=fraction)
            self._progress.start()

    def progress(
        self, step: int, time_: float, fraction: float | None = None, within: str = ""
    ) -> None:
        """Show progress, and the activity `within` a step. The console allows a call in every step.

        `fraction` is None if the end is unknown (run_until, run_while).
        """
        now = time.perf_counter()
        pause = REDRAW if self._progress is not None else REPORT
        if now - self._shown < pause or not self._running:
            return
        self._shown = now
        self._release()
        text = self._describe(step, time_, fraction, now) + (within and f"; {within}")
        if self._progress is not None:
            (task,) = self._progress.tasks
            task.total = 1.0 if fraction is not None else None
            self._progress.update(
                task.id, completed=fraction or 0.0, description=text, refresh=True
            )
        else:
            self.say(f"# {text}")

    def end_run(self) -> None:
        self._running = False
        self._release()
        if self._progress is not None:
            progress, self._progress = self._progress, None
            progress.stop()

    def _describe(self, step: int, time_: float, fraction: float | None, now: float) -> str:
        begun, first, done = self._begin
        elapsed = max(now - begun, 1e-9)
        parts = [f"step {step}", f"time {time_:.6g}", f"{(step - first) / elapsed:.3g} steps/s"]
        if fraction is not None:
            parts.insert(0, f"{100 * fraction:3.0f} %")
            if fraction > done:
                parts.append(f"{duration(elapsed * (1 - fraction) / (fraction - done))} left")
        return ", ".join(parts)

    def _release(self) -> None:
        if self._waiting:
            lines, self._waiting = self._waiting, []
            self._released = time.perf_counter()
            self.say("\n".join(lines))

    @cached_property
    def _rich(self) -> Any:
        from rich.console import Console as RichConsole

        return RichConsole(file=self._out, force_terminal=True if self._out else None)

    def _write(self, text: str) -> None:
        if self._broken:
            return
        try:
            _print(self.out, text)
        except BrokenPipeError:
            # The reader of the pipe (head, less) has ended; the run continues.
            self._broken = True
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), self.out.fileno())


def _print(stream: TextIO, text: str) -> None:
    try:
        stream.write(text + "\n")
    except UnicodeEncodeError:
        # The encoding of the stream (such as a pipe on Windows) may lack characters.
        encoding = stream.encoding or "ascii"
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")
    stream.flush()


def show(value: object) -> str:
    """Format a value: 1 234 567, 0.333333."""
    if isinstance(value, bool) or value is None:
        return str(value)
    if isinstance(value, int):
        return f"{value:,}".replace(",", " ")
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)


def duration(seconds: float) -> str:
    """Format a duration: 42 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
