"""The command method, and parts of a step with parameters of their own, which a plug-in brings."""

import re
import sys

import pytest
from conftest import ROOT
from plugged import install, offer

from karamelo_py.advice.choices import ALTERNATIVES, CHOICES
from karamelo_py.app.cli import main
from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.points.basis.gimp import CPGIMPCorners, CPGIMPStretch
from karamelo_py.points.transfers.taylor import TFLIP
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


def update(text):
    """What a script of commands has chosen."""
    hub = Hub()
    Interpreter(hub).run_text(text, "in.script")
    return hub.update


@pytest.fixture
def plugin(monkeypatch, tmp_path):
    """The example package, and one that offers what is a built-in style already."""
    monkeypatch.syspath_prepend(str(install(tmp_path)))
    taken = {"karamelo_py.basis": {"cubic-spline": "mpm_examples.smooth:Smooth"}}
    offer(tmp_path, "mpm-taken", "0.1", taken)
    registry.forget()
    yield
    monkeypatch.undo()
    for name in [name for name in sys.modules if name.startswith("mpm_examples")]:
        del sys.modules[name]
    registry.forget()


def test_words_stand_in_any_order():
    for words in ("corners, 0.5, thermo-mechanical", "0.5, thermo-mechanical, corners"):
        chosen = update(f"method(ulmpm, FLIP, cpgimp, gradient-enhanced, {words})")
        assert chosen.transfer == TFLIP(0.5)
        assert type(chosen.method.basis) is CPGIMPCorners
        assert chosen.thermal
    chosen = update("method(ulmpm, FLIP, cpgimp, 1)")
    assert type(chosen.method.basis) is CPGIMPStretch
    assert not chosen.thermal
    assert chosen.words == "ulmpm FLIP (alpha 1) cpgimp stretch musl"


def test_a_word_in_a_variable_and_a_word_that_is_a_variable():
    assert update('how = "thermo-mechanical"\nmethod(ulmpm, PIC, linear, how)').thermal
    assert not update('a = "mechanical"\nb = a\nmethod(ulmpm, PIC, linear, a, b)').thermal
    chosen = update("det = 0.3\nalpha = 0.4\nmethod(ulmpm, FLIP, cpgimp, alpha, det)")
    assert chosen.transfer.alpha == 0.4
    assert chosen.method.basis_name == "cpgimp det"


@pytest.mark.parametrize(
    ("typed", "column", "part"),
    [
        ("ulmpm, FLIP, linear, 1.5", 22, "'alpha' must be a number from 0 (PIC) to 1 (pure FLIP)"),
        ("ulmpm, XPIC, linear, 2.5", 22, "'order' must be a whole number from 1 to 20, not 2.5"),
        ("ulmpm, XPIC, linear, 21", 22, "from 1 to 20, not 21"),
        ("ulmpm, FLIP, linear", 1, "method(ulmpm, FLIP, linear, alpha) with alpha a number from 0"),
        ("ulmpm, FLIP, linear, time", 22, "value(time)"),
        ("ulmpm, APIC, linear, gradient-enhanced", 22, "goes with FLIP, not with APIC"),
        ("ulmpm, FLIP, linear, 1, det", 25, "det goes with cpgimp, not with linear"),
        ("ulmpm, FLIP, cpgimp, 1, det, stretch", 30, "'det' was chosen already"),
        ("ulmpm, PIC, linear, mechanical, thermo-mechanical", 33, "was chosen already"),
        ("ulmpm, PIC, linear, 3", 21, "PIC takes no number"),
    ],
)
def test_what_cannot_be_meant(typed, column, part):
    with pytest.raises(ScriptError) as caught:
        update(f"method({typed})")
    assert part in caught.value.render()
    assert caught.value.mark.column == column + (7 if column > 1 else 0)


def test_the_same_word_twice():
    """As scripts have it that keep places for what only some transfers and bases take."""
    chosen = update("method(ulmpm, TPIC, ugimp, thermo-mechanical, thermo-mechanical)")
    assert chosen.thermal


# --- parts of a plug-in -------------------------------------------------------------------------


def test_parameters_of_a_plug_in(plugin):
    chosen = update("scheme(plain-usl)\nmethod(coarse, growing, smooth, 3, 2, 0.25, 7)")
    assert chosen.transfer == (3.0, 2)
    assert chosen.method.basis == (0.25,)
    assert chosen.method.factor == 7.0
    assert type(chosen.scheme).__name__ == "PlainUSL"
    assert not chosen.thermal
    assert "growing (factor 3, times 2) smooth (share 0.25) plain-usl" in chosen.words
    # Words may stand anywhere behind the basis, those with a default be left out at the end.
    assert update("method(coarse, PIC, linear, thermo-mechanical, 2)").thermal
    assert update("method(ulmpm, growing, smooth, 3)").transfer == (3.0, 1)


