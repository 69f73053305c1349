"""What load steps say of scenes and steps that go wrong, and how they end."""

import signal
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from karamelo_py.output import console
from karamelo_py.points.kinematics import PlaneStrain
from karamelo_py.run.implicit import check, solvers
from karamelo_py.run.implicit.load_steps import LoadSteps
from karamelo_py.run.implicit.newton import Broken, Newton
from karamelo_py.script.errors import ScriptError
from tests.test_implicit import HELD, coarse, patch

pytestmark = pytest.mark.xdist_group("implicit")
FLUID = """eos(w, fluid, 1000, 1e5, 7)
    strength(w, fluid, 1e-3)
    material(m, eos-strength, w, w)"""


@pytest.mark.parametrize("wrong", ["quasi-statc", "quasi-static, tol=1e-8", "quasi static"])
def test_a_wrong_scheme_is_one_error(run_interpreted, wrong):
    """Names that the scheme would publish are not at fault, too; short names mean long ones."""
    result = run_interpreted(patch().replace("quasi-static", wrong), status=1)
    assert result.err.count("error:") == 1
    assert "did you mean" in result.err or " " in wrong


def test_a_fluid_finds_no_equilibrium(run_interpreted):
    """It bears no shear, whatever the viscosity: said before the run, at the solid."""
    text = patch().replace("material(m, linear, 1, 1000, 0.25)", FLUID)
    result = run_interpreted(text, status=1)
    assert "carries no shear" in result.err and "solid(s" in result.err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("fix(v, initial_velocity_particles, all, 1, 0)", "has no inertia: the velocities of fix"),
        ("fix(v, velocity_particles, all, 1, 0)", "at a stage that only explicit steps have"),
    ],
)
def test_a_fix_of_explicit_steps_is_refused(run_interpreted, line, says):
    result = run_interpreted(patch(f"{HELD}\n    {line}"), status=1)
    assert says in result.err and line in result.err


def test_solids_with_grids_of_their_own_are_told_of_contact_in_load_steps(run_interpreted):
    second = coarse(HELD + "\n    solid(t, region, box, 2, m, 0.1, 0)").replace("run(4)", "run(1)")
    said = run_interpreted(second, "-var", "kind", "tlmpm").err
    assert "pass through each other" in said and "hint: method(ulmpm/contacts" in said


# A block that is pulled by its weight: no equilibrium beyond 2/sqrt(3) of the yield stress.
BEYOND = patch(
    """fix(hold, velocity_nodes, left, 0, 0)
    fix(pull, body_force, all, time, 0)"""
).replace(
    "material(m, linear, 1, 1000, 0.25)",
    """eos(e, linear, 1, 667)
    strength(y, plastic, 400, 1)
    material(m, eos-strength, e, y)""",
)


def test_a_failed_step_is_not_kept(run_script):
    """The last state between steps is in a file, which a run of smaller steps goes on from."""
    words = "-var", "basis", "quadratic-spline"
    result = run_script(BEYOND.replace("pull_x", "hold_x"), *words, status=1)
    assert "  # with smaller load steps" in result.err and " of the load step" in result.err
    (file,) = result.folder.glob("last_good.*.h5")
    steps = int(file.name.split(".")[1])
    assert 1 <= steps < 4
    assert len(result.log["hold_x"]) == steps + 1


def test_a_run_goes_on_with_another_solver(run_script):
    """Tolerance, iterations, solver and limit are not part of the scene."""
    text = patch(HELD + "\n    restart(2, r.*.h5)")
    file = run_script(text).folder / "r.2.h5"
    other = text.replace("quasi-static", "quasi-static, tolerance=1e-8, solver=direct")
    rest = run_script(other, "-restart", str(file), folder="again")
    assert len(rest.log["pull_x"]) == 2
    other = text.replace("quasi-static", "quasi-static, stabilisation=0")
    assert "another script" in run_script(other, "-restart", str(file), status=1, folder="no").err


