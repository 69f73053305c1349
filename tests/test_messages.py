"""Codes of messages: data that `karamelo-py help CODE` and the pages of messages are made from."""

import ast
import re
from pathlib import Path

import pytest
import test_script_errors as wrong
from walked import MODULES, walked

from karamelo_py.app.cli import main
from karamelo_py.language import registry, rules
from karamelo_py.script.errors import ScriptError, codes

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("energy-gain", "spurious gain of energy"),
        ("unknown-name", "A name must be set above the line that reads it"),
        ("points-that-cross-cells", "Fix: method tlmpm, or quadratic-spline"),
        ("locking", "Fix: anti_volumetric_locking(true)"),
    ],
)
def test_help_explains_a_code(capsys, code, said):
    assert main(["help", code]) == 0
    assert said in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("script", "code", "name", "alike"),
    [
        ("a = (1", "syntax", None, None),
        ("a = 1/0", "division-by-zero", None, None),
        ("length = 1\na = lenght", "unknown-name", "lenght", "length"),
        ("fxi(1)", "unknown-command", "fxi", None),
        ("and = 1", "taken-name", "and", None),
        ("x0 = 1\na = b\nb = 1", "used-before-defined", None, None),
        ("time = 1", "taken-name", "time", None),
        ("include(none.mpm)", "no-file", None, None),
        (wrong.SCENE + "region(q, blok, 0, 1)", "unknown-style", "blok", None),
        (wrong.SCENE + "fix(g, body_force, nobody, 0)", "unknown-ID", "nobody", None),
        (wrong.SCENE + "region(q, sphere)", "arguments", None, None),
        (wrong.SCENE + "set_dt(-1)", "argument", None, None),
        (wrong.SCENE + "region(b, block, 0, 1, 0, 1)", "already-used", None, None),
        ("a = sqrt(-1)", "operand", None, None),
        ('print("a" - 1)', "argument", None, None),
        (wrong.SCENE + "material(q, linear, 1, 1, 0.7)", "argument", None, None),
        (wrong.SCENE + "dimension(1, 0, 1, 0.1)", "too-late", None, None),
        ("region(q, block, 0, 1)", "not-possible", None, None),
    ],
)
def test_mistakes_have_codes_and_fields(tmp_path, script, code, name, alike):
    with pytest.raises(ScriptError) as caught:
        wrong.run(script, tmp_path)
    error = caught.value
    assert (error.code, error.name, error.alike) == (code, name, alike)
    assert codes()[code]["script"]


def test_pages_are_written_from_the_data(tmp_path, monkeypatch):
    """Every code, and each rule of advice that a part of the program declares."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    import messages

    messages.write_pages(tmp_path)
    text = {path.stem: path.read_text("utf-8") for path in tmp_path.glob("*.md")}
    index = (ROOT / "docs" / "messages" / "index.md").read_text("utf-8")
    assert set(text) == set(re.findall(r"^generated/([\w-]+)$", index, re.M))
    listed = re.findall(r"^## (\S+)$", text["run"] + text["script"], re.M)
    assert sorted(listed) == sorted(codes())
    for family in registry.families():
        for name in registry.names(family):
            registry.find(family, name)
    own = {
        rules.code_of(name)
        for part, name, *_ in rules.known_failures()
        if part.__module__.startswith("karamelo_py.")
    }
    assert len(own) > 20
    assert set(re.findall(r"^## (\S+)$", text["known-failures"], re.M)) == own


SAID = {"message", "hint", "expected", "sentence"}  # fields of errors that are for readers


def decisions_by_wording():
    """Calls and comparisons that look into the sentences of an error."""

    def is_said(node):
        return any(isinstance(n, ast.Attribute) and n.attr in SAID for n in ast.walk(node))

    for path in MODULES:
        for node in walked(path):
            looked = []
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                if getattr(node.func.value, "id", "") == "re":
                    looked = node.args[1:]
                elif node.func.attr in {"startswith", "endswith", "partition", "find", "split"}:
                    looked = [node.func.value]
            elif isinstance(node, ast.Compare) and not isinstance(node.ops[0], (ast.Is, ast.IsNot)):
                values = [node.left, *node.comparators]
                looked = values if any(isinstance(one, ast.Constant) for one in values) else []
            yield from (f"{path}:{node.lineno}" for one in looked if is_said(one))


@pytest.mark.xdist_group("house")
def test_nothing_decides_by_the_wording_of_a_message():
    assert [*decisions_by_wording()] == []


def test_studies_look_into_no_output_of_runs():
    """Their files are shown, whole or by lines; facts come from run.json and the log."""
    reads = re.compile(r"\bre\.\w+\([^)]*(?:said_in|complaint|stdout|out\.txt|err\.txt)")
    files = (ROOT / "karamelo_py" / "app").rglob("*.py")
    assert [path for path in files if reads.search(path.read_text("utf-8"))] == []
