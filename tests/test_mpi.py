"""Processes of MPI that carry out a script together: the bytes of one, and one end for all."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import pytest
from conftest import INPUTS, ROOT
from going_on import same_files
from plugged import install
from scenes import block
from test_ranks import HALVED

from karamelo_py.app.cli import main
from karamelo_py.app.launch import OPEN_MPI
from karamelo_py.app.simulation import Simulation, SimulationError

MPIEXEC = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or shutil.which("mpiexec")
needs_mpi = pytest.mark.skipif(
    MPIEXEC is None or find_spec("mpi4py") is None or sys.platform == "win32",
    reason="needs mpi4py and mpiexec: pip install '.[mpi]'",
)
PROGRAM = [sys.executable, "-m", "karamelo_py.app.start"]
FILES = (
    "dump(d, all, particle, 10, d.txt, x, y, vx, s11)", "dump(n, all, grid/hdf5, 20, n.h5, mass)",
    "compute(E, energy_balance, all)", "log_modify(custom, step, time, E, E_drift)",
    "set_output(5)", "restart(10, r.*.h5)",
)  # fmt: skip


def started(folder: Path, *words: str, compiled: bool = False, **more: str) -> subprocess.Popen:
    """A command in a folder; its scenes are interpreted unless they are to be compiled."""
    folder.mkdir(exist_ok=True)
    environment = {**os.environ, **({} if compiled else {"NUMBA_DISABLE_JIT": "1"}), **more}
    return subprocess.Popen(
        words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL, text=True, encoding="utf-8",
    )  # fmt: skip


def by_ranks(
    folder: Path, script: str | Path, ranks: int, *words: str, program=PROGRAM, **more
) -> tuple:
    """Exit status, output and errors of a script of so many processes."""
    process = started(folder, *program, str(script), "--ranks", str(ranks), *words, **more)
    out, err = process.communicate(timeout=300)
    assert "Traceback" not in out + err
    return process.returncode, out, err


def script(folder: Path, *lines: str, **scene) -> Path:
    path = folder / "in.script"
    path.write_text(block(scene.pop("dimension", 2), *lines, **scene), encoding="utf-8")
    return path


def moving(folder: Path, *lines: str, size: float = 0.2) -> Path:
    start = "fix(v, initial_velocity_particles, all, 0.5*sin(9*x0), 0.2*cos(8*y0))"
    return script(folder, start, *lines, size=(size, size))


# --- the same bytes -----------------------------------------------------------------------------


@pytest.mark.full
@needs_mpi
@pytest.mark.xdist_group("disks")
@pytest.mark.parametrize("further", [False, True])
def test_compiled_in_the_plane(tmp_path, further):
    """Two processes, which both compile; three go `further` from their file.

    Interpreted, three go on from one of two in `test_nobody_has_the_whole`.
    """
    disks = INPUTS / "in.two_disks"
    text = (
        disks.read_text(encoding="utf-8").split("run")[0].replace("set_dt(0.001)", "dt_factor(0.5)")
    )
    path = tmp_path / "in.script"
    path.write_text(text + "\n".join(FILES) + "\nrun(20)\n", encoding="utf-8")
    words = (str(path), "-var", "N", "60", "-var", "v", "3", "--threads", "1")  # sorted often
    one, three, two = (tmp_path / name for name in ("one", "three", "two"))
    one.mkdir()
    assert main([*words, "-out", str(one)]) == 0
    assert by_ranks(two, *words[:1], 2, *words[1:], compiled=True)[0] == 0
    same_files(one, two)
    if not further:
        return
    shutil.copytree(two, three)
    assert by_ranks(three, words[0], 3, *words[1:], "-restart", "r.10.h5", compiled=True)[0] == 0
    same_files(one, three)


# Few points are shared out, too, in tiles of few cells.
SMALL_TILES = """
from karamelo_py.run import tiles
tiles.DIRECT_UP_TO, tiles.TILES = 0, {1: 4, 2: 4, 3: 2}
"""
# Every method: contact, heat, mesh, damage, axisymmetry, one to three dimensions.
DOZEN = {
    "two_disks": 20, "sod": 1, "heat_slab": 1, "column": 1, "dam_break": 0.4, "cantilever": 0.5,
    "granular_column": 0.4, "elastic_gate": 0.5, "shear_heating": 1, "disk_impact": 0.4,
    "cold_spray_axisymmetric": 0.5, "axis_aligned_3d": 0.5, "taylor_bar": 0.4, "hertz": 0.5,
}  # fmt: skip


@needs_mpi
@pytest.mark.full
@pytest.mark.parametrize("name", DOZEN)
def test_scenes(tmp_path, name):
    """The same bytes from 1 to 4 processes with 1 and 2 threads."""
    (tmp_path / "sitecustomize.py").write_text(SMALL_TILES, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    text = (INPUTS / f"in.{name}").read_text(encoding="utf-8")
    every = "set_output(5)\nrestart(10, r.*.h5)\ndump(every, all, particle, 10, every.txt, x, vx)\n"
    text = re.sub(r"^run\w*\(.*$", every + "run(30)", text, flags=re.M)
    (tmp_path / "in.script").write_text(text, encoding="utf-8")
    size = "N" if name == "two_disks" else "refine"
    for ranks, threads in product((1, 2, 3, 4), (1, 2)):
        words = ("-var", size, str(DOZEN[name]), "--threads", str(threads))
        folder = tmp_path / f"{ranks}x{threads}"
        found = by_ranks(
            folder, tmp_path / "in.script", ranks, *words, compiled=True, PYTHONPATH=folders
        )
        assert found[0] == 0, found[2]
        same_files(tmp_path / "1x1", folder)


@needs_mpi
@pytest.mark.full
def test_bench(tmp_path):
    """Shares of waiting are shares; each process has steps of its own to do."""
    words = (*PROGRAM, "bench", "disks-80", "--ranks", "2", "--seconds", "0.2", "-o", "a.json")
    process = started(tmp_path, *words, compiled=True)
    _, err = process.communicate(timeout=500)
    assert process.returncode == 0, err
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    rows = json.loads(text)["workloads"]["disks-80"]["scaling"]
    for row in rows:
        assert (0 < row["exchange"] < 1) == (row["ranks"] > 1)
        assert 0 <= row["imbalance"] < 1


NOBODY = """
from karamelo_py.run.mpi.whole import Whole
from karamelo_py.run import tiles
tiles.DIRECT_UP_TO = 0
def gathers(*_, **__):
    raise MemoryError("of the whole scene")
