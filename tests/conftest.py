"""What the tests share: scripts run through the real command line, and read back.

What takes long to import is imported where it is used: the process that only hands out tests needs
none of it.
"""

from __future__ import annotations

import gc
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from textwrap import dedent
from typing import TYPE_CHECKING, Any

# Threads of OpenBLAS wait in loops, and each process of tests has one processor.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# LLVM's passes take longer than the steps of most tests, and change no bit (test_identical.py).
os.environ.setdefault("KARAMELO_PY_OPTIMISATION", "0")

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    import numpy as np

    from comparisons.results import Result

TESTS = Path(__file__).parent
ROOT = TESTS.parent
INPUTS = ROOT / "inputs"

# Processes that tests start run the tree, whatever is installed.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
# And keep its bytecode: hundreds of them would each compile the tree for 0.3 s. Without bytecode,
# each process of tests also rewrites the assertions of all modules, for 6 s.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Thousands of small files are replaced, and a disk makes a run wait for each. Files are left for a
# reader if a test fails.
MEMORY = Path("/dev/shm")
FOLDER = "PYTEST_DEBUG_TEMPROOT"
in_memory = ""
if FOLDER not in os.environ and MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > 2**31:
    in_memory = os.environ[FOLDER] = mkdtemp(prefix="karamelo-py-", dir=MEMORY)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    if in_memory and exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        shutil.rmtree(in_memory, ignore_errors=True)


# Where a script asks for a GPU, the processor takes its part.
os.environ["KARAMELO_PY_GPU"] = "emulated"

# A shell that starts the tests in the background has them ignore Ctrl-C, which is inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)


