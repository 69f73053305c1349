"""Folders that several processes would write to, and processes that end with their parent."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenes import block
from selection import few

posix = pytest.mark.skipif(sys.platform == "win32", reason="a matter of POSIX")
linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux ends a child with its parent")
LONG = "E = 1\n" + block(
    2, "fix(v, initial_velocity_particles, all, 0.001*E, 0)", "set_dt(1e-6)", "set_output(100)",
    "dump(d, all, particle, 100, d.*.LAMMPS, x)", "run(100000000)",
)  # fmt: skip


def started(folder: Path, *words: str, python: str = sys.executable, **more) -> subprocess.Popen:
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    return subprocess.Popen(
        [python, "-m", "karamelo_py.app.cli", *words], cwd=folder, env=environment,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more,
    )  # fmt: skip


def wait_for(path: Path) -> None:
    end = time.monotonic() + 60
    while not (path.is_file() and path.stat().st_size):
        assert time.monotonic() < end
        time.sleep(0.05)


def writers(folder: Path) -> list[int]:
    """Process ids whose working directory is `folder`."""
    found = []
    for link in Path("/proc").glob("[0-9]*/cwd"):
        try:
            found += [int(link.parent.name)] * (link.readlink() == folder)
        except OSError:
            continue
    return found


@linux
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGKILL])
def test_the_runs_of_a_study_end_with_it(tmp_path, _forking, sent):
    """Also if the study is killed; while it runs, a second one in the same folder is refused."""
    (tmp_path / "in.a").write_text(LONG)
    words = ("sweep", "in.a", "-var", "E=1,2", "-jobs", "1", "-record", "Step")
    study = started(tmp_path, *words)
    try:
        wait_for(tmp_path / "sweep" / "E=1" / "log.mpm")
        if sent == signal.SIGTERM:
            other = started(tmp_path, *words, python=_forking)
            assert "another study runs in sweep" in other.communicate(timeout=60)[1]
            assert other.returncode == 1
        study.send_signal(sent)
        study.communicate(timeout=60)
        end = time.monotonic() + 10
        while writers(tmp_path / "sweep" / "E=1") and time.monotonic() < end:
            time.sleep(0.05)
        assert writers(tmp_path / "sweep" / "E=1") == []
    finally:
        for pid in writers(tmp_path / "sweep" / "E=1"):
            os.kill(pid, signal.SIGKILL)
        study.kill()


@posix
def test_two_runs_in_one_folder(tmp_path, _forking):
    """The second is refused even with another log, since both would write the same dumps."""
    (tmp_path / "in.a").write_text(LONG)
    first = started(tmp_path, "in.a", "-log", "a.mpm")
    try:
        wait_for(tmp_path / "a.mpm")
        first.send_signal(signal.SIGSTOP)  # it holds the folder, and takes no time
        second = started(tmp_path, "in.a", "-log", "b.mpm", python=_forking)
        assert f"another run is writing to {tmp_path}" in second.communicate(timeout=60)[1]
        assert second.returncode == 1
        (tmp_path / "other").mkdir()
        short = LONG.replace("100000000", "2")
        (tmp_path / "in.b").write_text(short)
        third = started(tmp_path, "in.b", "-out", "other", python=_forking)
        assert (third.communicate(timeout=60), third.returncode)[1] == 0
    finally:
        first.kill()


@posix
def test_a_run_without_a_log(run_interpreted):
    result = run_interpreted(LONG.replace("100000000", "2"), "-log", "/dev/null")
    assert "Run finished" in result.out
    assert not (result.folder / "log.mpm").exists()


@posix
@pytest.mark.parametrize("closed", few(((1,), (2,), (0, 1, 2)), (2,), (0, 1, 2)))
def test_output_that_is_closed(tmp_path, closed):
    """As with >&- in a shell: the run goes on, and no file gets a closed descriptor."""
    text = LONG.replace("set_output(100)", "set_output(1)").replace("100000000", "2")
    (tmp_path / "in.a").write_text(text)
    run = started(tmp_path, "in.a", preexec_fn=lambda: [os.close(at) for at in closed])
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "Traceback" not in err and ("Run finished" in out) == (1 not in closed)
    rows = (tmp_path / "log.mpm").read_text().splitlines()
    assert [row.split()[0] for row in rows] == ["Step", "0", "1", "2"]


@posix
def test_a_folder_that_is_gone(tmp_path):
    (tmp_path / "in.a").write_text(LONG)
    for words in (("run", "../in.a"), ("sweep", "../in.a", "-var", "E=1,2")):
        gone = tmp_path / words[0]
        gone.mkdir()
        run = started(gone, *words, preexec_fn=gone.rmdir)
        assert "the current folder no longer exists" in run.communicate(timeout=60)[1]
        assert run.returncode == 1


@posix
def test_a_study_without_room(tmp_path, _forking):
    """A limit on file sizes stands in for a full disk."""
    (tmp_path / "in.a").write_text(LONG.replace("100000000", "2"))
    limited = (
        "import resource, sys; sys.dont_write_bytecode = True; "
        "from karamelo_py.app.cli import main; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100,) * 2); "
        "sys.exit(main(['sweep', 'in.a', '-var', 'E=1,2', '-record', 'Step']))"
    )
    done = subprocess.run(
        [_forking, "-c", limited], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 1
    assert "error: cannot write sweep.json: File too large" in done.stderr
    assert "internal error" not in done.stderr