Whole.gather = gathers
"""


@pytest.mark.full
@needs_mpi
def test_nobody_has_the_whole(tmp_path):
    """Dumps, computes, files to go on from, and three that go on from one of two.

    Of threads that stand for processes: `test_nobody_asks_for_the_whole` of test_ranks.py.
    """
    (tmp_path / "sitecustomize.py").write_text(NOBODY, encoding="utf-8")
    shutil.copy(Path(__file__).parent / "shoves.py", tmp_path)
    lines = (
        "compute(p, linear_momentum, all)", "compute(m, max_position, all)",
        "compute(e, error, all, ux, 0.1*time)", "compute(at, probe, all, s11, x=0.4)",
        "group(n, nodes, region, box, all)", "compute(c, center_of_mass, n)",
        "fix(f, force_particles, all, 3, sin(9*x0))", "fix(a, edge_pressure, all, box, 2)",
        "fix(s, python, all, shoves.sway_alone, final_integrate)",
        "dump(p, all, pyplot, 10, p.*.png, 3, 3, vx)", "dump(v, all, vtk, 10, v.*.vtu, seq)",
        "dump(g, all, grid, 10, g.*.txt, vx, mass, vol)",
        "region(two, block, 0.59, 0.69, 0.3, 0.5)", "solid(two, region, two, 2, rubber, 0.1, 0)",
        "fix(h, contact/hertz, body, two)",
    )  # fmt: skip
    log = "log_modify(custom, step, E, p_x, m_x, e, at, c_y, f_y, a_x, s_x, h_x)"
    path = moving(tmp_path, *lines, *FILES[:3], log, *FILES[-2:], "run(12)", size=0.3)
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    status, _, err = by_ranks(tmp_path / "run", path, 2, PYTHONPATH=folders)
    assert status == 0, err
    shutil.copytree(tmp_path / "run", tmp_path / "again")
    words = path, 3, "-restart", "r.10.h5"
    status, _, err = by_ranks(tmp_path / "again", *words, PYTHONPATH=folders)
    assert status == 0, err
    same_files(tmp_path / "run", tmp_path / "again")


@needs_mpi
@pytest.mark.full
def test_a_step_that_is_halved(tmp_path):
    """Behind files that hold the state that each process goes back to: other numbers of them."""
    path = script(tmp_path, "restart(6, r.*.h5)", *HALVED, size=(0.4, 0.3))
    (tmp_path / "sitecustomize.py").write_text(SMALL_TILES, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    one, two = tmp_path / "1", tmp_path / "2"
    for folder, ranks in ((one, 1), (two, 2)):
        assert by_ranks(folder, path, ranks, PYTHONPATH=folders)[0] == 0
    same_files(one, two)
    for number, ranks in ((6, 3), (18, 1), (30, 2)):
        again = tmp_path / f"behind {number}"
        shutil.copytree(two, again)
        status, _, err = by_ranks(
            again, path, ranks, "-restart", f"r.{number}.h5", PYTHONPATH=folders
        )
        assert status == 0, err
        same_files(two, again)


# --- one end for all ----------------------------------------------------------------------------


@needs_mpi
def test_a_wrong_script(tmp_path, _forking):
    path = script(tmp_path, "fix(g, gravitate, all)")
    status, out, err = by_ranks(tmp_path, path, 2, program=[_forking, "-m", "karamelo_py.app.cli"])
    assert status == 1 and not out
    assert err.count("unknown fix style 'gravitate'") == 1 and "PMIX" not in err
    assert main([str(path)]) == 1


@needs_mpi
def test_started_by_mpiexec(tmp_path):
    """One output, without the codes of a terminal that mpiexec pretends to be."""
    path = script(tmp_path, "run(2)")
    process = started(tmp_path, MPIEXEC, "-n", "2", *PROGRAM, str(path), **OPEN_MPI)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0 and out.count("Run finished") == 1 and "\x1b" not in out, err


def running(folder: Path, *lines: str, **more: str) -> subprocess.Popen:
    """A long run of two processes, which has begun."""
    path = moving(folder, "set_output(1)", *lines, "run(100000)")
    process = started(folder / "run", *PROGRAM, str(path), "--ranks", "2", **more)
    log = folder / "run" / "log.mpm"
    while not (log.exists() and log.read_text(encoding="utf-8").count("\n") > 3):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    return process


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize(
    ("rank", "number"), [(None, signal.SIGTERM), (1, signal.SIGTERM), (1, signal.SIGINT)]
)
def test_a_signal(tmp_path, rank, number):
    """As with one process: the last state, whole files, 128 + its number; whoever gets it."""
    process = running(tmp_path, "dump(d, all, particle, 1000, d.*.txt, x)")
    os.kill(process.pid if rank is None else _pids(process.pid)[rank], number)
    _out, err = process.communicate(timeout=120)
    assert process.returncode == 128 + number, err
    assert err.count("interrupted: the log and the dumps are complete") == 1
    last = (tmp_path / "run" / "log.mpm").read_text(encoding="utf-8").split()[-3]
    assert (tmp_path / "run" / f"d.{last}.txt").exists()


SLOW = """
import pathlib
import time
pathlib.Path("begun").touch()
time.sleep(60)
"""


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize("ranks", ["1", "2"])
def test_a_signal_before_the_run(tmp_path, ranks):
    """One message, and nothing is left behind."""
    (tmp_path / "slow.py").write_text(SLOW, encoding="utf-8")
    path = moving(tmp_path, "fix(s, python, all, slow.down)", "run(2)")
    process = started(tmp_path / "run", *PROGRAM, str(path), "--ranks", ranks)
    while not (tmp_path / "run" / "begun").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert not out and err == "error: ended by SIGTERM\n"


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize("words", [(), ("--ranks", "2")])
def test_a_signal_amid_the_first_picture(tmp_path, words):
    """It is drawn, and the run takes no step."""
    path = moving(tmp_path, "dump(d, all, pyplot, 1000, d.*.png, 30, 30, vx)", "run(2)")
    process = started(tmp_path / "run", *PROGRAM, str(path), *words)
    while not list((tmp_path / "run").glob("*.part")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)
    process.send_signal(signal.SIGTERM)
    _out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert err.count("interrupted: the log and the dumps are complete") == 1
    names = sorted(path.name for path in (tmp_path / "run").iterdir())
    assert names == ["d.0.png", "log.mpm", "run.json"]


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize("rank", [0, 1])
def test_a_process_is_stopped(tmp_path, rank):
    """All wait; a signal continues it, and the run ends with the last state of all."""
    process = running(tmp_path)
    os.kill(_pids(process.pid)[rank], signal.SIGSTOP)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _out, err = process.communicate(timeout=120)
    assert process.returncode == 128 + signal.SIGINT, err
    assert err.count("interrupted: the log and the dumps are complete") == 1


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize("rank", [0, 1])
def test_a_process_is_killed(tmp_path, rank):
    process = running(tmp_path)
    os.kill(_pids(process.pid)[rank], signal.SIGKILL)
    _out, err = process.communicate(timeout=120)
    assert process.returncode == 128 + signal.SIGKILL
    assert err.count("error: ") == 1 and f"error: process {rank + 1} of 2 (pid " in err
    lines = (tmp_path / "run" / "log.mpm").read_text(encoding="utf-8").splitlines()
    assert all(len(line.split()) == 3 for line in lines)


ENDS = """
import os
import signal
import time
if os.environ.get("OMPI_COMM_WORLD_RANK") == "1":
    from karamelo_py.run.mpi import comm
    def agree(self, word, patience=comm.inf, *, before=comm.MpiComm.agree):
        if word == comm.WELL:
            time.sleep(2)  # the first has done all
            os.kill(os.getpid(), signal.SIGKILL)
        return before(self, word, patience)
    comm.MpiComm.agree = agree