@pytest.mark.parametrize(
    ("typed", "part"),
    [
        ("method(ulmpm, growing, linear, 5)", "'factor' must be a number from 0 to 4, not 5"),
        ("method(ulmpm, growing, linear, 2, 0)", "'times' must be a whole number of at least 1"),
        ("method(ulmpm, PIC, smooth, 2)", "'share' must be a number from 0 to 1, not 2"),
        ("method(ulmpm, XPIC, smooth, 2, 1, 1)", "XPIC with smooth takes order, share and no"),
        ("method(coarse, FLIP, linear, 1)", "method(coarse, FLIP, linear, 1, factor) with factor"),
        ("method(coarse, PIC, linear, 2, middle)", "or one of mechanical, thermo-mechanical"),
        ("method(coarse, PIC, linear, 0.5)", "a number of at least 1, not 0.5"),
        ("scheme(plain-usl, 1)", "one argument too many"),
        ("scheme(musl, 1)", "one argument too many"),
    ],
)
def test_limits_of_a_plug_in(plugin, typed, part):
    with pytest.raises(ScriptError) as caught:
        update(typed)
    assert part in caught.value.render()


def test_help_shows_the_parameters(plugin, capsys):
    for words, parts in {
        "transfer FLIP": ("method(kind, FLIP, basis, alpha[, gradient-enhanced])", "from 0 (PIC)"),
        "basis cpgimp": ("method(kind, transfer, cpgimp[, det|diagonal|stretch|corners])",),
        "transfer growing": ("growing, basis, factor[, times]", "from 0 to 4", "1 when left out"),
        "scheme plain-usl": ("scheme(plain-usl)",),
        "method coarse": (
            "method(coarse, transfer, basis, factor[, mechanical|thermo-mechanical])",
        ),
    }.items():
        assert main(["help", *words.split()]) == 0
        out = capsys.readouterr().out
        assert all(part in out for part in parts), out


def test_a_name_that_is_taken_disturbs_only_scripts_that_ask_for_it(plugin):
    assert update("method(ulmpm, PIC, linear)").words == "ulmpm PIC linear musl"
    chosen = update("method(ulmpm, PIC, linear)")
    assert registry.name_of("basis", type(chosen.method.basis)) == "linear"
    with pytest.raises(ScriptError, match=r"offered by two packages: karamelo-py .* and mpm-taken"):
        update("method(ulmpm, PIC, cubic-spline)")


AUTO = """
method(auto)
dimension({d}, {domain}, 0.1)
region(box, block, {box})
{material}
solid(body, region, box, 2, m, 0.1)
{more}
run(10)
"""
RUBBER = "material(m, neo-hookean, 1000, 1e6, 0.3)"
WET = "\npore_water(m, n=0.4, permeability=1e-3, gravity=10)"
OTHER = "region(b2, block, 0.8, 1.2, 0.2, 0.6)\nsolid(other, region, b2, 2, m, 0.1)\n"
FAST = "fix(v, initial_velocity_particles, g, 1e3, 0)"
PAIR = f"{OTHER}group(g, particles, region, box, solid, body)\n{FAST}"
PRESSED = f"""material(r, rigid, 1)
{OTHER.replace("2, m", "2, r")}group(g, particles, region, b2, solid, other)
fix(v, velocity_particles, g, -1, 0)
log_modify(custom, step, ContactForce_body_x)
"""
HELD = """group(low, nodes, region, box, all)
fix(hold, velocity_nodes, low, 0, 0)
fix(weight, body_force, all, 0, -10*time)
set_dt(0.01)
"""
POINTS = f"{PAIR}\nfix(touch, contact/minimize_penetration, body, other)"
DIAGONAL = PAIR.replace("1.2, 0.2, 0.6", "1.2, 0.8, 0.95").replace("1e3, 0", "1e3, 1e3")


def fluid(eos, strength="fluid, 0"):
    return f"eos(e, {eos})\nstrength(s, {strength})\nmaterial(m, eos-strength, e, s)"


