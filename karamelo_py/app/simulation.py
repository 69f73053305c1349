"""Python interface: script commands as methods, point data as arrays."""

from __future__ import annotations

import gc
import io
import itertools
import os
import re
import sys
import threading
import warnings
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from karamelo_py.app.options import make_folder, threads_option
from karamelo_py.language import registry, signature
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output import record
from karamelo_py.output.console import Console
from karamelo_py.output.fields import unknown_column
from karamelo_py.run.loop import Interrupted
from karamelo_py.run.lower.card import take_card, use_card
from karamelo_py.run.mpi.comm import launched
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import set_columns
from karamelo_py.script.errors import NoItem, Pause, Quit, ScriptError, instead, meant
from karamelo_py.script.expressions import Expression, shown
from karamelo_py.script.parser import parse, parse_text
from karamelo_py.styles.fixes.python import called_as

SCRIPT = "the name of a script, or its text: statements, as in name = 1"
_folders: WeakValueDictionary[Path, Simulation] = WeakValueDictionary()


class SimulationError(ScriptError):
    """An error: `message`, `expected`, `hint`, `mark` (file, line, column, text of the line)."""

    def __str__(self) -> str:
        return self.render()


class KarameloWarning(UserWarning):
    """A warning, with the text that the command line shows."""


class Quiet(Console):
    """A console that prints nothing, and issues warnings as Python warnings."""

    def __init__(self) -> None:
        super().__init__(quiet=True)

    def warn(self, text: str) -> None:
        """Issue a Python warning, at the line outside the package that made the call."""
        level, frame = 1, sys._getframe()
        while frame.f_back and frame.f_globals.get("__name__", "").startswith("karamelo_py."):
            level, frame = level + 1, frame.f_back
        warnings.warn(text, KarameloWarning, stacklevel=level)


class Columns(Mapping, dict):  # type: ignore[metaclass]
    """Read-only columns by name.

    It is a subclass of dict only for ``pandas.DataFrame(sim.log)``; the dict itself is empty.
    """

    def __init__(self, names: Callable[[], list[str]], column: Callable[[str], np.ndarray]):
        self._names = names
        self._column = column

    def __getitem__(self, name: str) -> np.ndarray:
        names = self._names()
        if name not in names:
            close = unknown_column("", str(name), names).hint
            hint = f"{close} " if close else ""
            raise NoItem(f"there is no '{name}'; {hint}there are {', '.join(names) or 'none'}")
        with _as_simulation_error():
            values = self._column(name)
        if isinstance(values, np.ndarray):
            values = values.view()
            values.flags.writeable = False
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __repr__(self) -> str:
        return f"<columns {', '.join(self)}>"

    def _refuse(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError("columns of a simulation cannot be added or removed")

    __setitem__ = __delitem__ = __ior__ = _refuse
    update = pop = popitem = setdefault = clear = _refuse

    def copy(self) -> dict[str, np.ndarray]:
        return dict(self)

    def to_pandas(self) -> Any:
        """Return the columns as a DataFrame."""
        try:
            import pandas
        except ModuleNotFoundError as error:
            raise SimulationError("DataFrames need pandas: pip install pandas") from error
        return pandas.DataFrame(self)


class LivePage:
    """A browser page that shows a simulation, at the URL `address`."""

    def __init__(self, page: Any):
        self._page = page
        page.server.framed = True
        self.address = page.server.address

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="760"></iframe>'

    def __repr__(self) -> str:
        return f"<live page {self.address}>"

    def close(self) -> None:
        self._page.detach()


class PointColumns(Columns):
    """Columns of the points. ``points["vx"] = values`` sets a column between two runs.

    Positions, velocities, temperatures, stresses (of rate-form materials) and declared fields can
    be set to a number or an array (n,).
    """

    def __init__(self, hub: Hub):
        super().__init__(hub.fields.particle_names, hub.fields.particle)
        self._hub = hub

    def __setitem__(self, name: str, values: Any) -> None:
        with _as_simulation_error():
            if self._hub.in_run:
                raise ScriptError(
                    f"points['{name}'] cannot be set within a run",
                    hint="between two runs, or by the argument of the function of fix python",
                )
            set_columns(self._hub.simulation, {name: values})


class Variables(MutableMapping):
    """Script variables: numbers, or formulas as text. ``variables["q"] = 0`` is the line q = 0."""

    def __init__(self, sim: Simulation):
        self._sim = sim

    def _held(self) -> dict[str, Any]:
        return self._sim._interpreter.variables

    def __getitem__(self, name: str) -> Any:
        value = self._held()[name]
        return value if isinstance(value, (float, str)) else shown(value)

    def __setitem__(self, name: str, value: Any) -> None:
        if name in self._sim._interpreter.presets:
            raise SimulationError(
                f"Simulation(..., {name}=...) sets '{name}', which overrides later assignments",
                hint="another simulation with another value",
            )
        self._sim._do(f"{name} = {_as_script_text(value)}", "Simulation.variables")

    def __delitem__(self, name: str) -> None:
        raise SimulationError(f"'{name}' cannot be deleted: variables of a script are permanent")

    def __iter__(self) -> Iterator[str]:
        return iter(self._held())

    def __len__(self) -> int:
        return len(self._held())

    def __repr__(self) -> str:
        return repr(dict(self))


class ShownPicture:
    def __init__(self, png: bytes):
        self.png = png

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, file: str | PathLike) -> None:
        """Write a PNG file."""
        Path(file).write_bytes(self.png)