"""


@pytest.mark.full
@needs_mpi
def test_a_process_is_killed_at_the_end(tmp_path):
    """When all is written and it only has to say so."""
    (tmp_path / "sitecustomize.py").write_text(ENDS, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    status, out, err = by_ranks(
        tmp_path / "run", moving(tmp_path, "run(20)"), 2, PYTHONPATH=folders
    )
    assert status == 128 + signal.SIGKILL, err + out
    assert "Run finished" in out
    assert err.count("error: ") == 1 and "process 2 of 2 (pid " in err
    assert "after the last run: all files are complete" in err


def _pids(launcher: int) -> list[int]:
    """The processes of a run, in the order of their ranks."""
    found = subprocess.run(
        ["ps", "-e", "-o", "pid=,ppid="], capture_output=True, text=True, check=True
    )
    pairs = [tuple(map(int, line.split())) for line in found.stdout.splitlines()]
    mpiexec = next(pid for pid, parent in pairs if parent == launcher)
    return sorted(pid for pid, parent in pairs if parent == mpiexec)


BREAKS = """
import json
import os
import re
from karamelo_py.run import simulation, tiles
from karamelo_py.run.mpi import partition
from karamelo_py.styles.computes import conserved
tiles.DIRECT_UP_TO = 0
if os.environ.get("OMPI_COMM_WORLD_RANK") == "1":
    def out_of_memory(*_):
        raise MemoryError
    {} = out_of_memory
