"""From a script's arguments to typed Python calls, and help from signatures."""

from typing import Annotated, Any, Literal, NamedTuple

import pytest

from karamelo_py.language import registry, signature
from karamelo_py.language.help import describe
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.language.signature import (
    Argument,
    AtLeast,
    In,
    InputFile,
    NonNegative,
    OutputFile,
    Positive,
)
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.parser import parse


class Thing:
    """Made from the script's word."""

    def __init__(self, name):
        self.name = name

    @classmethod
    def from_script(cls, hub, argument):
        if argument.text == "none":
            raise ScriptError("unknown thing 'none'")
        return cls(argument.word())


@pytest.fixture
def hub(tmp_path):
    hub = Hub()
    hub.folder = tmp_path
    Interpreter(hub).run_text('FLIP = 0.5\nword = "linear"\nhow = time\nN = 7')
    return hub


def call(hub, function, text, name="style"):
    """Call `function` with the arguments of a script's ``f(...)``."""
    (statement,) = parse(f"f({text})")
    arguments = [Argument(raw, hub.interpreter) for raw in statement.arguments]
    return signature.call(function, hub, arguments, name)


def taking(annotation):
    """A function of one argument of this kind, which it returns."""

    def function(hub, value):
        return value

    function.__annotations__["value"] = annotation
    return function


@pytest.mark.parametrize(
    ("annotation", "text", "expected"),
    [
        (float, "1/4", 0.25),
        (float, "FLIP", 0.5),
        (int, "N", 7),
        (int, "1e3", 1000),
        (bool, "true", True),
        (bool, "false", False),
        (str, "FLIP", "FLIP"),
        (str, "word", "linear"),
        (str, '"a, b"', "a, b"),
        (str, "neo-hookean", "neo-hookean"),
        (str, "particle/gz", "particle/gz"),
        (str, "dump_p.*.LAMMPS", "dump_p.*.LAMMPS"),
        (str, '"x." + word', "x.linear"),
        (str, "x", "x"),
        (Literal["word", "other"], "word", "word"),
        (Literal["linear", "other"], "word", "linear"),
        (float | None, "NULL", None),
        (float | None, "2", 2.0),
        (float | Literal["INF", "EDGE"], "INF", "INF"),
        (float | Literal["INF", "EDGE"], "-1", -1.0),
        (Annotated[float, Positive], "0.1", 0.1),
        (Annotated[float, NonNegative], "0", 0.0),
        (Annotated[int, AtLeast(1)], "1", 1),
        (Annotated[float, In(0, 1)], "1", 1.0),
        (Annotated[float | None, Positive], "NULL", None),
        ("Annotated[float, Positive]", "2", 2.0),
        ("float | None", "NULL", None),
    ],
)
def test_conversion(hub, annotation, text, expected):
    value = call(hub, taking(annotation), text)
    assert value == expected
    assert type(value) is type(expected)


