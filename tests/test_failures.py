"""What goes wrong while a scene runs: found, explained, and nothing lost.

Interpreted; the compiled loop finds the same things in the same places.
"""

import os
import re
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from scenes import block

from comparisons.results import read_dump, read_log

OUTPUT = (
    "set_output(5)",
    "log_modify(custom, step, time)",
    "dump(d, all, particle, 5, d.*.LAMMPS, x, y, vx)",
)


def stopped(result, *words, too_large=False):
    """Check what a stopped run leaves behind; return its message.

    With a step that was `too_large` from the start on, the good state is that of the start, and log
    and dumps show how far it came.
    """
    message = result.err
    assert message.count("error:") == 1
    for word in ("step ", "t = ", "of solid 'body'", "  fix: ", "last_good.", *words):
        assert word in message, (word, message)
    [good] = result.folder.glob("last_good.*.h5")
    with h5py.File(good) as file:
        step, points = file.attrs["step"], file["state/points/0"]
        for name, column in points.items():
            assert np.isfinite(column[:]).all(), name
        count = len(points["id"])
    assert f"last_good.{step}.h5" in message
    log = read_log(result.folder / "log.mpm")
    assert log.Step[0] == 0
    assert log.Step[-1] > step == 0 if too_large else log.Step[-1] == step
    for path in result.folder.glob("d.*.LAMMPS"):
        assert len(read_dump(path)[0].id) == count
    return message


def test_a_formula_that_gives_nan(run_interpreted):
    """sqrt of a negative number from time 0.02 on."""
    script = block(2, "fix(g, body_force, all, sqrt(0.02-time), 0)", "set_dt(0.001)", *OUTPUT,
                   "run(200)")  # fmt: skip
    result = run_interpreted(script, status=1)
    message = stopped(result, "not a number", "formula", "point ")
    assert "fix g gets NaN from sqrt(0.02 - time) (step " in message
    assert re.search(r"\n +\d+ \| fix\(g, body_force", message)
    [good] = result.folder.glob("last_good.*")
    # The force is NaN from the 22nd step on; found within 100 steps of it (issue 2).
    step = int(good.name.split(".")[1])
    assert 20 <= step <= 121
    assert "Traceback" not in message


def test_the_fix_whose_formula_gives_no_number(run_interpreted):
    """Where it does; not one that reads its NaN, nor one that only measures."""
    lines = (
        "fix(reads, body_force, all, 0)",
        "fix(measures, check_solution, all, sqrt(-1-x))",
        "fix(g, body_force, all, if(time < 0.002, 0, 1/(x-0.5)))",
        "fix(reads, body_force, all, g_x)",
    )
    script = block(1, *lines, "set_dt(0.001)", *OUTPUT, "run(200)")
    message = stopped(run_interpreted(script, status=1), "not a number")
    assert "fix g gets inf at (0.5) from if(time < 0.002, 0, 1/(x - 0.5)) (step " in message


def test_a_point_that_leaves_the_domain(run_interpreted):
    """The block's end, at x = 0.575 and y = 0.475, reaches x = 1.2 at time 0.026: step 27."""
    script = block(2, "fix(v, initial_velocity_particles, all, 24, 0)", "set_dt(0.001)", *OUTPUT,
                   "run(200)")  # fmt: skip
    message = stopped(run_interpreted(script, status=1), "leaves the domain", "x = 1.2", "point ")
    assert "step 27," in message


def test_the_last_good_state_is_written_once(run_interpreted, tmp_path):
    """Not to the files of restart(...) as well; not over a file of somebody else; or not at all."""
    lines = ("fix(v, initial_velocity_particles, all, 10)", "set_dt(0.001)")
    script = block(1, *lines, *OUTPUT, "restart(40, r.*.h5)", "run(200)")
    result = run_interpreted(script, folder="a", status=1)
    assert "in.script -restart last_good.62.h5  # with boundary(delete)" in result.err
    assert {path.name for path in result.folder.glob("*.h5")} == {"last_good.62.h5", "r.40.h5"}
    (result.folder / "last_good.62.h5").write_text("mine")
    again = run_interpreted(script, folder="a", status=1)
    assert "leaves the domain" in again.err and "last_good." not in again.err
    assert (again.folder / "last_good.62.h5").read_text() == "mine"
    assert (again.folder / "r.62.h5").exists()
    # Outputs go on where they were.
    said = run_interpreted(script, "-out", "o", folder="b", status=1).err
    assert "-restart o/last_good.62.h5 -out o  # " in said.replace("\\", "/")
    # A folder in the place of a file to write: that is told, and what went wrong as well.
    (tmp_path / "b" / "last_good.62.h5.part").mkdir(parents=True)
    third = run_interpreted(script, folder="b", status=1)
    assert "warning: cannot write" in third.err and "error: run: point 6 of solid" in third.err