def test_a_hinge_is_named(run_script):
    """A body on one node of another can turn there."""
    more = """region(other, block, 1, 1.4, 1, 1.4)
    solid(loose, region, other, 2, m, 0.1, 0)
    fix(hold, velocity_nodes, left, 0, 0)
    fix(pull, body_force, all, 0.01, 0)"""
    text = patch(more).replace("pull_x", "hold_x").replace("0, 1.4, 0, 1, 0.1", "0, 2, 0, 2, 0.1")
    result = run_script(text.replace("quasi-static", "quasi-static, stabilisation=0"), status=1)
    assert "solid 'loose' is not held near" in result.err


def test_a_step_can_be_left(run_script, monkeypatch):
    """Ctrl-C amid the third step: the run ends behind the second, with its state."""
    correction = Newton._correction
    steps = []

    def interrupting(self, *arguments):
        steps.append(self)
        hub = self.hub_of_test
        if hub.values.get("timestep") == 2:
            signal.raise_signal(signal.SIGINT)
        return correction(self, *arguments)

    part = LoadSteps._part

    def noting(self, *arguments):
        Newton.hub_of_test = self.simulation.hub
        return part(self, *arguments)

    monkeypatch.setattr(Newton, "hub_of_test", None, raising=False)
    monkeypatch.setattr(LoadSteps, "_part", noting)
    monkeypatch.setattr(Newton, "_correction", interrupting)
    result = run_script(
        patch(HELD.replace("everywhere", "left").replace("1e-4", "1e-2")), status=None
    )
    assert len(result.log["pull_x"]) == 3
    assert len({id(newton) for newton in steps}) == 3


def test_a_step_that_is_done_in_part_can_be_left(run_script, monkeypatch):
    """Ctrl-C between its parts: the points are where they were before it; progress tells of it."""
    step, interrupted, left = LoadSteps._step, LoadSteps._interrupted, []

    def places(self):
        block = self.simulation.setup.blocks[0]
        order = np.argsort(block.points.id)
        return block.points.x[self.simulation.control.motion[0].now][:, order].copy()

    def stepping(self, hooks):
        before = places(self)
        try:
            step(self, hooks)
        except Broken:
            left.append(np.array_equal(places(self), before))
            raise

    def interrupting(self, *arguments):
        if self.parts == 1 and not left:
            left.append(signal.raise_signal(signal.SIGINT))
        return interrupted(self, *arguments)

    monkeypatch.setattr(console, "REPORT", 0.0)
    monkeypatch.setattr(LoadSteps, "_step", stepping)
    monkeypatch.setattr(LoadSteps, "_interrupted", interrupting)
    result = run_script(patch(HELD).replace("1e-4", "0.16"), status=None)
    assert left == [None, True] and "; part 2, correction 0, residual" in result.out


BESIDE = """
    stiff = 1e3
    method(ulmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 2, 0, 1, 0.25)
    region(a, block, 0.25, 0.75, 0, 0.75)
    region(b, block, 1.25, 1.75, 0, 0.75)
    material(soft, neo-hookean, 1, 1000, 0.3)
    material(hard, neo-hookean, 1, stiff, 0.3)
    solid(a, region, a, 2, soft, 0.25, 0)
    solid(b, region, b, 2, hard, 0.25, 0)
    region(low, block, INF, INF, INF, 1e-6)
    group(low, nodes, region, low, all)
    fix(hold, velocity_nodes, low, 0, 0)
    group(pa, nodes, region, a, solid, a)
    group(pp, particles, region, a, solid, a)
    fix(pull, body_force, pa, 5*time, 0)
    set_output(1)
    xa = xcm(pp, x)
    log_modify(custom, step, xa)
    run(1)
"""


def test_a_stiff_body_leaves_a_soft_one_as_it_is(run_interpreted):
    """They share no node: the sway of the soft one does not know the modulus of the other."""
    sways = []
    for stiff in ("1e3", "1e6"):
        log = run_interpreted(BESIDE, "-var", "stiff", stiff, folder=stiff).log
        sways.append(log["xa"][-1] - log["xa"][0])
    assert sways[0] > 1e-3 and sways[1] == pytest.approx(sways[0], rel=1e-9)


