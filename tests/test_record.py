"""run.json: the facts of a run as data, which the terminal prints and studies read."""

import ast
import json
import re
from pathlib import Path

import pytest
from walked import MODULES, walked

from karamelo_py.advice.explain import DOUBTED_UNITS
from karamelo_py.language import rules
from karamelo_py.output.console import show
from karamelo_py.output.record import RunRecord
from karamelo_py.script.errors import codes

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


def test_a_record_in_python_is_running_in_each_run_and_written_when_it_changes(tmp_path):
    told = RunRecord()
    told.path = tmp_path / "run.json"
    for _ in range(2):
        told.begin({"points": 1})
        assert json.loads(told.path.read_text("utf-8"))["status"] == "running"
        told.finish({"steps": 1})
        told.end("finished")
        assert json.loads(told.path.read_text("utf-8"))["status"] == "finished"
    before = told.path.stat().st_ino, told.path.stat().st_mtime_ns
    told.end("finished")
    assert (told.path.stat().st_ino, told.path.stat().st_mtime_ns) == before
    told.warn("a word", None, None)
    told.end("finished")
    assert json.loads(told.path.read_text("utf-8"))["messages"]


def test_a_wrong_script_leaves_no_record_unless_one_is_asked_for(run_script):
    wrong = SCENE.format(speed=1).replace("neo-hookean", "neo")
    assert not (run_script(wrong, status=1).folder / "run.json").exists()
    found = record(run_script(wrong, "-record", "r.json", status=1), "r.json")
    assert found["status"] == "failed" and found["runs"] == []
    assert "material: unknown material style 'neo'" in found["messages"][0]["text"]
    checked = run_script(SCENE.format(speed=1), "-record", "c.json")
    assert record(checked, "c.json")["runs"][0]["points"] == 16


FITS = {
    "object": dict, "array": list, "string": str, "integer": int, "number": (int, float),
    "boolean": bool, "null": type(None),
}  # fmt: skip


def misfits(schema, value, path="record"):
    """List where a value does not fit a JSON schema of types, enums, objects and arrays."""
    if "enum" in schema:
        return [] if value in schema["enum"] else [path]
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if not isinstance(value, tuple(FITS[one] for one in types)):
        return [path]
    if types == ["array"]:
        parts = [(schema["items"], one, f"{path}[{k}]") for k, one in enumerate(value)]
    elif properties := schema.get("properties"):
        names = {*schema["required"]} - {*value} | {*value} - {*properties}
        if names:
            return [f"{path}.{name}" for name in sorted(names)]
        parts = [(properties[name], one, f"{path}.{name}") for name, one in value.items()]
    else:
        return []
    return [wrong for part in parts for wrong in misfits(*part)]


IMPLICIT = """
    method(tlmpm, FLIP, linear, 1)
    dimension(1, 0, 1, 0.25)
    region(r, block, 0, 1)
    material(m, linear, 1, 100, 0)
    solid(s, region, r, 1, m, 0.25)
    region(w, block, -0.1, 0.1)
    group(w, nodes, region, w, all)
    fix(w, velocity_nodes, w, 0)
    fix(g, body_force, all, time)
    scheme(quasi-static)
    run(2)
"""


def test_three_scenes_fit_the_schema_and_the_page_has_its_fields(run_interpreted):
    """One that ends, one that fails, and load steps."""
    schema = json.loads((PAGE.parent / "_static" / "run.schema.json").read_text("utf-8"))
    ended = record(run_interpreted(SCENE.format(speed=1), folder="ended"))
    thrown = SCENE.format(speed=100).replace("run(3)", "run(300)")
    failed = record(run_interpreted(thrown, status=1, folder="failed"))
    loaded = record(run_interpreted(IMPLICIT, folder="loaded"))
    assert [found["status"] for found in (ended, failed, loaded)] == [
        "finished", "failed", "finished",
    ]  # fmt: skip
    assert [wrong for one in (ended, failed, loaded) for wrong in misfits(schema, one)] == []
    (run,) = loaded["runs"]
    assert run["steps"] == 2 and "stable_dt" not in run and run["path_cells"] is None
    page = PAGE.read_text("utf-8")
    runs, messages = (schema["properties"][name]["items"] for name in ("runs", "messages"))
    fields = [name for of in (schema, runs, messages) for name in of["properties"]]
    assert [name for name in fields if f"| `{name}` |" not in page] == []


def codes_in_the_code() -> set[str]:
    """Codes that are given to errors and warnings, as constants: keyword, or third of a Trouble."""
    found = set()
    for path in MODULES:
        for node in walked(path):
            given = []
            if isinstance(node, ast.Call):
                given = [word.value for word in node.keywords if word.arg == "code"]
                given += node.args[2:3] * (getattr(node.func, "id", "") == "Trouble")
            elif isinstance(node, ast.Dict):
                pairs = zip(node.keys, node.values, strict=True)
                given = [v for k, v in pairs if getattr(k, "value", "") == "code"]
            elif isinstance(node, ast.Assign):
                names = getattr(node.targets[0], "elts", node.targets)
                values = getattr(node.value, "elts", [node.value])
                given = [
                    v for n, v in zip(names, values, strict=False) if getattr(n, "id", "") == "code"
                ]
            found |= {one.value for one in given if isinstance(getattr(one, "value", 0), str)}
    return found - {""}


@pytest.mark.xdist_group("house")
def test_every_code_is_explained():
    assert {*codes()} == codes_in_the_code()
    assert all(words["title"] and words["text"] for words in codes().values())


def test_doubted_units_are_known_failures():
    assert rules.code_of("units of material 'm'") in DOUBTED_UNITS


def test_a_known_failure_has_a_code(run_interpreted):
    """The code is the name in kebab case, also where the name has names of the script."""
    text = SCENE.format(speed=1e4).replace("run(3)\n    run(2)", "set_dt(1e-9)\n    run(1)")
    result = run_interpreted(text)
    (note,) = [one for one in record(result)["messages"] if one["text"].startswith("units of")]
    assert note["code"] == "units-of-velocities"
    assert f"  fix: {note['hint']}\n" in result.err


def test_an_error_of_physics_has_cause_fix_and_the_command_that_resumes(run_interpreted):
    """A step of 3 times the limit: the cause once, on a line of its own and in the record."""
    text = SCENE.format(speed="0.1*x").replace("run(3)\n    run(2)", "dt_factor(3)\n    run(200)")
    result = run_interpreted(text, status=1)
    (error,) = [one for one in record(result)["messages"] if one["kind"] == "error"]
    lines = result.err.partition("error: ")[2].splitlines()
    assert lines[0] == error["text"] and error["cause"] not in error["text"]
    assert re.search(r" \(step \d+, t = [\d.e-]+\)$", error["text"])
    names = {"likely cause": "cause", "fix": "hint", "resume": "resume"}
    assert lines[-4:-1] == [f"  {name}: {error[field]}" for name, field in names.items()]
    assert lines[-1] == f"  more: karamelo-py help {error['code']}"
    command = error["resume"].partition("  #")[0].split()
    assert command[0] == "karamelo-py" and command[1].endswith("in.script")
    smaller = text.replace("dt_factor(3)\n    run(200)", "run(5)")
    assert run_interpreted(smaller, *command[2:]).log.Step[-1] == 5