@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
def test_a_point_turned_inside_out(run_interpreted, law):
    """Nodes that move with v = -100 (x - c) turn I into I (1 - 2) in a step of 0.02."""
    script = block(1, "fix(v, velocity_nodes, all, -100*(x0-0.35))", "set_dt(0.02)", *OUTPUT,
                   "run(50)", law=law, size=(0.1,))  # fmt: skip
    message = stopped(run_interpreted(script, status=1), "inside out", "det F <= 0", "point ")
    assert "step 1," in message


def test_a_step_above_the_limit(run_interpreted):
    """set_dt far above h / (c + v) = 0.0115: a warning that names the limit, then a stop."""
    script = block(2, "fix(v, initial_velocity_particles, all, 0.4*sin(30*x0), 0)",
                   "set_dt(0.04)", *OUTPUT, "run(500)")  # fmt: skip
    result = run_interpreted(script, status=1)
    assert "warning: " in result.err
    assert result.err.index("warning: ") < result.err.index("error: ")
    assert "above the stability limit 0.0" in result.err
    stopped(result, "cause: time step above the stability limit", "fix: set_dt(", too_large=True)
    # Once: the limit and what follows stand in the warning alone.
    assert result.err.count("is above the stability limit") == 1
    assert result.err.count("warning: ") == 1 and "unstable" not in result.out
    [good] = result.folder.glob("last_good.*")
    again = run_interpreted(script, "-restart", good.name, status=1)
    assert "above the stability limit 0.0" in again.err.split("error: ")[0]
    # Who goes on with another step is told nothing.
    smaller = script.replace("set_dt(0.04)", "set_dt(0.004)").replace("run(500)", "run(20)")
    assert "limit" not in run_interpreted(smaller, "-restart", good.name, status=None).err


def too_large(d, *lines):
    """A block that vibrates, after 5 good steps by one far above the limit."""
    return block(d, "fix(v, initial_velocity_particles, all, 0.4*sin(30*x0))", "set_dt(0.002)",
                 *OUTPUT, "run(5)", "set_dt(0.04)", *lines)  # fmt: skip


def test_no_state_behind_the_start_is_good_where_the_step_was_too_large_from_there(run_interpreted):
    """The step to write is by the limit of that start, and goes on as if it had been so before."""
    script = too_large(1, "restart(2, r.*.h5)", "run(500)")
    result = run_interpreted(script, status=1)
    warned, ended = result.err.split("error: ")
    instead = re.search(r"fix: (set_dt\((\S+)\) or less, or remove set_dt)", warned)
    [good] = result.folder.glob("last_good.*")
    assert good.name == "last_good.5.h5" and result.log.Step[-1] > 5
    assert f"  fix: {instead[1]}\n  resume: karamelo-py " in ended
    assert ended.count("set_dt(") == 1
    # A file from behind that start has a ruined state: nothing to go on from, nor its limit.
    [late] = [path.name for path in result.folder.glob("r.6.h5")]
    again = run_interpreted(script, "-restart", late, status=1).err.split("error: ")[1]
    assert "fix: a smaller time step\n" in again and "last_good" not in again
    same = run_interpreted(script, "-restart", good.name, status=1).err.split("error: ")[1]
    assert same == ended
    right = script.replace("0.04", instead[2]).replace("500", "40")
    went_on = run_interpreted(right, "-restart", good.name).log
    fresh = run_interpreted(right, folder="fresh").log
    assert went_on.Step.tolist() == fresh.Step.tolist()
    assert went_on.Time.tolist() == fresh.Time.tolist()


def against_a_wall(v: float, dt: float) -> str:
    """A body that nothing strains before it meets a wall."""
    lines = (
        "region(wall, block, 1.2, INF)", "group(wall, nodes, region, wall, all)",
        f"fix(v, initial_velocity_particles, all, {v})", "fix(w, velocity_nodes, wall, 0)",
        f"set_dt({dt})", *OUTPUT, "run(1000)",
    )  # fmt: skip
    return block(1, *lines, law="neo-hookean").replace("0, 1.2", "0, 2.4")


