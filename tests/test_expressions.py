"""Numbers, texts and formulas: what is folded, what stays, how formulas read."""

import math

import pytest

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene import hub as scene
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.values import CAPACITY, Values


class Hub(scene.Hub):
    def __init__(self):
        super().__init__(Console(quiet=True))
        self.warnings = []

    def warn(self, message, mark=None, hint=None):
        self.warnings.append(message)


@pytest.fixture
def hub():
    return Hub()


def run(hub, text, **presets):
    interpreter = Interpreter(hub, presets)
    interpreter.run_text(text)
    return interpreter.variables


def test_constants_are_numbers_and_seeds_make_formulas(hub):
    v = run(hub, "a = 2*3\nb = a*time\nc = b + a\nd = x0")
    assert v["a"] == 6.0
    assert isinstance(v["b"], Expression)
    assert v["b"].text == "6*time"
    assert v["c"].text == "6*time + 6"
    assert v["c"].names == {"time"}
    assert v["d"].names == {"x0"}


def test_formulas_keep_the_values_of_their_making(hub):
    v = run(hub, "a = 2\nf = a*time\na = 5\nf = f + a\nt = time")
    assert v["f"].text == "2*time + 5"
    assert v["t"].text == "time"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("(time + 1)*2", "(time + 1)*2"),
        ("time + 1*2", "time + 2"),
        ("-(time^2)", "-time^2"),
        ("(-time)^2", "(-time)^2"),
        ("time^2^x", "time^2^x"),
        ("(time^2)^x", "(time^2)^x"),
        ("time - (x - 1)", "time - (x - 1)"),
        ("time/(x*y)", "time/(x*y)"),
        ("-2*time", "-2*time"),
        ("(-2)^time", "(-2)^time"),
        ("!(time > 1)", "!time > 1"),
        ("(!time)*2", "(!time)*2"),
        ("1e-16*time + 1e-20", "1e-16*time + 1e-20"),
        ("if(time < 1, x, 0)", "if(time < 1, x, 0)"),
        ("time > 1 && x < 2 || y", "time > 1 && x < 2 || y"),
    ],
)
def test_formulas_read_as_they_could_be_written(hub, text, shown):
    formula = run(hub, f"f = {text}")["f"]
    assert formula.text == shown
    assert run(Hub(), f"f = {shown}")["f"].text == shown


def test_numbers_are_double_precision(hub):
    v = run(hub, "a = 0.1\nb = 1234567.891\nc = 16777217")
    assert (v["a"], v["b"], v["c"]) == (0.1, 1234567.891, 16777217.0)


def test_texts(hub):
    v = run(hub, 'b = "cubic-spline"\nc = b + ".*"\nd = b == "linear"\ne = if(b != "x", 1, 2)')
    assert (v["b"], v["c"], v["d"], v["e"]) == ("cubic-spline", "cubic-spline.*", 0.0, 1.0)


def test_evaluation_now(hub):
    hub.values.publish_vector("Ek")
    hub.values.set("Ek_s", 4.0)
    hub.values.set("time", 0.5)
    v = run(hub, "f = sqrt(Ek_s) + sin(time) + Ek\nr = PI*2")
    assert v["f"].names == {"Ek_s", "time", "Ek"}
    assert v["f"].evaluate(hub.values) == 2 + math.sin(0.5)
    assert v["r"] == 2 * math.pi


def test_a_formula_of_positions_has_no_single_number(hub):
    with pytest.raises(ScriptError, match="differs from point to point"):
        run(hub, "f = x + time")["f"].evaluate(hub.values)


def test_expressions_are_numbers_or_formulas(hub):
    constant, formula = Expression(3), Expression.seed("time")
    assert constant.is_constant
    assert constant.constant == 3.0
    assert constant.evaluate(hub.values) == 3.0
    assert not formula.is_constant
    assert formula.names == {"time"}
    with pytest.raises(ValueError):
        _ = formula.constant