@pytest.mark.parametrize(
    ("annotation", "text", "message"),
    [
        (float, "NULL", "a number, not NULL"),
        (float, "how", "not a formula of time"),
        (float, "word", "not the text 'linear'"),
        (float, '"a"', "not the text 'a'"),
        (float, "INF", "not INF"),
        (float, "foo", "unknown name 'foo'"),
        (int, "2.5", "a whole number, not 2.5"),
        (int, "1/0", "division by zero"),
        (int, "1e300", "too large"),
        (bool, "yes", "true or false, not 'yes'"),
        (str, "3", "a word, not the number 3"),
        (str, "NULL", "not NULL"),
        (str, "atan2(1,1)", "a word, not atan2"),
        (str, "two words", "more than one word"),
        (str, '""', "an empty text"),
        (Literal["nodes", "particles"], "node", "one of nodes, particles, not 'node'"),
        (Expression, "word", "a number or a formula, not the text 'linear'"),
        (Expression, "NULL", "not NULL"),
        (Expression | None, '"a"', "a number or a formula or NULL"),
        (Annotated[float, Positive], "0", "above 0, not 0"),
        (Annotated[float, NonNegative], "-1", "of at least 0, not -1"),
        (Annotated[int, AtLeast(1)], "0", "of at least 1, not 0"),
        (Annotated[float, In(-1, 0.5, open=True)], "0.5", "both excluded"),
        (Annotated[float, In(0, 1, open="lo")], "0", "0 excluded"),
        (Annotated[Expression, Positive], "-2", "above 0, not -2"),
        (Thing, "none", "unknown thing"),
        (Thing, "NULL", "the ID of a thing, not NULL"),
        (InputFile, "nofile.txt", "does not exist"),
        (OutputFile, "nofolder/a.txt", "folder nofolder does not exist"),
        (float, "2 3", "operator is missing"),
        (float, "weight=3", "no argument is named 'weight'"),
    ],
)
def test_misfits_mark_the_argument(hub, annotation, text, message):
    with pytest.raises(ScriptError) as caught:
        call(hub, taking(annotation), text)
    error = caught.value
    assert message in error.message
    assert error.command == "style"
    assert error.mark.line == 1
    assert 3 <= error.mark.column < 3 + len(text)
    assert "style: " in error.render()


def test_expressions_may_be_constant_or_not(hub):
    constant = call(hub, taking(Expression), "2*FLIP")
    assert constant.constant == 1.0
    assert call(hub, taking(Expression | None), "how*2").text == "time*2"
    assert call(hub, taking(Annotated[Expression, Positive]), "how").names == {"time"}


def test_files(hub, tmp_path):
    (tmp_path / "mesh.msh").write_text("")
    (tmp_path / "out").mkdir()
    assert call(hub, taking(InputFile), "mesh.msh") == tmp_path / "mesh.msh"
    assert str(call(hub, taking(OutputFile), "out/d.*.gz")).replace("\\", "/") == "out/d.*.gz"
    with pytest.raises(ScriptError) as caught:
        call(hub, taking(InputFile), "mesh.mesh")
    assert "mesh.msh" in caught.value.hint
    with pytest.raises(ScriptError, match="is a folder"):
        call(hub, taking(OutputFile), "out")


class Style:
    """Do a thing.

    And more of it.

    Parameters
    ----------
    group
        What it acts on.
    velocity
        One formula per direction.
    share
        How much.

    Example
    -------
    style(1, 2)
    """

    def __init__(
        self,
        hub: Any,
        group: Thing,
        vx: Expression,
        vy: Expression | None = None,
        *velocity: Expression | None,
        glue: Thing | None = None,
    ):
        if group.name == "broken":
            raise ScriptError("it is broken", argument="vx")
        if group.name == "gone":
            raise FileNotFoundError(2, "No such file", "x.txt")
        self.group, self.vx, self.vy, self.velocity, self.glue = group, vx, vy, velocity, glue


def test_classes_defaults_varargs_and_keywords(hub):
    style = call(hub, Style, "g, 1")
    assert (style.group.name, style.vx.constant, style.vy, style.velocity) == ("g", 1.0, None, ())
    style = call(hub, Style, "g, 1, NULL, time, NULL, glue = h")
    assert style.vy is None
    named = call(hub, Style, "glue=h, g, vx=1")
    assert (named.group.name, named.vx.constant, named.vy, named.glue.name) == ("g", 1, None, "h")
    assert len(style.velocity) == 2
    assert style.glue.name == "h"