COUNTING = """
remembers = ("n",)
n = 0
def count(points):
    global n
    n += 1
    return n
"""


@pytest.mark.parametrize("every, rows", [(1000, [0, 1]), (1, [0, 1])])
def test_parts_count_once_where_the_step_was_too_large_from_the_start(
    run_interpreted, tmp_path, every, rows
):
    """The last rows show steps that are taken once more."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run/counting.py").write_text(COUNTING)
    script = f"""
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 4, 0, 4, 0.5)
region(b, block, 1, 2, 1, 2)
material(m, neo-hookean, 1, 1, 0.3)
solid(s, region, b, 2, m, 0.5, 0)
fix(v, initial_velocity_particles, all, 0.3*sin(7*x0), 0.3*cos(5*y0))
fix(k, python, all, counting.count)
log_modify(custom, step, k)
set_output({every})
set_dt(1.2)
run(1000)
"""
    log = run_interpreted(script, status=1).log
    assert log.Step.tolist() == log.k.tolist() == rows


def test_initial_velocities_that_are_no_numbers(run_interpreted):
    """All of them: nothing then limits the step, and that is not the reason."""
    script = block(2, "fix(v, initial_velocity_particles, all, sqrt(x - 10), 0)", "run(3)")
    said = run_interpreted(script, status=1).err
    assert "points have a velocity that is not a number at time 0: fix v gets NaN" in said
    assert "rigid" not in said


def test_the_last_rows_of_a_long_run_are_not_computed_twice(run_interpreted):
    """A step 1.3 times the stable one meets a wall after a hundred steps that strained nothing."""
    result = run_interpreted(against_a_wall(0.3, 0.016), status=1)
    assert [path.name for path in result.folder.glob("*.h5")] == ["last_good.0.h5"]
    assert result.log.Step[-1] > 100
    assert result.log.Step.tolist() == list(range(0, len(result.log.Step) * 5, 5))


def test_where_points_may_be_deleted_no_start_is_kept(run_interpreted):
    """They would not come back: the message has the step to begin anew by, and there is no file."""
    result = run_interpreted("boundary(delete)\n" + too_large(1, "run(500)"), status=1)
    assert re.search(r"fix: set_dt\(\S+\) or less, or remove set_dt\n", result.err)
    assert not list(result.folder.glob("last_good.*"))


def test_a_halved_step_begins_anew_where_it_was_too_large_from_the_start(run_interpreted):
    result = run_interpreted(too_large(1, "run(40, on_trouble=halve)"))
    assert result.err.count("Back to step") == result.err.count("Back to step 5, ") == 1
    assert result.log.Step.tolist() == [*range(0, 46, 5)]


def test_a_step_that_comes_to_lie_above_the_limit(run_interpreted):
    """A body force speeds the block up until v = h / dt - c; stopped soon after, with the limit."""
    script = block(1, "fix(g, body_force, all, 5)", "set_dt(0.008)", *OUTPUT, "run(500)",
                   size=(0.2,)).replace("0, 1.2", "0, 120")  # fmt: skip
    result = run_interpreted(script, status=1)
    assert "above the stability limit, which has fallen to" in result.err
    # c = 8.2, h / dt = 12.5: reached at v = 4.3, step 108; found within 100 steps of that.
    [good] = result.folder.glob("last_good.*")
    assert 107 <= int(good.name.split(".")[1]) <= 208


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
@pytest.mark.xdist_group("neo-hookean")
def test_an_interrupted_run_is_whole(tmp_path):
    """Ctrl-C: exit status 130, the log and the dumps whole (uncompiled or not alike)."""
    script = block(2, "set_dt(0.001)", "set_output(10)", "log_modify(custom, step, time)",
                   "dump(d, all, particle, 10, d.*.LAMMPS, x)", "run(100000000)",
                   law="neo-hookean")  # fmt: skip
    (tmp_path / "in.script").write_text(script, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "karamelo_py.app.cli", "in.script"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        # Wait until it steps: compiling may take a while.
        for _ in range(1200):
            if (tmp_path / "d.20.LAMMPS").exists() or process.poll() is not None:
                break
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert "Traceback" not in out + err
    assert "interrupted" in err
    log = read_log(tmp_path / "log.mpm")
    assert len(log.Step) >= 3
    dumps = list(tmp_path.glob("d.*"))
    assert len(dumps) >= 3
    assert {len(read_dump(path)[0].id) for path in dumps} == {24}


def test_a_step_that_shrinks_to_nothing(run_interpreted):
    """A run that would never end is stopped."""
    script = """
    method(tlmpm, FLIP, linear, 1)
    dimension(1, -0.5, 1.5, 0.25)
    region(bar, block, 0, 1)
    material(m, neo-hookean, 1, 1, 0)
    solid(bar, region, bar, 2, m, 0.25, 0)
    fix(push, velocity_nodes, all, -{}*x0)
    set_output(1000)
    run_time(1)
    """
    said = run_interpreted(script.format(0.9)).err
    assert "fallen" not in said
    # Squeezed to nothing: the cells, and with them the step, are gone at the end.
    said = run_interpreted(script.format(1), status=1, folder="squeezed").err
    assert "limit of the time step has fallen to" in said
    assert "less than a millionth of the first" in said and "likely cause" not in said
    # From the start twice as fast as waves, of the speed 1.
    start = "fix(v, initial_velocity_particles, all, -2*x0)\n    set_output"
    fast = script.replace("set_output", start).format(2)
    said = run_interpreted(fast, status=1, folder="fast").err
    assert "likely cause: at the start, points move 1.88 times as fast as the waves" in said
    assert "fix: check the units of modulus, density and velocity; " in said


def test_a_step_that_is_given_may_be_large_beside_what_moves(run_interpreted):
    """A rigid body that sets off from rest has no first stable step to compare with."""
    script = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 10, 0, 10, 1)
    region(b, block, 2, 4, 2, 4)
    material(m, rigid, 1)
    solid(s, region, b, 2, m, 1, 0)
    group(g, particles, region, b, all)
    fix(f, velocity_particles, g, 0.1*time, 0)
    set_dt(0.1)
    run(5)
    """
    assert "fallen" not in run_interpreted(script).err