@pytest.mark.parametrize(
    ("material", "more", "lines"),
    [
        (RUBBER, "", "method(tlmpm, PolyPIC, linear); scheme(usl)"),
        (RUBBER, "scheme(newmark)\nset_dt(1)", "method(tlmpm, FLIP, linear, 1)"),
        (RUBBER, PAIR, "method(ulmpm/contacts, FLIP, linear, 1); scheme(usavg)"),
        (RUBBER, DIAGONAL, "method(ulmpm/contacts, FLIP, linear, 1); scheme(usavg)"),
        (RUBBER.replace("neo-hookean", "linear").replace("0.3", "0.3, rate=none"), PAIR,
         "method(ulmpm/contacts, FLIP, linear, 1); scheme(usavg)"),
        (RUBBER, OTHER, "method(ulmpm, AFLIP, cubic-spline, 1, mass=corrected)"),
        (f"{RUBBER}\nboundary(periodic, x)", "", "method(ulmpm, FLIP, quadratic-spline, 0.99)"),
        ("material(m, linear, 1000, 1e6, 0.3, 500, 50)", "", "linear, thermo-mechanical)"),
        (fluid("fluid, 1000, 1e5, 7"), "", "method(ulmpm, PolyPIC/quadratic, cubic-spline)"),
        (fluid("fluid, 1000, 1e5, 7"), "fix(weight, body_force, all, 0, -1)",
         "method(ulmpm, AFLIP, quadratic-spline, 1)"),
        (fluid("linear, 1000, 1e6", "plastic, 5e5, 1e3"), "scheme(newmark)\nset_dt(1)",
         "method(tlmpm, FLIP, linear, 1); anti_volumetric_locking(true)"),
        (RUBBER + WET, "", "method(tlmpm, FLIP, linear, 1)"),
        (RUBBER + WET, OTHER, "method(ulmpm, FLIP, quadratic-spline, 0.999)"),
        (fluid("linear, 1000, 1e6", "mohr-coulomb, 5e5, 1e3, 30") + WET, "",
         "method(ulmpm, FLIP, quadratic-spline, 0.999)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"), "", "method(tlmpm, APIC, linear); scheme(usl)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"), HELD.replace("10*time", "10"),
         "method(ulmpm, APIC, cubic-spline, mass=corrected)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"), "fix(v, initial_velocity_particles, all, 9, 0)",
         "method(ulmpm, APIC, cubic-spline, mass=corrected)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"),  # vortices
         "fix(v, initial_velocity_particles, all, sin(30*y0), 0)\nrun_time(1)",
         "method(ulmpm, APIC, cubic-spline, mass=corrected)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5, Q1=2"), "fix(v, initial_velocity_particles, all, 9, 0)",
         "method(tlmpm, APIC, linear); scheme(usl)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"), f"eos(f, ideal-gas, 1, 1.4, p=1e6)\nmaterial(n, "
         f"eos-strength, f, s)\n{OTHER.replace('2, m', '2, n').replace('0.8, 1.2', '0.6, 1')}",
         "method(ulmpm, APIC, cubic-spline); scheme(usl)"),
        (fluid("ideal-gas, 1, 1.4, p=1e5"), f"eos(f, ideal-gas, 1, 1.4, p=1e7)\nmaterial(n, "
         f"eos-strength, f, s)\n{OTHER.replace('2, m', '2, n').replace('0.8, 1.2', '0.6, 1')}",
         "method(ulmpm, APIC, cubic-spline)"),
        (fluid("ideal-gas, 1, 1.4, p=1, Q1=0.1, Qh=3"),
         "fix(v, initial_velocity_particles, all, 9, 0)",
         "method(ulmpm, TPIC, cubic-spline, thermo-mechanical); scheme(usavg); dt_factor(0.6)"),
        (fluid("ideal-gas, 1, 1.4, p=1, Q1=0.1, Qh=3"),
         "fix(v, initial_velocity_particles, all, 9, 0)\nset_dt(1e-4)",
         "method(ulmpm, TPIC, cubic-spline, thermo-mechanical); scheme(usavg)"),
        (fluid("linear, 1000, 1e6", "mohr-coulomb, 5e5, 1e3, 30"), "",
         "method(ulmpm, FLIP, quadratic-spline, 0.99)"),
        (fluid("linear, 1000, 1e6", "plastic, 5e5, 1e3"), "", "method(ulmpm, FLIP, linear, 0.99)"),
        (fluid("linear, 1000, 1e6", "mohr-coulomb, 5e5, 1e3, 0"),
         "scheme(quasi-static)\nset_dt(1)\ngroup(g, nodes, region, box, all)\n"
         "fix(press, velocity_nodes, g, 0, -1e-3)",
         "method(tlmpm, FLIP, Bernstein-quadratic, 1)"),
        (RUBBER, HELD, "method(tlmpm, FLIP, quadratic-spline, 1)"),
        (RUBBER, f"{HELD}scheme(quasi-static)\nset_dt(1)",
         "method(tlmpm, FLIP, quadratic-spline, 1)"),
        (RUBBER, HELD.replace("10*time", "sin(200*time)"),
         "method(tlmpm, PolyPIC, linear); scheme(usl, start=half)"),
        (fluid("linear, 1000, 1e6", "plastic, 5e5, 1e3"), POINTS,
         "method(tlmpm, FLIP, linear, 0.99); anti_volumetric_locking(true)"),
        (RUBBER, PRESSED, "method(ulmpm/contacts, APIC, quadratic-spline)"),
        (RUBBER, f"{OTHER}fix(rub, contact/friction, body, other, 0.2)",
         "method(ulmpm/contacts, FLIP, cubic-spline, 0.99)"),
    ],
)  # fmt: skip
def test_auto_by_the_scene(run_interpreted, material, more, lines):
    """Materials, bodies, speeds and contact select the row of docs/choose.md."""
    text = AUTO.format(
        d=2, domain="0, 2, 0, 1", box="0.2, 0.6, 0.2, 0.6", material=material, more=more
    )
    said = run_interpreted(text, command="check").out
    if "Bernstein" in lines:
        one = run_interpreted(text.replace("box, 2, m", "box, 1, m"), command="check").out
        assert "which writes" in one and "Bernstein" not in one
    assert lines in re.search("which writes +(.*)", said)[1]
    if "usavg" in lines:
        assert re.search("^method .* usavg( |$)", said, re.M)