def test_formulas_cannot_grow_without_end(hub, monkeypatch):
    f = run(hub, "f = time\n" + "f = f*f + time\n" * 40)["f"]  # each line uses the last one twice
    hub.values.set("time", 0.1)
    expected = 0.1
    for _ in range(40):
        expected = expected * expected + 0.1
    assert f.evaluate(hub.values) == pytest.approx(expected, rel=1e-12)
    assert f.text == "a long formula of time"
    monkeypatch.setattr("karamelo_py.script.expressions._MAX_SIZE", 100)
    with pytest.raises(ScriptError, match="too long") as caught:
        run(hub, "f = time\n" + "f = f + x\n" * 60)
    assert caught.value.mark.column == 5


def test_presets_win_over_the_script(hub):
    v = run(hub, 'h = 0.1\nb = 2*h\nk = "linear"\ns = 2*h', h="1/4", k="cubic-spline", s="3*h")
    assert v == {"h": 0.25, "b": 0.5, "k": "cubic-spline", "s": 0.75}
    assert hub.warnings == []


@pytest.mark.parametrize(
    "text",
    ["hh = 0.1", "a = 2*hh", "b = 1  # hh\nc = hh", "a = k", "if(1 > 2, hh, 1)"],
)
def test_a_preset_that_is_read_or_assigned(hub, text):
    run(hub, text, hh="1", **({"k": "2*hh"} if text == "a = k" else {}))


@pytest.mark.parametrize("text", ["h = 0.1", 'h = 1\nprint("hh")', "h = 1 # hh"])
def test_a_preset_that_the_script_does_not_know_is_refused(hub, text):
    """Before anything is run, with the nearest name that there is."""
    with pytest.raises(ScriptError, match="-var hh: the script has no variable 'hh'") as caught:
        run(hub, text + "\nnosuchcommand(1)", hh="1")
    assert caught.value.hint == "did you mean 'h'?"
    with pytest.raises(ScriptError):
        run(hub, "", hh="1")


def test_presets_of_included_scripts(hub, tmp_path):
    """A variable may be that of an included script; what is included by a variable is not known."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "in.main").write_text("include(sub/one.in)\nb = 2")
    (tmp_path / "sub" / "one.in").write_text("include(two.in)\n")
    (tmp_path / "sub" / "two.in").write_text("deep = 1\n")
    interpreter = Interpreter(hub, {"deep": "3"})
    interpreter.run_file(tmp_path / "in.main")
    assert interpreter.variables["deep"] == 3
    with pytest.raises(ScriptError, match="no variable 'deap'") as caught:
        Interpreter(hub, {"deap": "3"}).run_file(tmp_path / "in.main")
    assert caught.value.hint == "did you mean 'deep'?"
    (tmp_path / "in.main").write_text('which = "sub/two.in"\ninclude(which)')
    Interpreter(hub, {"deap": "3"}).run_file(tmp_path / "in.main")


@pytest.mark.parametrize("name", ["x", "time", "run", "sin", "PI", "1a", "NULL"])
def test_presets_have_free_names(hub, name):
    with pytest.raises(ScriptError, match="-var"):
        run(hub, "", **{name: "1"})


def test_nan_passes_through_what_a_rehearsal_does_not_know(hub):
    interpreter = Interpreter(hub)
    interpreter.variables["a"] = math.nan
    interpreter.run_text("b = 1/a\nc = sqrt(a)\nd = if(a > 1, 1, 2)\ne = floor(a) % 2")
    assert math.isnan(interpreter.variables["b"])
    assert math.isnan(interpreter.variables["c"])


def test_values_are_published_in_one_array_that_stays():
    values = Values()
    array = values.array
    assert values.names() == ["time", "timestep", "dt"]
    values.publish_vector("F")
    assert [values.slot(f"F_{s}") for s in "xyzs"] == [5, 6, 7, 8]  # slots 3 and 4 have no names
    assert values.names()[3:] == ["F_x", "F_y", "F_z", "F_s", "F"]
    assert values.publish("F_s", 2.0) == 8
    assert array[8] == values.get("F_s") == 2.0
    values.publish_vector("F", ("x", "s"))
    assert values.names()[3:] == ["F_x", "F_s"]
    assert (values.slot("F_x"), values.slot("F_s")) == (5, 8)
    with pytest.raises(ScriptError, match=str(CAPACITY)):
        for k in range(CAPACITY):
            values.publish(f"v{k}")
    assert values.array is array