TOOL = """
    method(ulmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 4, 0, 2, 0.25)
    region(b, block, 0.5, 1, 0.5, 1)
    material(m, rigid, 1000)
    solid(s, region, b, 2, m, 0.25, 0)
    group(g, particles, region, b, solid, s)
    fix(v, velocity_particles, g, 0.5, 0)
    set_output(1)
    xg = xcm(g, x)
    log_modify(custom, step, parts, xg)
    run(2)
"""


def test_rigid_solids_alone_move(run_interpreted):
    """There is nothing to balance then, and nothing in the way of two cells."""
    log = run_interpreted(TOOL).log
    assert log["xg"][-1] == pytest.approx(1.75) and log["parts"][-1] == 1


def test_multigrid_that_fails_is_no_singular_matrix(monkeypatch, recwarn):
    """It says so; `auto` takes the direct solver then, as it does where pyamg is missing."""
    rng = np.random.default_rng(0)
    A = sp.csr_matrix(rng.standard_normal((60, 60)) + np.diag(rng.choice([-3.0, 3.0], 60)))
    A, rigid, b = (A + A.T).tocsr(), np.ones((60, 3)), np.ones(60)
    with pytest.raises(solvers.Unconverged):
        solvers.amg(A, b, rigid, 1e-10, {})
    assert not recwarn.list
    with pytest.raises(solvers.Unconverged), np.errstate(all="ignore"):
        solvers.amg(A * np.inf, b, rigid, 1e-10, {})
    monkeypatch.setattr(solvers, "AMG_FROM", 10)
    assert np.allclose(A @ solvers.solve("auto", A, b, rigid, 1e-10, {}), b)
    monkeypatch.setattr(solvers, "find_spec", lambda name: None)
    monkeypatch.setattr(solvers, "amg", None)
    assert np.allclose(A @ solvers.solve("auto", A, b, rigid, 1e-10, {}), b)


def test_pyamg_is_missed_before_the_run(run_script, monkeypatch):
    found = check.importlib.util.find_spec
    monkeypatch.setattr(
        check.importlib.util, "find_spec", lambda name: found(name) if name != "pyamg" else None
    )
    text = patch().replace("quasi-static)", "quasi-static, solver=amg)")
    result = run_script(text, status=1)
    assert "needs PyAMG" in result.err and "solver=amg)" in result.err


@pytest.mark.parametrize(("h", "told"), [(-1.5, "turns inside out"), (0.5, "no finite stress")])
def test_points_that_go_wrong_are_told_apart(h, told):
    """A law without a number is not a point that is turned inside out."""
    t = len(PlaneStrain().tensor_names)
    increment, stress = np.zeros((t, 3)), np.zeros((t, 3))
    increment[0, 1], stress[0, 1] = h, np.nan
    block = SimpleNamespace(points=SimpleNamespace(id=np.array([7, 8, 9])))
    response = SimpleNamespace(increment=increment, stress=stress)
    equations = SimpleNamespace(
        s=SimpleNamespace(kin=PlaneStrain()), blocks=[block], parts=[(None, response)]
    )
    reason = Newton._wrong(SimpleNamespace(equations=equations), np.zeros((2, 2)))
    assert told in str(reason) and "point 8" in str(reason) and reason.at == 8


