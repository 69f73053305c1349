"""karamelo-py check: what a scene needs, without running it."""

import re

import pytest
from conftest import INPUTS

from karamelo_py.app.cli import main


@pytest.fixture
def check(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run(path, *options):
        status = main(["check", str(path), *options])
        captured = capsys.readouterr()
        assert status == 0, captured.err
        assert list(tmp_path.iterdir()) == []  # nothing is run or written
        return captured.out

    return run


def test_what_the_two_disks_need(check):
    """416 points as in Karamelo; two doubles for a place in the plane; h / (c + v) by hand."""
    out = check(INPUTS / "in.two_disks")
    assert re.search(r"points\s+416 in 2 solid", out)
    assert re.search(r"nodes\s+441 \(21 x 21 x 1\)", out)
    # A tile has 24 cells per side; points may come to reach all nodes of the square around both.
    used = re.search(r"tiles\s+1 of 1 hold points, (\d+) nodes are in use", out)
    assert 2 * 9**2 <= int(used[1]) <= 441  # each disk spans 9 x 9 nodes
    assert re.search(r"boxes of tiles 0 MiB", out)  # few points give straight to the nodes
    # c = sqrt((lambda + 2 G) / rho) = sqrt(1000 * 0.7 / (1.3 * 0.4) / 1000), v = 0.1, h = 0.05
    assert re.search(r"first dt\s+0\.001 \(stable limit 0\.0396\d*\)", out)
    # run_time(3.5); 1e-7 s for a step of each point
    assert re.search(r"\nsteps +about 3500, 0\.1 s or more\n", out)
    for field, numbers, size in [("x", 2, 16), ("v", 2, 16), ("mass", 1, 8), ("state", 5, 40)]:
        assert re.search(rf"^  {field}\s+{numbers}\s+{size}$", out, re.MULTILINE)
    for words in (
        "2 (plane-strain)", "ulmpm FLIP (alpha 1) linear musl", "a point of rubber (linear)",
        "stages of a step", "v1",
    ):  # fmt: skip
        assert words in out


def test_what_is_not_used_does_not_exist(check, tmp_path):
    """The moment of velocity is there for APIC only; single precision halves the numbers."""
    text = (INPUTS / "in.two_disks").read_text(encoding="utf-8")
    assert "  moment  " not in check(INPUTS / "in.two_disks")
    script = tmp_path.parent / f"{tmp_path.name}.in"
    script.write_text(text.replace("FLIP, linear, 1", "APIC, linear"), encoding="utf-8")
    assert re.search(r"moment\s+4\s+32", check(script))
    script.write_text("precision(single)\n" + text, encoding="utf-8")
    assert re.search(r"state\s+5\s+20", check(script))


def test_the_parts_of_materials_and_of_the_method_are_called_as_in_the_script(check, tmp_path):
    script = tmp_path.parent / f"{tmp_path.name}.in"
    script.write_text(
        "method(ulmpm/contacts, FLIP, cpgimp, 1, corners)\nscheme(usavg)\n"
        "dimension(2, 0, 1, 0, 1, 0.1)\nregion(left, block, 0, 0.5, 0, 1)\n"
        "region(right, block, 0.5, 1, 0, 1)\neos(bulk, shock, 9, 9, 9, 1, 2, 0, 298, 0, 0)\n"
        "strength(mild, plastic, 4, 1)\nmaterial(metal, eos-strength, bulk, mild)\n"
        "material(m1, neo-hookean, 1, 1, 0)\nmaterial(m2, neo-hookean, 2, 1, 0)\n"
        "solid(a, region, left, 1, metal, 0.1, 0)\nsolid(b, region, right, 1, m1, 0.1, 0)\n"
        "solid(c, region, right, 1, m2, 0.1, 0)\nrun(1)\n"
    )
    out = check(script)
    assert "ulmpm/contacts FLIP (alpha 1) cpgimp corners usavg" in out
    assert "a point of metal (eos-strength: shock, plastic)\n" in out
    assert "a point of m1 (neo-hookean), m2 (neo-hookean)\n" in out


def test_a_scene_without_a_run_is_checked_too(check, tmp_path):
    text = (INPUTS / "in.two_disks").read_text(encoding="utf-8")
    script = tmp_path.parent / f"{tmp_path.name}.in"
    script.write_text(text.replace("run_time(3.5)", ""), encoding="utf-8")
    out = check(script)
    assert "points         416" in out
    assert "note: " in out and "there is no run command" in out
    script.write_text("a = 3\n", encoding="utf-8")
    assert check(script).startswith("note: ")