"""


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize(
    "function",
    [
        "simulation.Simulation._advance",
        "partition.SharedTiles.give",
        "conserved.LinearMomentum.terms",
    ],
)
def test_only_one_fails(tmp_path, function):
    """In its steps, in what kernels ask for, in what a compute adds up: the others end, too."""
    (tmp_path / "sitecustomize.py").write_text(BREAKS.format(function), encoding="utf-8")
    path = moving(tmp_path, "compute(p, linear_momentum, all)", "run(20)")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    status, _, err = by_ranks(tmp_path / "run", path, 2, PYTHONPATH=folders)
    assert status == 1
    assert err.count("error: ") == 1 and "memory" in err and "in process 2 of 2" in err


READ_ONLY = """
import errno
import os
from karamelo_py.run import tiles
tiles.DIRECT_UP_TO = 0
if os.environ.get("OMPI_COMM_WORLD_RANK") == "0":
    from karamelo_py.output import files
    replace, done = os.replace, []
    def once(*names):
        if done:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        done.append(replace(*names))
    files.os = type("", (), {"replace": once})
"""
FAILS = "def push(points):\n    if points.time > 0.01:\n        points.force[99999] = 0\n"


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize(
    "line, says",
    [
        ("dump(d, all, particle, 5, d.*.txt, x)", "Read-only file system"),
        ("dump(d, all, vtk, 5, d.*.vtu)", "Read-only file system"),
        ("restart(5, r.*.h5)", "Read-only file system"),
        ("fix(f, python, all, fails.push)", "index 99999 is out of bounds"),
    ],
)
def test_the_first_fails(tmp_path, line, says):
    """The folder becomes read-only; a fix in Python raises in the midst of a step."""
    if "python" in line:
        (tmp_path / "fails.py").write_text(FAILS, encoding="utf-8")
    else:
        (tmp_path / "sitecustomize.py").write_text(READ_ONLY, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    path = moving(tmp_path, line, "run(20)")
    status, _, err = by_ranks(tmp_path / "run", path, 2, PYTHONPATH=folders)
    assert status == 1, err
    assert err.count("error: ") == 1 and says in err
    assert not list((tmp_path / "run").glob("*.part"))


@pytest.mark.full
@needs_mpi
def test_a_run_that_goes_wrong(tmp_path):
    """All processes know what is wrong: one message, and the files of one; as in test_ranks.py."""
    (tmp_path / "sitecustomize.py").write_text(SMALL_TILES, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    lines = "dump(d, all, movie, 5, d.gif, 2, 2, vx)", "set_dt(0.004)", "run(60)"
    path = moving(tmp_path, "fix(w, initial_velocity_particles, all, 10+3*y0, 0)", *lines)
    for ranks in (1, 2):
        status, _, err = by_ranks(tmp_path / str(ranks), path, ranks, PYTHONPATH=folders)
        assert status == 1 and err.count("error: ") == 1 and "leaves the domain" in err
        assert "in process" not in err
    same_files(tmp_path / "1", tmp_path / "2")


ONE_FAILS = """
import os
from karamelo_py.styles.fixes.python import Python
second = os.environ.get("OMPI_COMM_WORLD_RANK", "1") == "1"
def fails(points):
    if second and points.time > 0.015:
        points.force[99999] = 0
    Python._agree = lambda *_: None  # which a fix of a plug-in has not