def test_initial_velocities_of_points_are_told():
    """Load steps would drop them in silence; rigid solids may have some."""
    points = SimpleNamespace(v=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), id=np.array([0, 1, 2]))
    control = SimpleNamespace(firsts=np.array([0, 2]), values=np.zeros(50))
    setup = SimpleNamespace(blocks=[SimpleNamespace(points=points, laws=())], control=control)
    steps = LoadSteps.__new__(LoadSteps)
    hub = SimpleNamespace(solids={"a": None, "b": None}, mark=None)
    steps.simulation = SimpleNamespace(setup=setup, hub=hub)
    with pytest.raises(ScriptError, match="solid 'b' has initial velocities"):
        steps._check_at_rest()
    points.v[:] = 0
    steps._check_at_rest()


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (HELD.replace("1e-4", "1e-4*sqrt(1.5-time)"),
         "fix pull gets NaN from 0.0001*sqrt(1.5 - time)"),
        (HELD + "\n    fix(w, body_force, all, 1/(2-time), 0)", "fix w gets inf"),
    ],
)  # fmt: skip
def test_a_formula_that_gives_no_number_is_named(run_interpreted, lines, said):
    """As explicit steps do, with the line of the fix."""
    result = run_interpreted(coarse(lines), status=1)
    assert said in result.err and "step 2, time 2" in result.err


def test_a_failed_load_step_is_told_what_may_change(run_interpreted):
    text = coarse().replace("1e-4", "0.05")
    result = run_interpreted(text.replace("quasi-static", "quasi-static, iterations=1"), status=1)
    assert "or another tolerance, iterations or solver" in result.err
    assert "dt_factor" not in result.err


def test_a_share_of_a_step_that_has_no_limit(run_interpreted):
    """Warned of at its line, where set_dt does not say so already."""
    result = run_interpreted(coarse().replace("run(4)", "dt_factor(0.5)\n    run(1)"))
    assert result.err.count("warning:") == 1 and "dt_factor has no effect: set_dt" in result.err


def test_a_load_that_is_full_in_the_first_step(run_interpreted):
    """Load steps are 1 without set_dt, which would spread the load."""
    load = "fix(b, body_force, all, 0, -1e-6*min(time, 1))\n    run(4)"
    text = coarse().replace("run(4)", load)
    result = run_interpreted(text)
    assert "load steps of 1, as the script has no set_dt: '-1e-06*min(time, 1)' has" in result.err
    assert "fix: set_dt(0.25)" in result.err
    spread = text.replace("run(4)", "set_dt(0.25)\n    run(4)")
    assert run_interpreted(spread, folder="spread").err == ""


def test_explicit_steps_have_no_iterations(run_interpreted):
    """Columns of load steps are 0 in steps of another scheme."""
    then = "run(1)\n    scheme(musl)\n    set_dt(1e-5)\n    run(1)"
    log_of = run_interpreted(coarse().replace("run(4)", then)).log
    for name in ("iterations", "parts", "residual"):
        assert log_of[name][1] > 0 and log_of[name][-1] == 0


def test_a_scheme_that_no_run_has(run_interpreted):
    once = coarse().replace("run(4)", "run(1)")
    twice = once.replace("scheme(quasi-static)", "scheme(musl)\n    scheme(quasi-static)")
    assert "replaces the one in line 7" in run_interpreted(twice).err
    then = once.replace("run(1)", "run(1)\n    scheme(quasi-static)\n    run(1)")
    assert "replaces the one" not in run_interpreted(then).err


def test_columns_of_load_steps_in_explicit_ones(run_interpreted):
    result = run_interpreted(patch().replace("    scheme(quasi-static)\n", ""), status=1)
    assert "a value of scheme quasi-static" in result.err


@pytest.mark.parametrize("scheme", ["quasi-static", "newmark"])
def test_a_tolerance_that_is_none(run_interpreted, scheme):
    text = patch().replace("quasi-static", f"{scheme}, tolerance=0.1")
    assert "from 1e-14 to 0.01, not 0.1" in run_interpreted(text, status=1).err


@pytest.mark.parametrize(
    ("word", "instead", "told"),
    [
        ("1000, 0.25", "1000, 0.49", True),
        ("1000, 0.25", "1000, 0.48", False),
        ("1000, 0.25", "1000, 0.49)\n    anti_volumetric_locking(true", False),
    ],
)
def test_linear_functions_that_lock_are_told(run_interpreted, word, instead, told):
    """Before the run, with the cure, in explicit steps too."""
    for scheme in ("quasi-static", "musl"):
        text = patch().replace(word, instead).replace("scheme(quasi-static)", f"scheme({scheme})")
        text = text.replace("iterations, residual, parts, ", "")
        said = run_interpreted(text, command="check", folder=scheme).err
        assert ("warning: locking: Poisson's ratio" in said) == told, said