def test_the_last_good_state_is_nearest_to_where_energy_began_to_grow(run_interpreted):
    """A body meets a wall at step 27, by a step just below the stable one of the start.

    It stiffens, and the limit falls; before, nothing strains. The energy is looked at in steps 1,
    11, 21 and so on.
    """
    script = against_a_wall(2, 0.0097)
    result = run_interpreted(script, status=1)
    assert "after a spurious energy gain" in result.err
    [good] = result.folder.glob("last_good.*.h5")
    assert good.name == "last_good.21.h5"
    with h5py.File(good) as file:
        assert file["state/points/0/v"][:] == pytest.approx(2, rel=1e-12)
    # What the hint says of the file: the step may be another, nothing else helps.
    assert "-restart last_good.21.h5  # before energy grew; with a smaller time step" in result.err
    again = run_interpreted(script, "-restart", good.name, status=1)
    assert again.err.split("error: ")[1] == result.err.split("error: ")[1]
    basis = script.replace("linear, 1", "quadratic-spline, 1")
    assert "another script" in run_interpreted(basis, "-restart", good.name, status=1).err
    smaller = script.replace("set_dt(0.0097)", "set_dt(0.0035)").replace("run(1000)", "run(150)")
    assert "error" not in run_interpreted(smaller, "-restart", good.name).err


# The clock is told that energy has grown: a scene in which it does, and fails, takes thousands.
GROWN = """
from karamelo_py import Simulation, SimulationError
sim = Simulation(SCENE, out="files")
sim.run(250)
sim.hub.simulation.setup.control.energy[0].first_mean -= 1e6
try:
    sim.run(200)
except SimulationError as error:
    print(error)
"""


def test_the_last_good_state_is_from_before_energy_grew(tmp_path, starts_are_cheap):
    """The block leaves at step 313; it has grown from 250 on, the start of the second run."""
    scene = block(1, "fix(v, initial_velocity_particles, all, 2)", "set_dt(0.001)", *OUTPUT)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", f"SCENE = {scene!r}\n{GROWN}"], cwd=tmp_path,
        capture_output=True, text=True, env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert "step 313, " in done.stdout and "leaves the domain" in done.stdout, done.stderr
    assert "-restart files/last_good.250.h5 -out files  # before energy grew; " in done.stdout
    assert [path.name for path in (tmp_path / "files").glob("*.h5")] == ["last_good.250.h5"]
    assert read_log(tmp_path / "files" / "log.mpm").Step[-1] == 312
