"""run.json: the facts of a run as data, which the terminal prints and studies read."""

import json
import re
from pathlib import Path

import pytest

from karamelo_py.output.console import show

PAGE = Path(__file__).parent.parent / "docs" / "run-record.md"
SCENE = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.25)
    region(r, block, 0.25, 0.75, 0.25, 0.75)
    material(m, neo-hookean, 1000, 1e5, 0.3)
    solid(s, region, r, 2, m, 0.25)
    fix(v, initial_velocity_particles, all, {speed}, 0)
    run(3)
    run(2)
"""


def record(result, name="run.json"):
    return json.loads((result.folder / name).read_text("utf-8"))


def test_the_terminal_prints_what_the_record_has(run_interpreted):
    result = run_interpreted(SCENE.format(speed=1))
    found = record(result)
    assert found["status"] == "finished" and found["schema"] == 1
    assert [run["steps"] for run in found["runs"]] == [3, 2]
    assert found["runs"][1]["first_step"] == 3
    for name in ("points", "nodes", "dt", "stable_dt", "threads", "precision"):
        shown = re.findall(rf"^  {name.replace('_', ' ')}  +(\S.*)$", result.out, re.M)
        assert shown == [show(run[name]) for run in found["runs"]], name
    assert found["script"]["file"].endswith("in.script")
    assert len(found["script"]["sha256"]) == 64


def test_a_run_that_fails_names_the_kind_of_its_trouble(run_interpreted):
    """A body thrown at the edge leaves the domain; what was known before stays."""
    result = run_interpreted(SCENE.format(speed=100).replace("run(3)", "run(300)"), status=1)
    found = record(result)
    assert found["status"] == "failed"
    (error,) = [note for note in found["messages"] if note["kind"] == "error"]
    assert error["code"] in ("left-domain", "point-lost", "step-above-limit")
    assert error["place"]["line"] == 8 and error["text"] in result.err
    assert found["runs"][0]["points"] == 16 and "steps" not in found["runs"][0]


def test_a_log_of_another_name_has_a_record_of_that_name(run_script):
    result = run_script(SCENE.format(speed=1), "-log", "b.csv")
    assert record(result, "b.run.json")["status"] == "finished"
    assert not (result.folder / "run.json").exists()


def test_a_wrong_script_leaves_no_record_unless_one_is_asked_for(run_script):
    wrong = SCENE.format(speed=1).replace("neo-hookean", "neo")
    assert not (run_script(wrong, status=1).folder / "run.json").exists()
    found = record(run_script(wrong, "-record", "r.json", status=1), "r.json")
    assert found["status"] == "failed" and found["runs"] == []
    assert "material: unknown material style 'neo'" in found["messages"][0]["text"]
    checked = run_script(SCENE.format(speed=1), "-record", "c.json")
    assert record(checked, "c.json")["runs"][0]["points"] == 16


@pytest.mark.parametrize("part", ["top", "run", "message"])
def test_every_field_is_on_the_page(part, run_interpreted):
    found = record(run_interpreted(SCENE.format(speed=100).replace("run(3)", "run(300)"), status=1))
    ended = record(run_interpreted(SCENE.format(speed=1), folder="ended"))
    fields = {
        "top": found,
        "run": ended["runs"][0],
        "message": found["messages"][-1],
    }[part]
    page = PAGE.read_text("utf-8")
    assert not [name for name in fields if f"| `{name}` |" not in page]
