"""karamelo-py find: the value at which a condition changes, by bisection."""

import re
from pathlib import Path

import pandas
import pytest
from test_sweep import SCRIPT

from karamelo_py.app.cli import main

pytestmark = pytest.mark.usefixtures("starts_are_cheap")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.flight").write_text(SCRIPT, encoding="utf-8")
    return tmp_path


def test_the_speed_at_which_a_block_comes_past_a_mark(folder, capsys):
    """Free flight for 0.04 from 1.5 to 1.7012: at a speed of 5.03, whatever the cells."""
    words = ["-var", "speed=1:9", "-var", "N=2,4", "-when", "c_x > 1.7012", "-within", "4"]
    assert main(["find", "in.flight", *words]) == 0
    said = capsys.readouterr().out.splitlines()
    found = "speed = 7 +- 2 (c_x > 1.7012 is false at 5, true at 9)"
    assert said == [f"N = 2: {found}", f"N = 4: {found}", "the table is find.csv"]
    table = pandas.read_csv(folder / "find.csv")
    assert len(table) == 6 and ((table["event"] == 1) == (table["speed"] > 5.03)).all()
    # A condition that becomes false, with variables of the script; known runs are kept.
    words[5:] = ["max:c_x < 1.5 + 0.04*5.03*N/N", "-within", "2"]
    assert main(["find", "in.flight", *words]) == 0
    out, err = capsys.readouterr()
    assert out.count("speed = 6 +- 1 (") == out.count("is true at 5, false at 7)") == 2
    assert err.count("run ") == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["speed=1:2", "-when", "c_x > 9"], "is false at both ends, speed = 1 and 2"),
        (["speed=1,2", "-when", "c_x > 9"], "0 variables have two ends"),
        (["speed=1:fast", "-when", "c_x > 9"], "the ends are not two numbers"),
        (["speed=2:2", "-when", "c_x > 9"], "the ends are not two numbers"),
        (["speed=1:2", "-when", "c_y > 9"], "in.flight does not log 'c_y'"),
        (["speed=1:2", "-when", "c_x > 9, v_x"], "expected: one condition"),
        (["sped=1:2", "-when", "c_x > 9"], "has no such variable"),
        (["speed=1:300", "-when", "c_x > 2"], "has no value: run: point"),
        (["speed=1:2", "-when", "c_x > 9", "-within", "0"], "is not a number above 0"),
    ],
)
def test_what_is_refused(folder, capsys, words, says):
    assert main(["find", "in.flight", "-var", *words]) == 1
    err = capsys.readouterr().err
    assert says in err and err.count("error:") == 1


@pytest.mark.full
def test_the_factor_of_safety_of_a_slope(tmp_path, monkeypatch, capsys):
    """The page's script: 1.380 (Bishop & Morgenstern 1960), 1.4 (Griffiths & Lane 1999)."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")
    page = Path(__file__).parent.parent / "docs" / "howto" / "safety-factor.md"
    script = re.search(r"^```karamelo\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
    Path("in.slope").write_text(script[1], "utf-8")
    words = ["-var", "F=1.34:1.46", "-var", "N=80", "-within", "0.01", "-when"]
    assert main(["find", "in.slope", *words, "time < 15"]) == 0
    factor = float(re.search(r"F = ([\d.]+) \+-", capsys.readouterr().out)[1])
    assert abs(factor / 1.380 - 1) < 0.006 and abs(factor / 1.4 - 1) < 0.02