# No test asserts a time, and a failure is the same in every run.
settings.register_profile("tests", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("tests")
# Hypothesis parses the whole tree for constants to try: 2 s in each process, and other examples
# after each edit.
with suppress(ImportError):
    from hypothesis.internal.conjecture import providers

    providers._get_local_constants = lambda: providers._local_constants


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Tests that are over are forgotten: pytest-xdist 3.8 goes through all of them at each end."""
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class Scheduling(LoadGroupScheduling):
        def mark_test_complete(self, node: Any, item_index: int, duration: float = 0) -> None:
            units = self.assigned_work[node]
            name = self._split_scope(self.registered_collections[node][item_index])
            super().mark_test_complete(node, item_index, duration)
            if all(units[name].values()):
                del units[name]

    return Scheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Groups of tests come first, the largest of them at the head.

    One process runs a whole group: one that begins late runs on when the others are done.
    """
    groups = {
        item: mark.args[0] if (mark := item.get_closest_marker("xdist_group")) else ""
        for item in items
    }
    sizes = Counter(groups.values())
    sizes[""] = 0
    items.sort(key=lambda item: (-sizes[groups[item]], groups[item]))


def pytest_collection(session: pytest.Session) -> None:
    """In a new checkout, two processes rewrite the assertions of half of the modules each."""
    whole = [Path(name).resolve() for name in session.config.args] == [TESTS]
    if whole and os.environ.get("PYTEST_XDIST_WORKER") == "gw1":
        modules = sorted(TESTS.glob("test_*.py"), reverse=True)
        for module in modules[: len(modules) // 2]:
            with suppress(Exception, pytest.skip.Exception):  # told where it is collected
                import_module(module.stem)


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end: Python's collector need not go through them again.

    It runs seldom: scenes make many objects, few of them in cycles.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


def _prepared(folder: Path, script: str | Path) -> Path:
    """The path of a script, written to `folder` if it is given as a text."""
    if isinstance(script, Path):
        return script
    path = folder / "in.script"
    path.write_text(dedent(script), encoding="utf-8")
    return path


def _checked(result: Result, status: int | None) -> Result:
    assert "Traceback" not in result.out + result.err
    assert status is None or result.status == status, result.err
    return result


_numbers = itertools.count()


@pytest.fixture
def tmp_path(request, tmp_path_factory) -> Path:
    """An empty folder; pytest's fixture searches the folders of all tests, for 2 ms each time."""
    name = re.sub(r"\W", "_", request.node.name)[:30]
    path = tmp_path_factory.getbasetemp() / f"{name}_{next(_numbers)}"
    path.mkdir()
    return path


@pytest.fixture
def run_script(tmp_path, monkeypatch, capsys) -> Callable[..., Result]:
    """``run_script(text or path, *options, status=0, folder="run")``: compiled, in this process.

    Of a path, dump pyplot and save_plot write nothing; test_dumps.py and test_plots.py draw.
    Elements draw in in.element alone.
    """
    from comparisons.results import Result
    from karamelo_py.app.cli import main
    from karamelo_py.output import plots
    from karamelo_py.run.element import Response
    from karamelo_py.styles.dumps.pyplot import PyPlot

    def run(script: str | Path, *options: str, status: int = 0, folder: str = "run") -> Result:
        place = tmp_path / folder
        place.mkdir(exist_ok=True)
        monkeypatch.chdir(place)
        capsys.readouterr()
        with monkeypatch.context() as patch:
            # A picture takes as long as its scene at a small size: one scene draws its own.
            if isinstance(script, Path) and script.name != "in.sod":
                patch.setattr(PyPlot, "write", lambda dump: None)
                patch.setattr(plots, "draw", lambda *_: None)
            if not isinstance(script, Path) or script.name != "in.element":
                patch.setattr(Response, "draw", lambda *_: None)
            result = main([str(_prepared(place, script)), *options])
        captured = capsys.readouterr()
        return _checked(Result(result, captured.out, captured.err, place), status)

    return run


@pytest.fixture(scope="module", autouse=True)
def _settled() -> None:
    """What lives when a module begins stays: Python's collector need not go through it again."""
    gc.collect()
    gc.freeze()


@contextmanager
def interpreting(*folders: Path, python: str = sys.executable) -> Iterator[subprocess.Popen]:
    """A process that interprets scripts, and finds packages in further folders.

    Another `python` starts it as a fork.
    """
    path = os.pathsep.join([*map(str, folders), os.environ["PYTHONPATH"]])
    forked = ["-c", "from uncompiled import answer; answer()"]
    process = subprocess.Popen(
        [python, *([str(TESTS / "uncompiled.py")] if python == sys.executable else forked)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path},
        text=True,
        encoding="utf-8",
    )
    package = process.stdout.readline().strip()
    assert Path(package).is_relative_to(ROOT), f"{package} is run, and not the tree"
    yield process
    process.stdin.close()
    process.wait(timeout=30)


@pytest.fixture(scope="session")
def _interpreter(_forking) -> Iterator[subprocess.Popen]:
    with interpreting(python=_forking) as process:
        yield process


def _ask(process: subprocess.Popen, request: dict) -> dict:
    process.stdin.write(json.dumps(request) + "\n")
    process.stdin.flush()
    answer = process.stdout.readline()
    assert answer, "the process that interprets scripts has died; its message is above"
    return json.loads(answer)


@pytest.fixture
def run_interpreted(tmp_path, _interpreter) -> Callable[..., Result]:
    """As `run_script`, but interpreted: for many kinds of tiny scenes, which need no compiling.

    With ``status=None`` it may end as it likes; ``command="check"`` is that of the command line.
    """
    from comparisons.results import Result

    def run(
        script: str | Path,
        *options: str,
        status: int | None = 0,
        folder: str = "run",
        command: str = "run",
    ) -> Result:
        place = tmp_path / folder
        place.mkdir(exist_ok=True)
        arguments = [command, str(_prepared(place, script)), *options]
        answer = _ask(_interpreter, {"folder": str(place), "arguments": arguments})
        return _checked(Result(answer["status"], answer["out"], answer["err"], place), status)

    return run


@pytest.fixture
def state_interpreted(tmp_path, _interpreter) -> Callable[..., dict[str, np.ndarray]]:
    """``state_interpreted(script, *columns)``: the exact state at the end, or columns of it.

    With ``boxes=True`` points give to boxes of small tiles, as many points do, not to the nodes;
    with ``ranks=N`` so many share them. Files are kept in `out`. Of a script that ``fails`` it is
    the message.
    """
    import numpy as np

    def run(
        script: str,
        *columns: str,
        boxes: bool = False,
        ranks: int = 1,
        out: str = "",
        fails: bool = False,
    ) -> dict[str, np.ndarray] | str:
        path = _prepared(tmp_path, script)
        file = str(tmp_path / "state.npz")
        request = {"folder": str(tmp_path), "arguments": [str(path)], "state": file}
        request |= {"columns": columns, "boxes": boxes}
        if out:
            (tmp_path / out).mkdir()
        request |= {"ranks": ranks, "out": out and str(tmp_path / out), "fails": fails}
        answer = _ask(_interpreter, request)
        assert answer["status"] == 0, answer["err"]
        if fails:
            return answer["err"]
        with np.load(file) as arrays:
            return dict(arrays)

    return run


BROWSERS = "chromium", "chromium-browser", "google-chrome", "chrome"  # as commands


@pytest.fixture
def browser(request) -> Iterator[Any]:
    """Chromium without a window: that of Playwright, or one that is installed."""
    assert "in_a_browser" in request.node.name, "by this name .ci/run finds such tests"
    sync = pytest.importorskip("playwright.sync_api", reason="no Playwright to lead a browser")
    drawing = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # WebGL without a card
    with sync.sync_playwright() as started:
        for path in (None, *filter(None, map(shutil.which, BROWSERS))):
            try:
                found = started.chromium.launch(executable_path=path, args=drawing)
            except sync.Error as error:
                why = str(error).splitlines()[0]
            else:
                break
        else:
            pytest.skip(f"no browser: {why}")
        yield found
        found.close()


@contextmanager
def forking(**environment: str) -> Iterator[str]:
    """A command that starts like Python, as a fork of a process that has the program at hand."""
    if os.name != "posix":
        yield sys.executable
        return
    with TemporaryDirectory() as folder:  # a socket has a short path
        words = [sys.executable, str(TESTS / "forking.py"), f"{folder}/door"]
        python = Path(folder) / "python"
        start = " ".join([words[0], "-ISs", *words[1:]])
        python.write_text(f'#!/bin/sh\nexec {start} "$@"\n', encoding="utf-8")
        python.chmod(0o755)
        process = subprocess.Popen(words, stdout=subprocess.PIPE, env=os.environ | environment)
        process.stdout.readline()
        yield str(python)
        process.kill()
        process.communicate()


@pytest.fixture(scope="session")
def _forking() -> Iterator[str]:
    with forking(NUMBA_DISABLE_JIT="1") as python:
        yield python


@pytest.fixture(scope="session")
def compiling() -> Iterator[str]:
    """A Python that compiles, and starts as a fork."""
    with forking() as python:
        yield python


@pytest.fixture
def starts_are_cheap(_forking, monkeypatch) -> Iterator[None]:
    """Runs and code, interpreted, start as forks of a process that has the program at hand."""
    from karamelo_py.app.studies import case

    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    monkeypatch.setattr(sys, "executable", _forking)
    python, case.PROGRAM[0] = case.PROGRAM[0], _forking
    yield
    case.PROGRAM[0] = python