WALLS = "region(in, block, 0.05, 0.95, exterior)\ngroup(w, nodes, region, in, all)\n"
CORE = """eos(h, ideal-gas, 1, 1.4, p=2e7)
material(hot, eos-strength, h, s)
region(core, block, 0, 0.1)
delete_particles(body, region, core)
solid(core, region, core, 2, hot, 0.1)
"""


@pytest.mark.parametrize(
    ("eos", "more", "lines"),
    [
        ("ideal-gas, 1, 1.4, p=1e5", f"{WALLS}fix(w, velocity_nodes, w, 0)",
         "method(tlmpm, APIC, linear); scheme(usl)"),
        ("ideal-gas, 1, 1.4, p=1e5", f"{WALLS}fix(w, velocity_nodes, w, 1)",
         "method(tlmpm, TPIC, quadratic-spline)"),
        ("ideal-gas, 1, 1.4, p=1e5", CORE.replace("2e7", "4e5"),
         "method(ulmpm, APIC, cubic-spline); scheme(usl)"),
        ("ideal-gas, 1, 1.4, p=1e5", CORE,
         "method(ulmpm, FLIP, quadratic-spline, 1); scheme(usavg)"),
        ("jwl, 1630, 3.712e11, 3.23e9, 4.15, 0.95, 0.3, 7e9, 6930", "",
         "method(tlmpm, TPIC, quadratic-spline)"),
    ],
)  # fmt: skip
def test_auto_for_gas_in_one_dimension(run_interpreted, eos, more, lines):
    """Sound in a tube, a piston, a shock, a blast from one cell, and a detonation."""
    text = AUTO.format(d=1, domain="0, 1", box="0, 1", material=fluid(eos), more=more)
    said = run_interpreted(text, command="check").out
    assert lines in re.search("which writes +(.*)", said)[1]


def test_a_step_set_in_a_resumed_run_replaces_the_factor_of_auto(run_interpreted):
    """The script names one of both, so nothing is to leave out."""
    gas = fluid("ideal-gas, 1, 1.4, p=1, Q1=0.1, Qh=3")
    fast = "fix(v, initial_velocity_particles, all, 9, 0)\nrestart(1, r.*.h5)"
    text = AUTO.format(d=2, domain="0, 2, 0, 1", box="0, 0.2, 0, 0.2", material=gas, more=fast)
    run_interpreted(text.replace("run(10)", "run(1)"))
    text = text.replace("run(10)", "set_dt(1e-5)\nrun(2)")
    result = run_interpreted(text, "-restart", "r.1.h5")
    assert "dt_factor(0.6)" in result.out and "no effect" not in result.err