@pytest.mark.parametrize(
    ("text", "message", "column"),
    [
        ("g", "vx is missing", None),
        ("", "group, vx are missing", None),
        ("g 1", "vx is missing", 3),
        ("g, 1, vw=2", "no argument is named 'vw'", 9),
        ("g, 1, glue=a, glue=b", "glue is given twice", 17),
        ("g, 1, vx=2", "vx is given twice: by position and as vx=", 9),
        ("g, vy=1, 2", "2 has no name, and follows vy=...", 12),
        ("broken, 1", "it is broken", 11),
        ("gone, 1", "x.txt: No such file", None),
        ("g, 1, 2, foo", "unknown name 'foo'", 12),
        ("g, 1, 2, 3, sin(", "", None),
    ],
)
def test_counts_and_blame(hub, text, message, column):
    with pytest.raises(ScriptError) as caught:
        call(hub, Style, text)
    assert message in caught.value.message
    if column is not None:
        assert caught.value.mark.column == column


def test_raw_arguments_pass_names_on_to_the_style(hub):
    def outer(hub, ID: str, *rest: Argument):
        return signature.call(Style, hub, list(rest), "style")

    assert call(hub, outer, "a, g, 1, glue=h").glue.name == "h"


class Moduli(NamedTuple):
    """A record of other numbers than a script gives.

    Parameters
    ----------
    E
        Young's modulus.
    nu
        Poisson's ratio.
    """

    K: float
    G: float

    @classmethod
    def given(cls, E: Annotated[float, Positive], nu: Annotated[float, In(-1, 0.5)] = 0.0):
        return cls(E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu)))

    def checked(self):
        if self.K > 1e6:
            raise ScriptError("too stiff", argument="E")
        return self


class Pair(NamedTuple):
    """Two numbers."""

    a: Annotated[float, Positive]
    b: int = 2


def test_records_need_no_hub(hub):
    assert call(hub, Pair, "0.5") == Pair(0.5, 2)
    assert call(hub, Pair, "0.5, 3") == Pair(0.5, 3)
    assert signature.syntax(Pair, "pair") == "pair(a[, b])"
    with pytest.raises(ScriptError, match="argument 1 'a' must be a number above 0, not -1"):
        call(hub, Pair, "-1")
    assert call(hub, Moduli, "6, 0.25") == Moduli(4.0, 2.4)
    first, _ = describe(Moduli, "m").parameters
    assert first.description == "Young's modulus."
    with pytest.raises(ScriptError, match="too stiff") as caught:
        call(hub, Moduli, "1e9, 0")
    assert caught.value.mark.column == 3


def test_a_signature_that_cannot_be_understood_is_no_crash(hub):
    def bad(hub, group: "Nowhere"):  # noqa: F821
        return group

    with pytest.raises(ScriptError, match="broken"):
        call(hub, bad, "g")
    with pytest.raises(ScriptError, match="broken"):
        call(hub, taking(dict), "g")


def test_syntax(hub):
    """What may be left out is in brackets; names stand behind, each in its own."""
    assert (
        signature.syntax(Style, "style") == "style(group, vx[, vy[, velocity, ...]][, glue=glue])"
    )

    def several(hub, *, a: float, b: float = 0.0, c: float = 0.0):
        return a + b + c

    assert signature.syntax(several, "several") == "several(a=a[, b=b][, c=c])"
    with pytest.raises(ScriptError, match=r"a=\.\.\. is missing"):
        call(hub, several, "")


def test_help():
    text = describe(Style, "style")
    assert text.summary == "Do a thing."
    assert text.text == "And more of it."
    assert text.example == "style(1, 2)"
    by_name = {p.name: p for p in text.parameters}
    assert by_name["group"].description == "What it acts on."
    assert by_name["group"].kind.text == "the ID of a thing"
    assert by_name["vy"].kind.text == "a number or a formula or NULL"
    assert by_name["velocity"].variadic


def test_registry_names_what_is_near():
    with pytest.raises(ScriptError) as caught:
        registry.find("fix", "velocity_node")
    assert "velocity_nodes" in caught.value.hint
    assert registry.origin("fix", "velocity_nodes").startswith("karamelo-py ")
    assert "velocity_nodes" in registry.names("fix")