class Simulation:
    """A scene, built by a script, by commands, or both.

    Parameters
    ----------
    script
        Name or text of a script, which is executed up to its first run command; ``run()`` without a
        number executes the rest. A str is taken as text if no file has this name and it contains a
        line break, a parenthesis or an equals sign; a Path is always a name.
    out
        Folder for log, dumps, plots and restart files. By default no files are written.
    threads
        Number of threads; by default all cores if the scene is large enough.
    gpu
        Run on an NVIDIA GPU.
    verbose
        Print what the command line prints.
    trust_geometries
        Allow .geo files to run programs and write files.
    alone
        Allow several processes of mpiexec, each of which computes a separate scene.
    variables
        Values that override assignments in the script, like ``-var``.

    Raises
    ------
    SimulationError
        If the script has an error, `threads` or `out` is wrong, or there is no GPU.

    Notes
    -----
    Script commands are methods with the same arguments: ``sim.solid("body", "region", "box", 2,
    "rubber", 0.1, 0)`` is the line ``solid(body, region, box, 2, rubber, 0.1, 0)``. Strings are
    names or formulas, and None is NULL. ``sim.fix(ID, "python", group, function)`` accepts a
    function, ``sim.solid(ID, "points", columns, ...)`` a dictionary of arrays or a DataFrame.

    Commands that give a value, such as ``sim.value("Ek")`` and ``sim.xcm("all", "x")``, return this
    value.

    Different simulations may run in different Python threads. Calling one simulation from two
    threads at the same time raises SimulationError.

    Examples
    --------
    >>> sim = Simulation("in.two_disks", N=40)
    >>> sim.run(100)
    >>> sim.points["x"].max(), sim.values["Ek_s"], sim.log["Time"]
    """

    def __init__(
        self,
        script: str | PathLike | None = None,
        *,
        out: str | PathLike | None = None,
        threads: int | None = None,
        gpu: bool = False,
        verbose: bool = False,
        trust_geometries: bool = False,
        alone: bool = False,
        **variables: Any,
    ):
        if not alone:
            _refuse_copies()
        self.hub = hub = Hub(Console() if verbose else Quiet())
        hub.settings.trusts = trust_geometries
        hub.pausing = hub.open_ended = True
        hub.output.log.rows = []
        hub.output.writes = out is not None
        self._numbers = itertools.count(1)
        self._at_work = threading.RLock()  # lock of the thread that calls the simulation
        self._name = "a scene"
        with _as_simulation_error():
            hub.settings.threads = _threads_of(threads)
            if gpu:
                use_card(hub)
            if out is not None:
                hub.folder = self._claimed(out)
                hub.record.path = hub.folder / record.NAME
            presets = {name: _as_script_text(value) for name, value in variables.items()}
            self._interpreter = Interpreter(hub, presets)
            if script is not None:
                self._read(script)
            take_card(hub)

    def _claimed(self, out: str | PathLike) -> Path:
        if not isinstance(out, (str, PathLike)):
            raise ScriptError(f"out={out!r} is not the name of a folder", hint='out="files"')
        folder = Path(out).absolute()
        make_folder(folder, 'out="{}"')
        if folder in _folders:
            gc.collect()
        if folder in _folders:
            raise ScriptError(
                f"another simulation writes to {folder}",
                expected="a separate folder for each, or close() the other",
            )
        _folders[folder] = self
        return folder

    def _read(self, script: str | PathLike) -> None:
        if not isinstance(script, (str, PathLike)):
            raise ScriptError(
                f"{script!r} is not a script", expected=SCRIPT, hint="variables by name, as in N=3"
            )
        exists = os.path.exists(script)  # False also if the text is too long for a name
        is_text = isinstance(script, str) and not exists and any(c in script for c in "\n(=")
        self._name = "a script" if is_text else str(script)
        try:
            if is_text:
                self._interpreter.run_text(script, "script")
            else:
                self._interpreter.run_file(script)
        except Pause:
            pass
        except ScriptError as error:
            if isinstance(script, str) and not is_text and not exists:
                error.expected = SCRIPT
            raise

    def command(self, text: str) -> None:
        """Execute lines of script; raises SimulationError."""
        self._do(text, "command")

    def _do(self, text: str, name: str) -> None:
        with self._carried_out():
            for statement in parse(text, name):
                self._interpreter.execute(statement)

    @contextmanager
    def _carried_out(self) -> Iterator[None]:
        with self._in_one_thread():
            pausing, self.hub.pausing = self.hub.pausing, False
            try:
                with _as_simulation_error():
                    yield
                if self.hub.record.runs:
                    self.hub.record.end("finished")
            except Quit:
                self.hub.record.end("finished")
            except Interrupted:
                self.hub.record.end("interrupted")
                raise KeyboardInterrupt from None
            except SimulationError as error:
                self.hub.record.end("failed", error)
                raise
            finally:
                self.hub.pausing = pausing

    @contextmanager
    def _in_one_thread(self) -> Iterator[None]:
        if not self._at_work.acquire(blocking=False):
            raise SimulationError(
                "this simulation is running in another thread",
                hint="wait for that, or one Simulation for each thread",
            )
        try:
            yield
        finally:
            self._at_work.release()

    def evaluate(self, expression: str) -> float | str:
        """Return the present value of an expression."""
        return self._evaluated(expression, "evaluate")

    def _evaluated(self, expression: str, name: str) -> float | str:
        with self._in_one_thread(), _as_simulation_error():
            raw, node = parse_text(expression, name)
            value = self._interpreter.evaluate(node, raw)
            if isinstance(value, Expression):
                self.hub.refresh_values()
                return value.evaluate(self.hub.values)
            return value

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_") or not registry.knows("command", name):
            names = [*registry.names("command"), *dir(type(self))]
            hint = meant(name, names) or instead("command", name) or instead("fix", name)
            raise AttributeError(f"there is no command '{name}'" + (f"; {hint}" if hint else ""))

        command = registry.find("command", name)
        gives = command.__annotations__.get("return") not in (None, "None")

        def call(*arguments: Any, **named: Any) -> Any:
            line = f"{name}({self._words(*arguments, **named)})"
            if gives:
                return self._evaluated(line, f"Simulation.{name}")
            self._do(line, f"Simulation.{name}")
            return None

        call.__name__ = name
        call.__doc__ = command.__doc__
        return call

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *registry.names("command")]

    def _words(self, *arguments: Any, **named: Any) -> str:
        words = [self._word(argument) for argument in arguments]
        return ", ".join([*words, *(f"{key}={self._word(v)}" for key, v in named.items())])

    def _word(self, value: Any) -> str:
        if callable(value) and not isinstance(value, type):
            name = f"{called_as(value).strip('<>')}_{next(self._numbers)}"
            self.hub.functions[name] = value
            return name
        if isinstance(value, Mapping) or hasattr(value, "to_dict"):
            name = f"table_{next(self._numbers)}"
            self.hub.functions[name] = {column: np.array(value[column]) for column in value}
            return name
        return _as_script_text(value)

    def run(self, steps: int | None = None) -> None:
        """Take `steps` steps; without a number, execute the rest of the script."""
        if steps is not None:
            self._do(f"run({_as_script_text(steps)})", "Simulation.run")
            return
        if not self._interpreter.waits:
            raise SimulationError(
                "no script is left to execute", hint="run(100), run_time(0.5) ..."
            )
        with self._carried_out():
            self._interpreter.go_on()

    @property
    def time(self) -> float:
        """Present time of the simulation."""
        return self.hub.update.time

    @property
    def step(self) -> int:
        """Number of steps taken."""
        return self.hub.update.step

    @property
    def dt(self) -> float:
        """Length of the next step."""
        return self.hub.update.dt

    @property
    def points(self) -> PointColumns:
        """Columns of the points (x, vy, s11, seq ...) that can be set, as arrays (n,) by id."""
        return PointColumns(self.hub)

    @property
    def nodes(self) -> Columns:
        """Columns of the nodes (x, vx, mass ...), as arrays (n,)."""
        return Columns(self.hub.fields.node_names, self.hub.fields.node)

    @property
    def log(self) -> Columns:
        """Columns of the log as arrays, of the rows since the last change of columns."""
        rows = self.hub.output.log.rows
        names = rows[-1][0] if rows else []
        last = np.array([numbers for at, numbers in rows if at == names])
        return Columns(lambda: list(names), lambda name: last[:, names.index(name)])

    @property
    def values(self) -> Columns:
        """Published values of fixes and computes, by name."""

        def read(name: str) -> float:
            if self.hub.solids and self.hub.update.method is not None:
                self.hub.refresh_values()
            return self.hub.values.get(name)

        return Columns(self.hub.values.names, read)

    @property
    def variables(self) -> Variables:
        """Script variables; ``sim.variables["q"] = 0`` is the line q = 0."""
        return Variables(self)

    def show(
        self,
        field: str | None = None,
        width: float = 6,
        height: float = 4.5,
        *,
        file: str | PathLike | None = None,
        **look: Any,
    ) -> ShownPicture:
        """Draw the points, coloured by a column (default: by solid).

        Parameters
        ----------
        field
            Column of the points, such as seq.
        width, height
            Size in inches.
        file
            File to which the picture is also written: .png, .pdf or .svg.
        look
            Options of dump pyplot: vmin, vmax, cmap, label, only, xmin, quantile, dpi ...
        """
        from karamelo_py.styles.dumps.pyplot import PyPlot

        with _as_simulation_error():
            fields = [] if field is None else [field]
            for name in {"label", "title"} & {*look}:
                look[name] = look[name] and '"{}"'.format(look[name].strip('"'))
            words = self._words(1, "shown.png", width, height, *fields, **look)
            (call,) = parse(f"show({words})", "Simulation.show")
            arguments = [signature.Argument(raw, self._interpreter) for raw in call.arguments]
            dump = signature.call(PyPlot, self.hub, arguments, "dump pyplot")
            drawn = io.BytesIO()
            dump.draw(drawn)
            if file is not None:
                dump.save(Path(file))
        return ShownPicture(drawn.getvalue())

    def live(self) -> LivePage:
        """Open a browser page that follows later runs.

        The page has buttons to pause, step and stop. To close the page, call its ``.close()``, or
        close the simulation. The package plotly is needed.
        """
        from karamelo_py.app.live.run import RunPage

        with _as_simulation_error():
            return LivePage(RunPage(self.hub, self._name))

    def close(self) -> None:
        """Close files and pages; a later run starts a new log."""
        for page in [*self.hub.output.pages]:
            page.detach()
        self.hub.output.log.close()
        _folders.pop(self.hub.folder, None)

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        count = sum(solid.count for solid in self.hub.solids.values())
        return f"<{self._name}: {count} points, step {self.step}, time {self.time:.6g}>"