fails.point_by_point = True
"""


@pytest.mark.full
@needs_mpi
def test_a_function_fails_on_one_process(tmp_path):
    """At the end of a step, whose row is not written then, as with a single process."""
    (tmp_path / "sitecustomize.py").write_text(SMALL_TILES, encoding="utf-8")
    (tmp_path / "one.py").write_text(ONE_FAILS, encoding="utf-8")
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    path = moving(
        tmp_path, "fix(f, python, all, one.fails, final_integrate)", "set_output(1)", "run(9)"
    )
    status, _, err = by_ranks(tmp_path / "two", path, 2, PYTHONPATH=folders)
    assert status == 1 and err.count("error: ") == 1 and "index 99999 is out of bounds" in err
    assert by_ranks(tmp_path / "one", path, 1, PYTHONPATH=folders)[0] == 1
    same_files(tmp_path / "one", tmp_path / "two")


PART_OF_ALL = """
    def initial_integrate(self, points):
        second = os.environ.get("OMPI_COMM_WORLD_RANK", "1") == "1"
        {line}
"""


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize(
    "line, says",
    [
        ("second and points.total(points.mass)", "reaches its end on one process, and a total on"),
        ("self.publish('x', points.position[:, 0].sum())", "fix drag: air_x is "),
        ("self.publish('x', points.total(points.mass))", ""),
    ],
)
def test_a_plug_in_looks_at_its_part_alone(tmp_path, line, says):
    """A fix that looks at each point on its own, and asks for more than that.

    A compute and a dump ask for all points.
    """
    site = install(tmp_path / "site")
    (site / "sitecustomize.py").write_text(SMALL_TILES, encoding="utf-8")
    drag = site / "mpm_examples" / "drag.py"
    text, _, _ = drag.read_text(encoding="utf-8").partition("    def initial_integrate")
    text = text.replace("published =", "point_by_point = True\n    published =")
    drag.write_text(f"import os\n{text}{PART_OF_ALL.format(line=line)}", encoding="utf-8")
    folders = os.pathsep.join([str(site), os.environ["PYTHONPATH"]])
    lines = "compute(p, momentum, all)", "log_modify(custom, step, p_x)"
    lines += "fix(air, drag, all, 0.5)", "dump(d, all, csv, 5, d.*.csv, x, vx)"
    path = moving(tmp_path, *lines, "set_output(1)", "run(9)")
    status, _, err = by_ranks(tmp_path / "two", path, 2, PYTHONPATH=folders)
    assert status == bool(says) and err.count("error: ") == bool(says)
    if not says:
        assert by_ranks(tmp_path / "one", path, 1, PYTHONPATH=folders)[0] == 0
        same_files(tmp_path / "one", tmp_path / "two")
    assert says in err and ("| fix(air, drag, all, 0.5)" in err) == bool(says)


# --- before anything is started -----------------------------------------------------------------


def test_without_mpi4py(tmp_path, monkeypatch, capsys):
    path = str(script(tmp_path, "run(2)"))
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    hint = "hint: pip install '.[mpi]'"
    if MPIEXEC:
        assert main([path, "--ranks", "2"]) == 1
        err = capsys.readouterr().err
        assert err.startswith("error: --ranks 2 needs mpi4py") and hint in err
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert main([path]) == 1
    err = capsys.readouterr().err
    assert err.startswith("error: several processes of one scene need mpi4py") and hint in err
    assert main([path, "--ranks", "3"]) == 1
    assert "error: --ranks 3: mpiexec has started 2 processes" in capsys.readouterr().err
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    monkeypatch.setattr(sys, "stdout", sys.stdout)
    monkeypatch.setattr(sys, "stderr", sys.stderr)
    assert main([path]) == 1
    assert capsys.readouterr() == ("", "")


def test_what_several_processes_cannot_do(monkeypatch, capsys):
    assert main(["sweep", "in.script", "--ranks", "2"]) == 1
    assert "error: karamelo-py sweep runs in one process" in capsys.readouterr().err
    monkeypatch.setenv("SLURM_STEP_NUM_TASKS", "4")
    monkeypatch.setenv("SLURM_PROCID", "0")
    assert main(["styles"]) == 1
    assert "karamelo-py styles runs in one process, but 4 were started" in capsys.readouterr().err


def test_a_scene_in_python_is_of_one_process(monkeypatch):
    """Never so many copies of the same run; one message."""
    monkeypatch.setenv("PMI_SIZE", "3")
    monkeypatch.setenv("PMI_RANK", "0")
    with pytest.raises(SimulationError, match="3 processes were started") as refused:
        Simulation("a = 2")
    assert "mpiexec -n 3 karamelo-py SCRIPT" in str(refused.value)
    monkeypatch.setenv("PMI_RANK", "1")
    with pytest.raises(SystemExit) as left:
        Simulation("a = 2")
    assert not left.value.code
    assert Simulation("a = 2", alone=True).variables["a"] == 2


def test_one_rank_is_no_other_run(tmp_path, run_interpreted):
    assert run_interpreted(block(2, "run(2)"), "--ranks", "1").log.Step[-1] == 2


# --- check ----------------------------------------------------------------------------------------

COUNTS = """
from karamelo_py.run import tiles
from karamelo_py.run.mpi.comm import MpiComm
tiles.DIRECT_UP_TO, tiles.TILES = 0, {2: 2}
connect, start = MpiComm.connect, MpiComm.start
def counting(self, given, taken):
    return sum(array.nbytes for _, array in given), connect(self, given, taken)
