"""compute probe: means, points, places."""

import numpy as np
import pytest

from karamelo_py.app.cli import main

SCRIPT = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 2, 0, 1, 0.1)
    region(a, block, 0.2, 0.5, 0.2, 0.5)
    region(b, block, 1.2, 1.8, 0.2, 0.5)
    material(m, linear, 1, 100, 0.3)
    solid(fine, region, a, 3, m, 0.1)
    solid(coarse, region, b, 1, m, 0.1)
    group(b, particles, region, b, solid, coarse)
    fix(v, initial_velocity_particles, all, 0.1*x, 0.2*y)
    dump(d, all, particle, 1, d.*.txt, x, y, s11, volume, vx)
    compute(m, probe, all, s11)
    compute(b, probe, b, x, vx)
    compute(p, probe, all, s11, vx, point=7)
    compute(g, probe, b, s11, x=0.3, y=0.5)
    compute(far, probe, all, x, x=9)
    log_modify(custom, step, time, m, b_x, b_vx, p_s11, p_vx, g, far)
    run(4)
"""


def test_probe_measures_what_the_dump_holds(run_interpreted):
    run = run_interpreted(SCRIPT)
    dump, last = run.dump("d.4.txt"), {name: column[-1] for name, column in run.log.items()}
    of_b = dump["type"] == 2
    assert last["m"] == pytest.approx(np.average(dump.s11, weights=dump.volume), rel=1e-8)
    assert last["b_x"] == pytest.approx(
        np.average(dump.x[of_b], weights=dump.volume[of_b]), rel=1e-8
    )
    assert last["p_s11"] == pytest.approx(dump.s11[6], rel=1e-8)
    assert last["p_vx"] == pytest.approx(dump.vx[6], rel=1e-8)
    # The point of solid b nearest to a place in solid a is that at its upper left.
    corner = np.flatnonzero(of_b)[np.lexsort((-dump.y[of_b], dump.x[of_b].round(3)))[0]]
    assert last["g"] == pytest.approx(dump.s11[corner], rel=1e-8)
    assert last["far"] == pytest.approx(dump.x.max(), rel=1e-8)
    # Warned once of each probe that is more than a cell of 0.1 away from the points of its group.
    assert run.err.count("no point is near") == 2 and "no point is near x=9;" in run.err
    # Before the first step the mean place of a block is its middle.
    assert run.log.b_x[0] == pytest.approx(1.5)


def test_check_warns_of_a_probe_outside_all_points(tmp_path, capsys):
    (tmp_path / "in.x").write_text(SCRIPT)
    assert main(["check", str(tmp_path / "in.x")]) == 0
    assert capsys.readouterr().err.count("no point is near") == 2


def test_probe_of_what_is_not_there(run_interpreted):
    script = SCRIPT.replace("point=7", "point=7000")
    assert "there is no point 7000" in run_interpreted(script, status=1).err


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("compute(q, probe, all, s111)", "did you mean 's11'?"),
        ("compute(q, probe, all)", "column"),
        ("compute(q, probe, all, x, point=0)", "above 0"),
        ("compute(q, probe, all, x, point=1, x=2)", "not both"),
        ("compute(q, probe, all, x, x=1, z=0)", "a 2D scene has no coordinate z"),
    ],
)
def test_mistakes(run_interpreted, line, remedy):
    run = run_interpreted(SCRIPT.replace("run(4)", line), status=1)
    assert remedy in run.err and "in.script:" in run.err
