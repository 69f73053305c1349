"""The parser: statements, arguments, precedence; what is not a script is refused with a place."""

import re
import sys
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.script import parser
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.parser import parse, parse_text
from karamelo_py.script.syntax import Assignment, CommandCall, Evaluation
from karamelo_py.script.values import Values

PAPER = """\
E = 1e+3
nu = 0.3
L = 1
hL=0.5*L
FLIP=1.0
method(ulmpm, FLIP, linear, FLIP)
N = 20 # cells
dimension(2,-hL, hL, -hL, hL, cellsize)
region(rBall1, cylinder, -hL+R, -hL+R, R)
material(mat1, neo-hookean, rho, E, nu)
solid(sBall1, region, rBall1, ppc1d, mat1, cellsize,0)
group(gBall1, particles, region, rBall1, solid, sBall1)
fix(v0Ball1, initial_velocity_particles, gBall1, v, v, NULL)
dump(dump1, all, particle, N_log, dump_p.*.LAMMPS, x, y, z, vx, vy, s11)
dump(dump2, all, pyplot, N_log, dump.*.pdf, 500,500)
fix(Ek, kinetic_energy, all)
Etot = Ek_s + Es_s
log_modify(custom, step, dt, time, Ek_s, Es_s, Etot)
plot(Ek, N_log, time, Ek_s)
save_plot(plot.pdf)
log(N_log)
run_time(4.5)
"""


class Hub:
    """The least that an interpreter needs."""

    def __init__(self):
        self.values = Values()
        self.mark = None


def number(text):
    """What an expression of constants gives."""
    raw, node = parse_text(text)
    return Interpreter(Hub()).evaluate(node, raw)


def arguments(text):
    """The arguments of the one call in `text`, as written."""
    (call,) = parse(text)
    assert isinstance(call, CommandCall)
    return [raw.code.strip() for raw in call.arguments]


def test_the_paper_script_is_understood():
    statements = parse(PAPER, "in.paper")
    assert len(statements) == len(PAPER.splitlines())
    assert [s.mark.line for s in statements] == list(range(1, len(statements) + 1))
    dump = statements[13]
    assert dump.name == "dump"
    assert [raw.code.strip() for raw in dump.arguments][3:6] == ["N_log", "dump_p.*.LAMMPS", "x"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("f(a, b)", ["a", "b"]),
        ("f()", []),
        ("f( )", []),
        ("f(velocity_nodes, particle/gz, neo-hookean, dump.*.gz, ../out/plot.pdf)",
         ["velocity_nodes", "particle/gz", "neo-hookean", "dump.*.gz", "../out/plot.pdf"]),
        ("fix(f, g, atan2(1,1), 0, NULL)", ["f", "g", "atan2(1,1)", "0", "NULL"]),
        ("f(max(1,min(2,3)), (4))", ["max(1,min(2,3))", "(4)"]),
        ('f("a, b", "c#d", "e(")', ['"a, b"', '"c#d"', '"e("']),
        ("f(a,\n   b, # a comment, with (\n\n   c\n)", ["a", "b", "c"]),
        ("f(GlueToSolid=s1, a == b)", ["GlueToSolid=s1", "a == b"]),
        ("\tf\t(\ta\t)\t", ["a"]),
    ],
)  # fmt: skip
def test_arguments_are_split_at_outer_commas_only(text, expected):
    assert arguments(text) == expected


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_tabs_and_a_missing_last_one_mean_nothing(end):
    text = end.join(["\ta\t=\t1 # ü", "", "# only a comment", "f(a)"])
    a, f = parse(text)
    assert isinstance(a, Assignment)
    assert isinstance(f, CommandCall)
    assert (a.mark.line, a.mark.column) == (1, 2)
    assert f.mark.line == 4


def test_a_byte_order_mark_and_blank_text_are_fine():
    assert parse("") == parse("\n\n") == parse("  # nothing") == []
    assert len(parse("\ufeffa = 1")) == 1


def test_an_expression_may_run_over_lines_inside_parentheses():
    (statement,) = parse("a = (1 + # one\n 2)")
    assert isinstance(statement, Assignment)
    assert statement.node.operator == "+"


def test_quit_and_other_names_alone_are_expressions():
    assert all(isinstance(s, Evaluation) for s in parse("quit\na\na+1\nlog(2)+1"))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-2^2", -4),
        ("2^3^2", 512),
        ("2**3**2", 512),
        ("2^-1", 0.5),
        ("3--2", 5),
        ("2*-3+1", -5),
        ("1-2^2", -3),
        ("7 % 4 * 2", 6),
        ("-7 % 4", 1),
        ("1 + 2 < 4", 1),
        ("1 < 2 < 3", 1),
        ("!1 == 0", 1),
        ("not 0 and 1", 1),
        ("0 || 1 && 0", 0),
        ("1 or 0 and 0", 1),
        ("-(2+3)", -5),
        ("-abs(-3)", -3),
        (".5 + 1. + 1e5 + 1.e3 + 1E-1 + 1e+3", 102001.6),
        ("0 != 0 || 1/2 > 0", 1),
        ("0 && 1/0", 0),
        ("if(1, 2, 1/0)", 2),
        ("min(3, 1, 2) + max(1, 5, 4)", 6),
        ("PI", 3.141592653589793),
        ("step(-1) + 10*step(0) + mod(7, 4) + sign(-3)", 12),
    ],
)
def test_values_of_constants(text, expected):
    assert number(text) == pytest.approx(expected, rel=1e-15)


