"""Faulty styles of plug-ins: one message names style, package, line of the script and reason."""

import os
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import interpreting
from numba import config
from plugged import offer

from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.run.lower.hooks import lower_hooks
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError

pytestmark = pytest.mark.xdist_group("faults")

FAMILIES = {
    "fix": "spring light misplaced swapped cold hot many few undirected viewless idle misspelt "
    "silent stop ids weigh bare formless oneword clashing nodal first again doubled lost leaving "
    "blurred turning silenced orphan wholly heavily fixing homeless late slim lawless dark "
    "nodeless early elsewhere unnamed partly slightly",
    "compute": "gauge mute",
    "material": "motionless growing raising short uncompiled hiding double",
    "strength": "forgetful endless uncountable lone misnaming renaming constant misshapen stray",
    "basis": "pathless tuple vague heavy slanted narrow precise distorted",
    "transfer": "lazy absent loose",
    "scheme": "rowless wrong grounded",
    "dump": "torn",
    "command": "forget",
}
NAMES = {"oneword": "OneWord", "forget": "forget"}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the package mpm-broken."""
    folder = tmp_path_factory.mktemp("faults")
    # A link: with a file newer than this process, later tests would find no kernels on disk.
    (folder / "mpm_broken.py").symlink_to(Path(__file__).with_name("mpm_broken.py"))
    styles = {
        f"karamelo_py.{family}": {
            name: f"mpm_broken:{NAMES.get(name, name.title())}" for name in names.split()
        }
        for family, names in FAMILIES.items()
    }
    return offer(folder, "mpm-broken", "0.1", styles)


@pytest.fixture(scope="module")
def _interpreter(site):
    with interpreting(site) as process:
        yield process


@pytest.fixture
def hub(site, monkeypatch):
    """A hub that knows the styles above."""
    monkeypatch.syspath_prepend(str(site))
    registry.forget()
    yield Hub()
    monkeypatch.undo()
    registry.forget()


def run(hub, text):
    Interpreter(hub).run_text(text, "in.wrong")


def test_init(hub):
    with pytest.raises(ScriptError, match=r"fix spring .*__init__: ZeroDivisionError.*broken.py:"):
        run(hub, "fix(s, spring, all, 0)")


@pytest.mark.parametrize(
    ("style", "message"),
    [
        ("misplaced", "post_particles_to_grid is a stage of nodes, but its hook was made for po"),
        ("swapped", "final_integrate is a stage of points, but its hook was made for nodes"),
        ("cold", "supply_heat is a stage of heated points, but its hook was made for points"),
        ("hot", "initial_integrate is a stage of points, but its hook was made for heated"),
        ("many", "post_particles_to_grid: too_few has to take the one argument of a hook on nodes"),
        ("few", "initial_integrate: <lambda> has to return 3 numbers, not (1.0, 1.0)"),
        ("heavily",
         "initial_integrate reads 'weight': 'mass', 'velocity', 'position', 'volume', 'face'"),
        ("fixing", "initial_integrate writes 'mass': 'velocity' or a class of a field"),
        ("homeless", "initial_integrate: points have no Force because of this fix: its author nam"),
        ("late", "final_integrate: forces on points are set in initial_integrate"),
        ("nodeless",
         "post_particles_to_grid reads 'position': 'mass', 'velocity', 'velocity_updat"),
        ("early", "post_update_grid_state writes 'force': 'velocity_update' or a class of a field"),
        ("elsewhere", "final_integrate is a stage of points, but its hook was made for whole nod"),
        ("slim", "final_integrate: laid has to take the 4 arguments of a hook on whole points"),
        ("unnamed",
         "initial_integrate takes a function with a name (def name(...): ...), not a <la"),
        ("partly",
         "post_particles_to_grid takes a function with a name (def name(...): ...), not "),
        ("slightly",
         "initial_integrate takes a function with a name (def name(...): ...), not a p"),
        ("undirected", "it has no formulas, so post_particles_to_grid would act in no direction"),
        ("viewless", "initial_integrate has to take one argument, the view of the group"),
        ("bare", "point_fields has to be a tuple of classes, as in (Other,)"),
        ("formless", "the field Formless is not derived from Field"),
        ("oneword", "the field Wordy has columns that are not a tuple of words, as in ('dose',)"),
        ("doubled", "the field Sized: it starts from 2 numbers and has 1 components"),
        ("lost", "the field Unshaped: AttributeError: 'Line' object has no attribute 'dimensions'"),
        ("clashing", "Taken: the column 'vx' is one of every scene"),
        ("nodal", "Taken: the column 'vx' is one of every scene"),
    ],
)  # fmt: skip
def test_a_fix_that_cannot_be_meant(hub, style, message):
    with pytest.raises(ScriptError) as caught:
        run(hub, f"\nfix(s, {style}, all)")
    text = caught.value.render()
    assert text.startswith(f"in.wrong:2:1: error: fix {style} (of mpm-broken 0.1): {message}")
    assert f"tell the author of {style}" in text


def test_a_fix_that_forgets_its_base(hub):
    with pytest.raises(ScriptError) as caught:
        run(hub, "\nfix(s, orphan, all)")
    assert re.match(
        r"in\.wrong:2:1: error: fix orphan \(of mpm-broken 0\.1\): initial_integrate acts on a "
        r"group, .* super\(\).__init__\(hub, group\) \(mpm_broken\.py:\d+\)\n",
        caught.value.render(),
    )


def test_a_column_belongs_to_one_field(hub):
    with pytest.raises(ScriptError, match=r"hiding .*: the column 'seq' is one of every scene"):
        run(hub, "material(m, hiding, 1)")
    with pytest.raises(
        ScriptError, match=r"double .*: the column 'dose' is one of the field Other"
    ):
        run(hub, "fix(e, first, all)\nmaterial(m, double, 1)")
    with pytest.raises(ScriptError, match="Second: the column 'dose' is one of the field Other"):
        run(hub, "fix(f, first, all)\nfix(s, again, all)")
    run(hub, "fix(f, first, all)\nfix(g, first, all)")
    assert "dose" in hub.fields.particle_names()


@pytest.mark.parametrize(
    ("style", "told"),
    [
        ("idle)", "idle has no effect: no step calls it, and it measures nothing"),
        ("idle)", "initial_integrat, which is not a hook"),
        ("idle)", "rename it to initial_integrate, or begin"),
        ("misspelt, all)", "post_gird_to_point, which is not a hook, and no step"),
        ("misspelt, all)", "rename it to post_grid_to_point, or begin the name with _"),
        ("blurred, all)", "rename it to post_update_grid_state, or begin"),
        ("silent, all)", "has names in `published`, but none of its hooks publishes: s_x"),
    ],
)
def test_what_would_be_silent(hub, capsys, style, told):
    run(hub, f"fix(s, {style}")
    text = capsys.readouterr().err
    assert told in text
    assert "_post_process" not in text
    assert "position_of" not in text


@pytest.mark.parametrize(
    ("line", "part", "message"),
    [
        ("method(ulmpm, PIC, vague)", "basis vague", "Vague has no attribute traits"),
        ("method(ulmpm, lazy, linear)", "transfer lazy", "updated_velocity is not defined for"),
        ("method(ulmpm, loose, linear)", "transfer loose", "inverts_spread is one of its traits: "),
        ("method(ulmpm, PIC, distorted)", "basis distorted",
         "gradient_jump is one of its traits: traits = BasisTraits(gradient_jumps=...)"),
        ("strength(s, stray, 1)", "strength stray", "ring is one of its traits: traits = "),
        ("scheme(rowless)", "scheme rowless", "Rowless has no attribute rows"),
        ("scheme(wrong)", "scheme wrong", "'twice' in its rows is not a row of a scheme"),
        ("scheme(grounded)", "scheme grounded", "none of its rows is a Scatter"),
        ("forget()", "forget", "it: KeyError: 'it' (mpm_broken.py:"),
    ],
)  # fmt: skip
def test_parts_that_are_not_whole(hub, line, part, message):
    with pytest.raises(ScriptError) as caught:
        run(hub, line)
    text = caught.value.render()
    assert text.startswith(f"in.wrong:1:1: error: {part} (of mpm-broken 0.1): {message}")


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_a_hook_that_cannot_be_compiled(hub):
    run(hub, "dimension(2)\nfix(s, light, all)")
    hub.domain = SimpleNamespace(dimension=2)
    with pytest.raises(ScriptError) as caught:
        lower_hooks(hub, list(hub.fixes.values()))
    text = caught.value.render()
    assert text.startswith("in.wrong:2:1: error: fix light (of mpm-broken 0.1): post_grid_to_point")
    assert "it cannot be compiled: " in text
    assert re.search(r"\(mpm_broken.py:\d+\)", text)


def test_refresh(hub):
    run(hub, "compute(g, gauge, all)")
    with pytest.raises(ScriptError, match=r"compute gauge .*refresh: .*Gauge.published"):
        hub.refresh_values()


# --- at a run -----------------------------------------------------------------------------------

SCENE = """\
{method}
dimension(1, 0, 4, 0.5)
region(bar, block, 1, 3)
{material}
solid(bar, region, bar, 2, m, 0.5)
fix(start, initial_velocity_particles, all, 1)
{fix}
dump(d, all, particle, 1, d.*.LAMMPS, vx)
{dump}
set_dt(1e-3)
run(2)
"""
USUAL = {
    "method": "method(ulmpm, FLIP, linear, 1)", "material": "material(m, linear, 3, 100, 0.3)",
    "fix": "", "dump": "",
}  # fmt: skip
STRENGTH = "eos(e, linear, 3, 100)\n{}\nmaterial(m, eos-strength, e, s)"


def scene(line):
    """A script with this line in place of the usual one of its command."""
    kind = line.partition("(")[0].replace("compute", "dump")
    if kind == "strength":
        kind, line = "material", STRENGTH.format(line)
    return SCENE.format(**(USUAL | {kind: line}))


@pytest.mark.parametrize(
    ("line", "part", "message"),
    [
        ("fix(s, spring, all)", "fix spring", "initial_integrate: NameError: name 'mi"),
        ("fix(s, wholly, all)", "fix wholly",
         "initial_integrate: whole has to return 1 number for velocity, not 2"),
        ("fix(s, lawless, all)", "fix lawless",
         "initial_integrate: heat_content is not defined for (Linear"),
        ("fix(s, weigh, all)", "fix weigh", "initial_integrate: ValueError: assign"),
        ("fix(s, leaving, all)", "fix leaving", "initial_integrate: SystemExit: bye"),
        ("fix(s, silenced, all)", "fix silenced", "initial_integrate: SystemExit: 0"),
        ("dump(t, all, torn, 1, t)", "dump torn", "write: KeyError: 'lost' (mpm_bro"),
        ("material(m, motionless, 1)", "material motionless", "advance is not "),
        ("material(m, raising, 1)", "material raising", "name 'unknown' is not"),
        ("material(m, growing, 1)", "material growing",
         "the memory of a point has 1 numbers at first and 2 after a step"),
        ("material(m, short, 1)", "material short",
         "cauchy_stress has to return a symmetric tensor of 3, not a tuple of 2"),
        ("strength(s, forgetful, 50)", "strength forgetful",
         "updated_memory has to return a tuple of 2, not a Less of 1 (mpm_bro"),
        ("method(ulmpm, FLIP, pathless, 1)", "basis pathless",
         "along is not defined for (Pathless)"),
        ("method(ulmpm, FLIP, tuple, 1)", "basis tuple", "along has to return an Along"),
        ("method(ulmpm, FLIP, heavy, 1)", "basis heavy",
         "the weights of a point at 1.125 add up to 1.075, not to 1"),
        ("method(ulmpm, FLIP, slanted, 1)", "basis slanted",
         "the gradients, times h, of a point at 1.125 add up to 0.1, not to 0"),
        ("method(ulmpm, FLIP, narrow, 1)", "basis narrow",
         "along has to return 2 weights, not 3: register says so"),
        ("method(ulmpm, FLIP, precise, 1)\nprecision(single)", "basis precise",
         "a weight is a double (float64) in a run of precision(single)"),
        ("method(ulmpm, absent, linear)", "transfer absent",
         "updated_velocity is None for some point, no number"),
        ("strength(s, endless, 50)", "strength endless",
         "flow_stress, or its slope, at a plastic strain of 0 is inf"),
        ("strength(s, uncountable, 50)", "strength uncountable", "is nan for some point"),
    ],
)  # fmt: skip
def test_a_run_names_the_part(run_interpreted, line, part, message):
    script = scene(line)
    at = script.splitlines().index(line.splitlines()[0]) + 1
    text = run_interpreted(script, status=1).err
    assert f"in.script:{at}:1: error: {part} (of mpm-broken 0.1): " in text
    assert message in text
    assert "internal error" not in text


@pytest.mark.parametrize(
    ("style", "message"),
    [
        ("lone", "flow_stress has to return a tuple of 2, not a float (mpm_broken.py:"),
        ("misnaming", "AttributeError: 'MisnamingMemory' object has no attribute 'R1' (mpm_brok"),
        ("renaming", "ValueError: Got unexpected field names: ['R1'] (mpm_broken.py:"),
        ("constant", "R would never change: it has no updated_memory"),
        ("misshapen", "ValueError: not enough values to unpack (expected 3, got 2), in 's, memory"),
    ],
)
def test_a_material_names_the_part(hub, style, message):
    with pytest.raises(ScriptError) as caught:
        run(hub, f"eos(e, linear, 3, 9)\nstrength(s, {style}, 5)\nmaterial(m, eos-strength, e, s)")
    assert caught.value.render().startswith(
        f"in.wrong:2:1: error: strength {style} (of mpm-broken 0.1): {message}"
    )


def test_a_hook_makes_a_vector_of_the_class_it_is_given(run_interpreted):
    folder = run_interpreted(scene("fix(s, turning, all)")).folder
    vx = [np.loadtxt(folder / f"d.{step}.LAMMPS", skiprows=11)[:, -1] for step in (0, 1, 2)]
    assert (vx[0] == 1).all()
    assert (vx[1] < 0).all()
    assert (vx[2] > 0).all()


def test_a_compute_that_publishes_nothing_is_told(run_interpreted):
    said = run_interpreted(scene("compute(c, mute, all)\nlog_modify(custom, step, c_x)")).err
    assert "in.script:9:1: warning: compute mute has not published anything: c_x" in said
    assert said.count("not published anything") == 1


def test_what_a_hook_changes_in_place_is_written(run_interpreted):
    folder = run_interpreted(scene("fix(s, stop, all)")).folder
    for step in (1, 2):
        vx = np.loadtxt(folder / f"d.{step}.LAMMPS", skiprows=11)[:, -1]
        assert (vx == 0).all()


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("fix(s, light, all)", "in.wrong:7:1: error: fix light"),
        ("fix(s, dark, all)", "in.wrong:7:1: error: fix dark"),
        ("material(m, uncompiled, 1)", "in.wrong:4:1: error: material uncompiled"),
    ],
)
def test_the_command_line_tells_of_what_cannot_be_compiled(site, compiling, tmp_path, line, part):
    (tmp_path / "in.wrong").write_text(scene(line))
    path = os.pathsep.join([str(site), os.environ["PYTHONPATH"]])
    done = subprocess.run(
        [compiling, "-m", "karamelo_py.app.cli", "in.wrong"], cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path, "NUMBA_DISABLE_JIT": "0"},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 1
    assert f"{part} (of mpm-broken 0.1): " in done.stderr
    assert re.search(r"it cannot be compiled: .*\(mpm_broken.py:\d+\)", done.stderr)
    assert "Traceback" not in done.stderr


class View(PointsView):
    """Three points in 2D."""

    def __init__(self):
        self._handed_out, self._declared = {}, {}
        self.ids = np.arange(3)
        self._v = np.zeros((3, 2))

    @property
    def _rows(self):
        return SimpleNamespace(
            take=lambda _: self._v,
            put=lambda _, value: np.copyto(self._v, value),
            declared=lambda _: None,
        )


def test_ids_are_those_of_dumps(run_interpreted):
    """In hooks, too, they count from 1."""
    folder = run_interpreted(scene("fix(s, ids, all)")).folder
    columns = np.loadtxt(folder / "d.2.LAMMPS", skiprows=11)
    np.testing.assert_array_equal(columns[:, -1], columns[:, 0])


def test_views_refuse_what_does_not_fit():
    view = View()
    view.velocity = 1.0
    view.velocity += np.ones((3, 2))
    view.velocity[0] += 1
    view.write_back()
    assert (view._v == [[3, 3], [2, 2], [2, 2]]).all()
    with pytest.raises(ValueError, match="read-only"):
        view.mass[:] = 0
    with pytest.raises(AttributeError, match="did you mean 'velocity'"):
        view.velocty = 1.0
    with pytest.raises(AttributeError, match="did you mean 'velocity'"):
        view.velocty  # noqa: B018
    with pytest.raises(ValueError, match=r"velocity has the shape \(3, 2\), not \(2,\)"):
        view.velocity = np.ones(2)
