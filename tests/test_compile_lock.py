"""Processes that need the same kernels at once: each is compiled once, and nobody waits in vain."""

import errno
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from numba import config
from test_cache import ALL, VALUES, Shapes, Tag, fresh

from karamelo_py.compiler import CannotCompile, files, kernel
from karamelo_py.compiler.disk import lock as lock_module
from karamelo_py.compiler.disk.lock import lock
from karamelo_py.compiler.trace.session import session

fcntl = pytest.importorskip("fcntl")
pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")

HOLDS = """
import sys
from pathlib import Path
from karamelo_py.compiler.disk.lock import lock
with lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "kernels" / "loop.lock"


@pytest.fixture
def holder(path):
    """Another process that has the lock."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"held\n"
    yield process
    process.kill()
    process.communicate()


def is_free(path) -> bool:
    """Whether nobody has the lock."""
    if not path.exists():
        return True
    with path.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def test_processes_at_once_compile_each_kernel_once(tmp_path, compiling):
    """Three start on an empty cache: what one compiles the others read."""
    shapes = Shapes(compiling, tmp_path)
    with ThreadPoolExecutor() as pool:
        done = list(pool.map(lambda _: shapes.run(), range(3)))
    assert [values for values, _, _ in done] == [VALUES] * 3
    assert sorted(name for _, compiled, _ in done for name in compiled) == ALL
    assert all(told == [] for _, _, told in done)
    assert not list(shapes.kernels.glob("*.lock"))


def test_a_process_that_is_killed_is_not_waited_for(path, holder):
    assert not is_free(path)
    holder.send_signal(getattr(signal, "SIGKILL", signal.SIGTERM))
    holder.wait()
    with lock(path):
        assert not is_free(path)
    assert not path.exists()


def test_nobody_waits_for_ever(path, holder, monkeypatch):
    """A process that is stopped keeps its lock; others compile for themselves then."""
    monkeypatch.setattr(lock_module, "PATIENCE", 0.1)
    monkeypatch.setattr(session, "waits", True)
    with lock(path):
        """Another has it."""
    assert path.exists() and not is_free(path)
    # One that is stopped may hold several: nobody waits for each of them.
    monkeypatch.setattr(lock_module.time, "sleep", lambda seconds: pytest.fail("it waits again"))
    with lock(path):
        """Nor now."""


@pytest.mark.parametrize(
    ("call", "why"),
    [("os.open", errno.EROFS), ("os.open", errno.EACCES), ("fcntl.flock", errno.ENOLCK),
     ("fcntl.flock", errno.ENOTSUP), ("pathlib.Path.mkdir", errno.EROFS)],
)  # fmt: skip
def test_where_there_are_no_locks_nobody_waits(tmp_path, monkeypatch, call, why):
    """Each compiles for itself, and nothing is said of it."""

    def refuse(*arguments, **keywords):
        raise OSError(why, os.strerror(why))

    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    opened = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    with monkeypatch.context() as patched, files.telling([].append):
        patched.setattr(call, refuse)
        assert fresh()(Tag()) == 42
        with lock(tmp_path / "another" / "loop.lock"):
            """Without it."""
    if opened:
        assert len(os.listdir("/proc/self/fd")) <= opened  # older ones may be collected


def test_what_cannot_be_compiled_is_no_lock_for_others(tmp_path, monkeypatch):
    """Until the program ends, which may be hours."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))

    def wrong(x):
        return x + "a text"

    with pytest.raises(CannotCompile):
        kernel(wrong)(1.0)
    assert all(map(is_free, (tmp_path / "kernels").glob("*.lock")))