@st.composite
def arithmetic(draw, depth=4):
    """An expression in the language that means the same in Python, when ^ is written **."""
    kind = draw(st.integers(0, 6)) if depth else 0
    if kind <= 1:
        return draw(
            st.one_of(
                st.integers(0, 30).map(lambda i: f"{i}.0"),
                st.floats(0, 100, allow_nan=False).map(repr),
                st.sampled_from([".5", "1.", "1e3", "2.5E-1"]),
            )
        )
    below = arithmetic(depth=depth - 1)
    if kind == 2:
        return "(" + draw(below) + ")"
    if kind == 3:
        return draw(st.sampled_from("-+")) + draw(below)
    if kind == 4:
        return "abs(" + draw(below) + ")"
    blank = draw(st.sampled_from(["", " ", "\t"]))
    return draw(below) + blank + draw(st.sampled_from("+-*/%^")) + blank + draw(below)


@settings(max_examples=300, deadline=None)
@given(arithmetic())
def test_arithmetic_agrees_with_python(text):
    try:
        expected = eval(text.replace("^", "**"))
    except (ZeroDivisionError, OverflowError, TypeError):  # the last from complex powers
        expected = None
    if isinstance(expected, complex) or (expected is not None and abs(expected) == float("inf")):
        expected = None
    try:
        value = number(text)
    except ScriptError:
        # An overflow inside may cancel in Python (1/inf); here it is an error in any case.
        assert expected is None or "e308" in text or "^" in text
        return
    assert value == pytest.approx(expected, rel=1e-12)


@settings(max_examples=200, deadline=None)
@given(arithmetic())
def test_formulas_survive_being_written_and_read_again(text):
    interpreter = Interpreter(Hub())
    try:
        raw, node = parse_text(text.replace("1.", "x0+time-1."))
        formula = interpreter.evaluate(node, raw)
    except ScriptError:
        return
    if isinstance(formula, float):
        return
    raw, node = parse_text(formula.text)
    again = interpreter.evaluate(node, raw)
    assert again.text == formula.text
    assert again.names == formula.names


GARBAGE = st.one_of(
    st.text(max_size=60),
    st.text(alphabet='ax1. +-*/^(),="#\n\t%&|!<>e$', max_size=60),
    st.lists(
        st.sampled_from(
            ["fix", "run", "a", "=", "(", ")", ",", "1.5", '"', "\n", " ", "+", "and", "#", "NULL"]
        ),
        max_size=30,
    ).map("".join),
)


@settings(max_examples=400, deadline=None)
@given(GARBAGE)
def test_garbage_raises_script_errors_with_a_place_and_nothing_else(text):
    try:
        statements = parse(text, "in.garbage")
    except ScriptError as error:
        assert error.mark is not None
        assert error.mark.line <= text.count("\n") + text.count("\r") + 1
        assert "in.garbage:" in error.render()
        return
    for statement in statements:
        if isinstance(statement, CommandCall):
            for raw in statement.arguments:
                try:
                    parse_text(raw.code)
                except ScriptError as error:
                    assert error.mark is not None


def test_deep_nesting_is_an_error_not_a_crash():
    for text in ("a = " + "(" * 5000 + "1" + ")" * 5000, "a = " + "-" * 5000 + "1"):
        try:
            (statement,) = parse(text)
            assert statement.node.depth == 1
        except ScriptError as error:
            assert "nested" in error.message


def test_long_scripts_are_read_in_proportion_to_their_length():
    """Four times the lines take four times the calls of functions, of Python's and of others."""
    text = "fix(f, initial_velocity_particles, g, atan2(1,1), 0, NULL) # c\nE = 1e+3*(2+3)\n"

    def work(count: int) -> int:
        calls = 0

        def counted(frame: Any, event: str, _: Any) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        before = sys.getprofile()
        sys.setprofile(counted)
        try:
            statements = parse(text * count)
        finally:
            sys.setprofile(before)
        assert len(statements) == 2 * count
        return calls

    work(1)  # The grammar is read once.
    few, many = work(100), work(400)
    assert few > 100 and many < 4.2 * few


@pytest.mark.parametrize(
    "state", ["none", "kept", "damaged", "cut off", "one bit", "a folder", "no folder"]
)
def test_a_parser_on_disk_is_read_and_never_a_reason_to_stop(tmp_path, monkeypatch, state):
    """It makes the same of a script, and of a mistake; a file that is no use is written anew."""

    def parsed() -> tuple:
        parser.parser_of.cache_clear()
        parser._tree.cache_clear()
        with pytest.raises(ScriptError) as mistake:
            parse("a = 2^(3\n")
        statements = re.sub(" at 0x[0-9a-f]+", "", repr(parse(PAPER)))
        return statements, mistake.value.render()

    usual = parsed()
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    folder = tmp_path / "parsers"
    if state == "no folder":
        folder.write_text("")
    elif state != "none":
        parsed()
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    whole = [file.read_bytes() for file in files]
    for file, content in zip(files, whole, strict=True):
        if state == "damaged":
            file.write_bytes(b"damaged")
        elif state == "cut off":
            file.write_bytes(content[: len(content) // 2])
        elif state == "one bit":
            middle = len(content) // 2
            file.write_bytes(
                content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
            )
        elif state == "a folder":
            file.unlink()
            file.mkdir()
    assert parsed() == usual
    kept = sorted(folder.iterdir()) if folder.is_dir() else []
    if state not in ("a folder", "no folder"):
        assert [file.name.partition("-")[0] for file in kept] == ["expression", "script"]
        assert min(file.stat().st_size for file in kept) > 5000
    if state == "kept":
        assert [file.read_bytes() for file in files] == whole  # only read
    parser.parser_of.cache_clear()
