"""Schedule of output: log, dumps and plots."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from karamelo_py.language.faults import as_script_error
from karamelo_py.language.scene import Scene
from karamelo_py.output.log import Log
from karamelo_py.output.plots import Plots
from karamelo_py.output.rhythm import ByTime, Rhythmic, is_due, next_step
from karamelo_py.output.units import Units
from karamelo_py.script.errors import Mark, ScriptError

RESTART = "restart"


class Output:
    """Writes log, dumps and plots when due.

    Output is due at the first and last state of every run, and at multiples of `every`, in steps or
    time since the start of the scene. No state is written twice to a file, and nothing is written
    in a rehearsal.
    """

    def __init__(self, hub: Scene):
        self.hub = hub
        self.log = Log(hub)
        self.plots = Plots(hub)
        self.units: Units | None = None
        self.writes = True
        self.last: list[Rhythmic] = []
        self.pages: list[Rhythmic] = []
        self.files: dict[Path, str] = {}

    @property
    def takes_part(self) -> bool:
        return self.writes or not self.hub.settings.comm.leads

    def check_file(self, file: Path) -> None:
        path = self.hub.folder / file
        scripts = self.hub.interpreter.files if self.hub.interpreter else ()
        if _may_be(path, self.log.path):
            error = f"{file} is the log"
        elif any(_may_be(path, script) for script in scripts):
            error = f"{file} is the script itself"
        elif path.exists() and not os.access(path, os.W_OK):
            error = f"{file} exists and cannot be overwritten"
        elif not path.exists() and path.parent.is_dir() and not os.access(path.parent, os.W_OK):
            error = f"nothing can be written to the folder {path.parent}"
        else:
            return
        raise ScriptError(error, argument="file", expected="the name of another file")

    def claim(self, file: Path, writer: str) -> None:
        other = self.files.get(file)
        if other is not None and not other == writer == RESTART:
            raise ScriptError(
                f"{other} already writes to {file}",
                argument="file",
                expected="the name of another file",
            )
        self.files[file] = writer

    def begin(self, *, within: bool = False) -> None:
        if self.hub.rehearsing:
            return
        if self.plots.file is not None and not self.plots:
            self.hub.warn(
                f"{self.plots.file} will not be drawn: there is nothing to plot",
                mark=self.plots.mark,
                hint="plot(ID, every, x, y) gives a curve",
            )
        self.log.begin()
        if not within:
            self.write(last=True)

    def next_step(self, step: int) -> int:
        update = self.hub.update
        fixed = update.fixed_dt is not None
        return min(
            next_step(item.every, step, update.time, update.dt, fixed) for item in self._items()
        )

    def write(self, last: bool = False) -> None:
        """Write what is due; at the `last` state of a run, write what has not been written yet."""
        if self.hub.rehearsing:
            return
        step, time = self.hub.update.step, self.hub.update.time
        due = [
            i
            for i in self._items()
            if i.last_step != step and (last or is_due(i.every, step, time))
        ]
        if any(item is self.log or item in self.plots.values() for item in due):
            self.hub.refresh_values()
        for item in due:
            self._write(item)
            item.last_step = step
            if isinstance(item.every, ByTime):
                item.every.passed = item.every.now(time)

    def write_last(self) -> None:
        for item in self.last if self.takes_part else ():
            if item.last_step != self.hub.update.step:
                self._write(item)
                item.last_step = self.hub.update.step

    def end(self, last: bool = True) -> None:
        if self.hub.rehearsing:
            return
        if last:
            self.write(last=True)
        for item in self._to_finish():
            with _reported(item, "finish"):
                item.finish()

    def abort(self) -> None:
        """Complete plots, dumps and log of an aborted run, with warnings instead of errors."""
        if self.hub.rehearsing:
            return
        try:
            for item in self._to_finish():
                try:
                    with _reported(item, "finish"):
                        item.finish()
                except ScriptError as error:
                    self.hub.console.warn(error.render())
        finally:
            self.log.close()

    def _to_finish(self) -> list[Rhythmic | Plots]:
        plots = [self.plots] if self.plots else []
        return [*plots, *self.hub.dumps.values()] if self.writes else []

    def _write(self, item: Rhythmic) -> None:
        hook = "write" if self.hub.settings.comm.leads else "take_part"
        with _reported(item, hook):
            getattr(item, hook)()

    def _items(self) -> list[Rhythmic]:
        if not self.takes_part:
            return [self.log, *self.plots.values(), *self.pages]
        return [self.log, *self.hub.dumps.values(), *self.plots.values(), *self.pages, *self.last]


@contextmanager
def _reported(item: Rhythmic | Plots, hook: str) -> Iterator[None]:
    naming = as_script_error(f"dump {item.style}", hook, type(item), item.mark)
    try:
        with naming if item.style else nullcontext():
            yield
    except ScriptError as error:
        raise _located(error, item.mark) from error.__cause__
    except OSError as error:
        said = f"cannot write {error.filename or 'a file'}: {error.strerror or error}"
        raise _located(ScriptError(said), item.mark) from error


def _located(error: ScriptError, mark: Mark | None) -> ScriptError:
    if error.mark is None and mark is not None:
        error.mark = mark
        error.complete = True
    return error


def _may_be(path: Path, other: Path) -> bool:
    """Return True if `path`, whose first ``*`` becomes a number, may be the file `other`."""
    if "*" not in str(path):
        try:
            return path.resolve() == other.resolve() or path.samefile(other)
        except OSError:
            return False
    pattern = re.escape(str(path.absolute())).replace(r"\*", r"\d+", 1)
    return re.fullmatch(pattern, str(other.absolute())) is not None