def starting(self, link):
    with open(f"passed.{self.rank}", "a") as file:
        print(link[0], file=file)
    start(self, link[1])
MpiComm.connect, MpiComm.start = counting, starting
MpiComm.finish = lambda self, link, finish=MpiComm.finish: finish(self, link[1])
MpiComm.disconnect = lambda self, link, free=MpiComm.disconnect: free(self, link[1])
"""


@pytest.mark.full  # of one process: test_what_two_pass_on of test_ranks.py
@needs_mpi
def test_what_is_passed_on_is_foretold(tmp_path):
    """`check` makes the plan of all processes in one; the bytes are those of real ones."""
    (tmp_path / "sitecustomize.py").write_text(COUNTS, encoding="utf-8")
    path = moving(tmp_path, "run(4)", size=0.5)
    folders = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    assert by_ranks(tmp_path / "run", path, 2, PYTHONPATH=folders)[0] == 0
    check = started(tmp_path, *PROGRAM, "check", str(path), "--ranks", "2", PYTHONPATH=folders)
    out, err = check.communicate(timeout=100)
    assert check.returncode == 0, err
    found = [
        # The first step has the forces of the state that it begins with, too.
        sum(map(int, (tmp_path / "run" / f"passed.{rank}").read_text().split()[-2:]))
        for rank in (0, 1)
    ]
    low, high = re.search(r"bytes sent per step +(\d+) +(\d+)", out).groups()
    assert sorted(found) == [int(low), int(high)] and int(low) > 0
    points = re.search(r"  points +(\d+) +(\d+)", out).groups()
    assert sum(map(int, points)) == 100


def test_the_page_of_many_processes(tmp_path):
    """Its batch script is one, and it explains each line that `check` prints of processes."""
    page = (ROOT / "docs" / "many-processes.md").read_text(encoding="utf-8")
    batch = re.search(r"^```bash\n(.*?)^```", page, re.S | re.M)[1]
    if bash := shutil.which("bash"):
        subprocess.run([bash, "-n"], input=batch, text=True, check=True)
    checked = started(tmp_path, *PROGRAM, "check", str(script(tmp_path, "run(1)")), "--ranks", "2")
    lines = checked.communicate(timeout=100)[0].partition("distributed over 2 processes")[2]
    names = re.findall(r"^  ([a-z][a-zMB, ]*[a-zB]) +[\d.]", lines, re.M)
    assert len(names) == 8 and all(f"| `{name}` |" in page for name in names)
    assert "so few points are not distributed" in lines
