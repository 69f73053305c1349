"""What load steps say of scenes and steps that go wrong, and how they end."""

import pytest

from karamelo_py.run.implicit.newton import Newton
from tests.test_implicit import HELD, patch

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
    assert "bears no shear" in result.err and "solid(s" in result.err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("fix(v, initial_velocity_particles, all, 1, 0)", "has no inertia: the velocities of fix"),
        ("fix(v, velocity_particles, all, 1, 0)", "at a moment that only explicit steps have"),
    ],
)
def test_a_fix_of_explicit_steps_is_refused(run_interpreted, line, says):
    result = run_interpreted(patch(f"{HELD}\n    {line}"), status=1)
    assert says in result.err and line in result.err


def test_solids_with_grids_of_their_own_are_told_of_contact_in_load_steps(run_interpreted):
    second = HELD + "\n    solid(t, region, box, 2, m, 0.1, 0)"
    said = run_interpreted(patch(second), "-var", "kind", "tlmpm").err
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
    result = run_script(BEYOND.replace("pull_x", "hold_x"), status=1)
    assert "The last good state is in" in result.err and "1/1024 of the load step" in result.err
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
    assert "nothing holds solid 'loose'" in result.err


def test_a_step_can_be_left(run_script, monkeypatch):
    """Ctrl-C amid the third step: the run ends behind the second, with its state."""
    correction = Newton._correction
    steps = []

    def interrupting(self, *arguments):
        steps.append(self)
        hub = self.hub_of_test
        if hub.values.get("timestep") == 2:
            hub.running.signal = 2
        return correction(self, *arguments)

    from karamelo_py.run.implicit.load_steps import LoadSteps

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