@contextmanager
def _as_simulation_error() -> Iterator[None]:
    try:
        yield
    except ScriptError as error:
        whole = SimulationError.__new__(SimulationError)
        whole.__dict__.update(vars(error))
        whole.args = error.args
        raise whole from error.__cause__


def _refuse_copies() -> None:
    size, rank = launched()
    if size == 1:
        return
    if rank > 0:
        sys.exit()
    raise SimulationError(
        f"{size} processes were started, and each would run the same scene",
        expected=f"mpiexec -n {size} karamelo-py SCRIPT, which distributes a scene",
        hint="Simulation(..., alone=True) to run a separate scene on each",
    )


def _threads_of(threads: Any) -> int | None:
    try:
        return None if threads is None else threads_option(str(threads))
    except ArgumentTypeError:
        raise ScriptError(
            f"threads={threads!r} is not a number of threads",
            expected="1, 2, ..., or None: all cores where the scene is large enough",
        ) from None


def _as_script_text(value: Any) -> str:
    if value is None:
        return "NULL"
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value)).lower()
    if isinstance(value, PathLike):
        return f'"{value}"'
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, str):
        words = value.split()
        texts = len(words) > 1 and all(re.fullmatch(r"[\w.:'-]+", word) for word in words)
        # Words that are separated only by blanks are text, not a formula.
        return f'"{value}"' if texts and not {"and", "or", "not"} & set(words) else value
    raise TypeError(f"{value!r} is not a number, text, True, False, None or function")