def test_auto_leaves_what_the_script_names(run_interpreted):
    """A scheme of the script remains, and a mistake after method(auto) is reported at its line."""
    text = AUTO.format(d=1, domain="0, 1", box="0, 0.5", material=RUBBER, more="scheme(musl)")
    result = run_interpreted(text, command="check")
    assert re.search("^method +tlmpm PolyPIC linear musl$", result.out, re.M)
    assert "usl" not in re.search("^chosen for +(.*)", result.out, re.M)[1]
    assert "warning" not in result.out + result.err
    for target in ("0", "-1", "1", "2", "small", '"0.1"'):
        with pytest.raises(ScriptError, match=r"accuracy|small"):
            Interpreter(Hub()).run_text(text.replace("auto", f"auto, accuracy={target}", 1), "in")
    on_line = OTHER.replace("0.8, 1.2, 0.2, 0.6", "0.8, 0.9")
    for wrong, line, words in (
        (text.replace("rubber", "m").replace("0.3)", "0.7)"), 5, "Poisson's ratio 0.7"),
        (text.replace("auto", "auto, FLIP"), 2, "one argument too many"),
        (text.replace("auto", "auto, thermo-mechanical"), 2,
         "hint: method(auto): heat flows if a material conducts it"),
        (text.replace("auto", "ulmpm, auto"), 2, "hint: method(auto) chooses all of them"),
        (text.replace("scheme(musl)", f"{on_line}scheme(semi-implicit)\n"
                      "fix(touch, contact/solids, body, other)"), 10,
         "expected: scheme(musl), or the scene without this fix"),
        (text.replace("scheme(musl)", f"{on_line}fix(touch, contact/solids, body, other)\n"
                      "fix(v, initial_velocity_particles, other, 1)"), 10, "'other' is a solid"),
        (f"{text.replace('auto', 'ulmpm, FLIP, linear, 1', 1)}method(auto)\nrun(1)", 9,
         "the method cannot change once there are solids"),
        ("method(auto)", 1, "method(auto) reads the script ahead"),
    ):  # fmt: skip
        with pytest.raises(ScriptError) as raised:
            Interpreter(Hub()).run_text(wrong, "in.script")
        assert words in raised.value.render() and raised.value.mark.line == line


def test_a_target_is_stated_and_not_checked(run_interpreted):
    """`check` names the set-ups that ``advise`` compares, which the scene supports."""
    text = AUTO.format(d=2, domain="0, 1, 0, 1", box="0, 0.5, 0, 0.5", material=RUBBER, more="")
    text = text.replace("auto", "auto, accuracy=0.01")
    checked = run_interpreted(text, command="check").out
    assert re.search("^accuracy +0.01 is the target; not checked", checked, re.M)
    named = re.search("^advise tries +(.*)$", checked, re.M)[1].split(", ")
    assert named[0] == "rules" and {*named[1:]} == {*ALTERNATIVES} - {"total"}
    slow = text.replace("run(10)", "scheme(newmark)\nset_dt(1)\nrun(1)")
    named = re.search("^advise tries +(.*)$", run_interpreted(slow, command="check").out, re.M)[1]
    assert "total-quadratic" in named and "corrected" not in named
    with pytest.raises(ScriptError, match="unknown set-up 'cubic'"):
        Interpreter(Hub(), {"auto": "cubic"}).run_text(text, "in.script")


def test_auto_takes_a_method_that_the_scheme_supports(run_interpreted):
    """Pore water excludes most transfers."""
    wet = "material(m, linear, 1000, 1e7, 0.2)\npore_water(m, n=0.4, permeability=1e-3, gravity=10)"
    more = "scheme(semi-implicit)"
    text = AUTO.format(d=1, domain="0, 1", box="0, 0.5", material=wet, more=more)
    said = run_interpreted(text, command="check").out
    assert re.search("^method +tlmpm FLIP .*linear semi-implicit$", said, re.M)


def test_auto_is_the_table_of_the_page():
    """docs/choose.md lists the rows in order, with lines, reason and scenes of evidence."""
    page = (ROOT / "docs" / "studies" / "advise.md").read_text("utf-8")
    for name, lines in ALTERNATIVES.items():
        words = ", ".join(f"`{line.replace('{grid}', 'ulmpm')}`" for line in lines)
        assert f"| `{name}` | {words} |\n" in page
    page = (ROOT / "docs" / "choose.md").read_text("utf-8").partition("## Chosen by the program")[2]
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")][1:]
    for choice, row in zip(CHOICES, rows, strict=False):
        lines = ", ".join(f"`{line.replace('{grid}', 'ulmpm')}`" for line in choice.lines)
        scenes = ", ".join(f"`{name}`" for name in choice.evidence)
        reason = choice.reason(choice.lines)
        assert row == [f"| {choice.scene}", lines, reason, f"{scenes} |"]