PLASTIC = """eos(e, linear, 1, 1000)
    strength(y, plastic, 400, 100)
    material(m, eos-strength, e, y)"""


@pytest.mark.parametrize(
    ("basis", "told"), [("linear", True), ("ugimp", True), ("quadratic-spline", False)]
)
def test_plastic_flow_that_locks_is_told(run_interpreted, basis, told):
    text = patch().replace("material(m, linear, 1, 1000, 0.25)", PLASTIC)
    said = run_interpreted(text, "-var", "basis", basis, command="check").err
    assert ("locking: material 'm' flows at constant volume" in said) == told


RIGID = (
    HELD
    + """
    material(r, rigid, 1)
    solid(t, region, box, 2, r, 0.1, 0)
    group(t, particles, region, box, solid, t)
    group(both, particles, region, box, all)"""
)


def test_forces_on_rigid_solids_are_told(run_interpreted):
    said = run_interpreted(patch(RIGID + "\n    fix(f, force_particles, t, 0, -1)"), status=1).err
    assert "forces do not move it" in said and "fix velocity_particles moves" in said
    text = patch(RIGID + "\n    fix(f, force_particles, both, 0, 1)")
    assert "its part of the force has no effect" in run_interpreted(text, command="check").err


def test_a_point_that_leaves_is_told_of_load_steps(run_script):
    """The domain comes first; no word about a stable step, which load steps do not have."""
    text = patch(HELD.replace("1e-4", "0.1")).replace("run(4)", "run(8)")
    said = run_script(text, status=1).err
    assert "leaves the domain" in said and "smaller load steps" in said and "dt_factor" not in said


def test_a_transfer_without_a_part_is_told_first(run_interpreted):
    text = patch().replace("FLIP, basis, 1, domains", "APIC, basis")
    said = run_interpreted(text, status=1).err
    assert "quasi-static does not support transfer APIC" in said and "unstable" not in said


EULER = """
    method(tlmpm, FLIP, quadratic-spline, 1)
    scheme(quasi-static, stabilisation=0)
    dimension(2, -1, 1, 0, 9, 0.5)
    region(box, block, -0.5, 0.5, 0, 8)
    material(m, linear, 1, 1e6, 0)
    solid(s, region, box, 2, m, 0.5, 0)
    region(base, block, -INF, INF, -INF, 1e-6)
    region(top, block, -INF, INF, 7.75, INF)
    group(base, nodes, region, base, all)
    group(top, particles, region, top, solid, s)
    fix(hold, velocity_nodes, base, 0, 0)
    fix(press, force_particles, top, 0, -(0.85 + 0.1*time)*PI^2*1e6/12/(4*8^2))
    set_output(1)
    log_modify(custom, step, hold_y)
    run(2)
"""


def test_a_column_that_could_buckle_is_told(run_script):
    """Beyond pi^2 E I/(4 L^2) (Euler 1744), where the straight column is no stable equilibrium."""
    said = run_script(EULER).err
    assert said.count("the equilibrium is unstable") == 1 and "step 2, time 2" in said


@pytest.mark.parametrize(
    ("load", "run", "told"),
    [("-1", 3, True), ("-1", 1, False), ("-time/3", 3, False), ("0", 3, False)],
)
def test_loads_that_do_not_grow_are_told(run_interpreted, load, run, told):
    """They act in the first load step; the others change nothing."""
    lines = f"fix(hold, velocity_nodes, left, 0, 0)\n    fix(pull, body_force, all, 0, {load})"
    said = run_interpreted(patch(lines).replace("run(4)", f"run({run})"), command="check").err
    assert ("'pull' does not depend on time" in said) == told, said
