"""karamelo-py fit: constants that are known are found, with the ranges of linear regression."""

import re
from pathlib import Path

import numpy as np
import pandas
import pytest

from karamelo_py.app.cli import main

pytest.importorskip("scipy")
# A block in free flight: its centre is at 1.5 + speed t.
SCRIPT = """
N = 2
speed = 3
begin = 1.5
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 1/N)
region(line, block, 1, 2)
material(rubber, linear, 2, 100, 0)
solid(body, region, line, 2, rubber, 1/N, 0)
fix(v, initial_velocity_particles, all, speed)
set_dt(0.02)
compute(c, center_of_mass, all)
place = c_x - 1.5 + begin
set_output(5)
log_modify(custom, step, time, c_x, place)
run(20)
"""
TIMES = np.linspace(0, 0.4, 21)


@pytest.fixture
def folder(tmp_path, monkeypatch, starts_are_cheap):
    """A folder with the script and with measured places, in interpreted runs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.flight").write_text(SCRIPT, encoding="utf-8")
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(TIMES))
    table = pandas.DataFrame({"time": TIMES, "x": 1.5 + 3 * TIMES + noise})
    table.to_csv(tmp_path / "flight.csv", index=False)
    return tmp_path


def fitted(out):
    """Value and half of the range of each variable, as a run has said."""
    rows = out.partition("variable")[2].splitlines()[1:]
    cells = (row.split() for row in rows if len(row.split()) == 3)
    return {name: (float(value), float(half)) for name, value, half in cells if half != "–"}


@pytest.mark.full
def test_a_line_is_that_of_linear_regression(folder, capsys):
    """Value and range of 95 % by the normal equations; t(0.975, 19) = 2.0930 (any table)."""
    words = ["-var", "speed=1,5", "-var", "begin=1,3", "-var", "N=2", "-jobs", "1"]
    assert main(["fit", "in.flight", *words, "-match", "place=flight.csv:x"]) == 0
    out = capsys.readouterr().out
    measured = pandas.read_csv("flight.csv").x.to_numpy()
    matrix = np.column_stack([TIMES, np.ones(len(TIMES))])
    best, (square,), *_ = np.linalg.lstsq(matrix, measured, rcond=None)
    half = 2.0930 * np.sqrt(square / 19 * np.diag(np.linalg.inv(matrix.T @ matrix)))
    found = fitted(out)
    # As many digits as are printed.
    assert found["speed"] == pytest.approx((best[0], half[0]), rel=1e-3)
    assert found["begin"] == pytest.approx((best[1], half[1]), rel=1e-3)
    assert abs(found["speed"][0] - 3) < found["speed"][1]
    said = re.search(
        r"^karamelo-py in.flight -var speed (\S+) -var begin (\S+) -var N 2$", out, re.M
    )
    assert [float(word) for word in said.groups()] == pytest.approx(best, rel=1e-4)
    assert list(pandas.read_csv("fit.csv").status) == ["done"] * len(pandas.read_csv("fit.csv"))


@pytest.mark.full
def test_numbers_are_matched(folder, capsys):
    """The centre at the end is 1.5 + 0.4 speed; one number tells nothing of its range."""
    words = ["-var", "speed=1,5", "-jobs", "1", "-match", "max:c_x=2.62"]
    assert main(["fit", "in.flight", *words]) == 0
    assert re.search(r"^speed +2\.8 +–", capsys.readouterr().out, re.M)


@pytest.mark.full
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-var", "speed=1,2"], "speed is at the end of its range"),
        (["-var", "begin=1,2"], "begin has no effect on the measured values"),
        pytest.param(
            ["-var", "speed=1,5", "-var", "begin=1,2"],
            "begin has no effect on the measured values",
            marks=pytest.mark.full,
        ),
    ],
)
def test_what_cannot_be_found_is_told(folder, capsys, words, said):
    """c_x does not know of `begin`."""
    assert main(["fit", "in.flight", *words, "-jobs", "1", "-match", "c_x=flight.csv:x"]) == 0
    assert said in capsys.readouterr().out


def test_searches_that_disagree_give_no_range(folder, capsys):
    """A sine of 11.5 rad/s: beside it, its misfit has minima every few 2 pi/T = 2 (any textbook).

    The search from the middle, 9, ends in one of them.
    """
    script = SCRIPT.replace("run(20)", "run(6)").replace("set_output(5)", "set_output(1)")
    script = script.replace("set_dt(0.02)", "set_dt(0.5)").replace("speed)", "0)")
    script = script.replace("place = c_x - 1.5 + begin", "place = sin(speed*time)")
    (folder / "in.sine").write_text(script, encoding="utf-8")
    times = np.linspace(0, 3, 7)
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(times))
    table = pandas.DataFrame({"time": times, "y": np.sin(11.5 * times) + noise})
    table.to_csv("sine.csv", index=False)
    words = ["-var", "speed=5,13", "-jobs", "1", "-match", "place=sine.csv:y", "-most", "6"]
    assert main(["fit", "in.sine", *words]) == 0
    out = capsys.readouterr().out
    (value,) = re.findall(r"^speed +(\S+) +–$", out, re.M)
    # The noise of 0.01 over slopes of up to 3 s.
    assert float(value) == pytest.approx(11.5, abs=0.01)
    ends = re.findall(r"^  speed = (\S+): remaining difference (\S+)$", out, re.M)
    assert len(ends) >= 2 and ends[0][0] == value and float(ends[1][1]) > 10 * float(ends[0][1])
    assert "Inertia makes curves rough" in out and "load slowly" in out


@pytest.mark.full
def test_a_failed_run_is_a_bad_trial(folder, capsys):
    """From the middle (21) and from 0.8 of the range (33) the block leaves the domain."""
    words = ["-var", "speed=1,41", "-jobs", "1", "-match", "max:c_x=2.7"]
    assert main(["fit", "in.flight", *words]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^speed +3 +–", out, re.M)
    assert "2 runs of the search failed" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-var", "speed=1,5", "-match", "c_x"], "-match c_x"),
        (["-var", "speed=1,5", "-match", "c_x=none.csv:x"], "there is no file 'none.csv'"),
        (["-var", "speed=1,5", "-match", "c_x=flight.csv:y"], "expected: one of time, x"),
        (["-var", "speed=1,5", "-match", "q=2"], "does not log 'q'"),
        (["-var", "speed=3", "-match", "c_x=2"], "two numbers for each variable"),
        (["-var", "speed=a,b", "-match", "c_x=2"], "two numbers for each variable"),
        (["-var", "speed=1,5", "-match", "c_x=long.csv:x"], "the run ends at 0.4"),
        (["-var", "speed=40,60", "-match", "c_x=2"], "narrower ranges"),
    ],
)
def test_mistakes_are_told(folder, capsys, words, message):
    (folder / "long.csv").write_text("time,x\n0,1\n9,2\n", encoding="utf-8")
    assert main(["fit", "in.flight", *words, "-jobs", "1"]) == 1
    err = capsys.readouterr().err
    assert message in err and "Traceback" not in err


@pytest.mark.full
def test_the_modulus_of_a_bar(tmp_path, monkeypatch, capsys):
    """in.vibrating_bar with 25 cells against the exact first mode for E = 100: within 1 %.

    Velocities of musl are half a step, 0.02, beside their time; of times of 5 in the mean that is
    0.4 % of the period, and twice as much of E.
    """
    monkeypatch.chdir(tmp_path)
    time = np.linspace(0, 10, 26)
    exact = 0.2 / np.pi * np.cos(np.pi / 5 * time)
    pandas.DataFrame({"time": time, "v": exact}).to_csv("bar.csv", index=False)
    script = Path(__file__).parent.parent / "inputs" / "in.vibrating_bar"
    words = ["-var", "E=60,160", "-var", "periods=2", "-jobs", "1", "-match", "v_x=bar.csv:v"]
    assert main(["fit", str(script), *words]) == 0
    assert fitted(capsys.readouterr().out)["E"][0] == pytest.approx(100, rel=0.01)
