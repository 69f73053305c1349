"""The rest of a script is tried before the first run: nothing of the scene may change by that."""

from pathlib import Path

import numpy as np
import pytest

from karamelo_py.advice import known_failures
from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.loop import RunLoop
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Quit, ScriptError

BARE = """
material(rubber, neo-hookean, 1000, 1e6, 0.3)
load_path(pull, 2, exx=0.1)
"""
SCENE = (
    """
method(ulmpm/contacts, FLIP, linear, 1)
create_domain(0, 8, 0, 4, 0.5)
region(low, block, 0.5, 1.5, 0.5, 1.5)
region(high, block, 0.5, 1.5, 2, 3)
region(hole, block, 0.5, 1, 0.5, 1)
region(every, block, INF, INF, INF, INF)
"""
    + BARE
    + """
solid(a, region, low, 2, rubber, 0.5)
solid(b, region, high, 2, rubber, 0.5)
group(left, nodes, region, hole, all)
group(top, particles, region, high, all)
fix(g, body_force, all, 0, -1)
compute(E, kinetic_energy, all)
dump(d, all, particle, 5, d.*.txt, x)
plot(curve, 1, time, E)
"""
)
# Of each command a call, and what comes before it: that which `element` or `run` rehearses.
CALLS = {
    "anti_volumetric_locking": (SCENE, "anti_volumetric_locking(true)"),
    "plane_stress": (BARE, "create_domain(0, 1, 0, 1)\nplane_stress(false)"),
    "plane_strain": (BARE, "create_domain(0, 1, 0, 1)\nplane_strain(ezz=0)"),
    "uniaxial_stress": (BARE, "dimension(1, 0, 1, 0.1)\nuniaxial_stress(false)"),
    "axisymmetric": (BARE, "create_domain(0, 1, 0, 1)\naxisymmetric(true)"),
    "pore_water": (SCENE, "material(w, linear, 1, 10, 0)\npore_water(w, n=0.4, permeability=1)"),
    "cylindrical": (BARE, "dimension(1, 0, 1, 0.1)\ncylindrical(true)"),
    "spherical": (BARE, "dimension(1, 0, 1, 0.1)\nspherical(true)"),
    "boundary": (SCENE, "boundary(delete)"),
    "compute": (SCENE, "compute(Es, strain_energy, all)"),
    "create_domain": (BARE, "create_domain(0, 1, 0, 1)"),
    "damage": (BARE, "damage(d, damage_johnson_cook, 0.05, 0.8, -1.5, 0, 0, 1, 300, 1300)"),
    "delete_compute": (SCENE, "delete_compute(E)"),
    "delete_dump": (SCENE, "delete_dump(d)"),
    "delete_fix": (SCENE, "delete_fix(g)"),
    "activate": (SCENE + "deactivate(top)", "activate(top)"),
    "deactivate": (SCENE, "deactivate(top)"),
    "delete_particles": (
        SCENE.replace("group(top, particles, region, high, all)", ""),
        "delete_particles(all, region, hole)",
    ),
    "dimension": (BARE, "dimension(2, 0, 1, 0, 1, 0.1)"),
    "dt_factor": (SCENE, "dt_factor(0.5)"),
    "dump": (SCENE, "dump(e, all, particle, 5, e.*.txt, x)"),
    "element": (SCENE, "element(other, rubber, pull)"),
    "eos": (BARE, "eos(e, linear, 1000, 1e6)"),
    "evaluate": (SCENE, "E0 = evaluate(E)"),
    "external_force": (SCENE, "F = external_force(left, x)"),
    "fix": (SCENE, "fix(hold, velocity_nodes, left, 0, 0)\nfix(g, body_force, all, 0, -2)"),
    "group": (
        SCENE,
        "group(top, particles, region, low, all)\ngroup(left, nodes, region, low, all)",
    ),
    "include": (SCENE, "include(more.in)"),
    "internal_force": (SCENE, "F = internal_force(left, x)"),
    "load_path": (BARE, "load_path(push, 2, exx=-0.1)"),
    "log": (SCENE, "log(7)"),
    "log_modify": (SCENE, "log_modify(custom, step, E)"),
    "material": (BARE, "material(gel, neo-hookean, 1000, 1e3, 0.3)"),
    "method": (BARE, "method(tlmpm, FLIP, linear, 1)"),
    "modify": (SCENE, "modify(material, rubber, E=2e6)"),
    "plot": (SCENE, "plot(other, 1, time, E)"),
    "populate_cylindrical_coordinates": (
        SCENE.replace("group(top, particles, region, high, all)", ""),
        "populate_cylindrical_coordinates(a, every, 1, 1, 0.4, 3, 12, 5)",
    ),
    "precision": (SCENE, "precision(single)"),
    "print": (SCENE, "print(E)"),
    "quit": (SCENE, "quit()"),
    "read_restart": (SCENE, "read_restart(settled.h5)"),
    "region": (SCENE, "region(other, block, 0, 1, 0, 1)"),
    "restart": (SCENE, "restart(5, r.*.h5)"),
    "run": (SCENE, "run(5)\nscheme(usl)\nrun(5)"),
    "run_time": (SCENE, "run_time(1)"),
    "run_until": (SCENE, "run_until(time > 1)"),
    "run_while": (SCENE, "run_while(time < 1)"),
    "save_plot": (SCENE, "save_plot(curve.png)"),
    "scheme": (SCENE, "scheme(usl)"),
    "set_dt": (SCENE, "set_dt(1e-3)"),
    "set_output": (SCENE, "set_output(7, csv)"),
    "solid": (
        "create_domain(0, 8, 0, 4)\nmethod(ulmpm/contacts, FLIP, linear, 1)\n"
        "region(low, block, 0.5, 1.5, 0.5, 1.5)" + BARE,
        "solid(a, region, low, 2, rubber, 0.5)",
    ),
    "strength": (BARE, "strength(s, plastic, 1e6, 1e3)"),
    "temperature": (BARE, "temperature(t, plastic_work, 0.9, 385, 0, 0, 300, 1300)"),
    "translate_particles": (SCENE, "translate_particles(all, region, every, 1, 0)"),
    "units": (SCENE, "units(mm, g, ms)"),
    "value": (SCENE, "E0 = value(E)"),
    "viscosity": (BARE, "viscosity(prony, rubber, g=0.2, tau=0.01)"),
    "write_restart": (SCENE, "write_restart(w.h5)"),
    "xcm": (SCENE, "X = xcm(all, x)"),
}
ONLY_BEFORE_RUNS = {
    *("translate_particles", "populate_cylindrical_coordinates", "precision", "set_output"),
}
# What belongs to the rehearsal, and who tells.
NOT_OF_THE_SCENE = {"rehearsed", "later", "warned", "record", "interpreter", "console"}


def described(thing, seen):
    """All that `thing` is made of, with identities, such that two descriptions can be compared."""
    if isinstance(thing, (str, int, float, bool, type, Path, type(None))):
        return repr(thing)
    if id(thing) in seen:
        return id(thing)
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        return id(thing), thing.tobytes()
    inside = {}
    if isinstance(thing, dict):
        inside |= {repr(key): described(value, seen) for key, value in thing.items()}
    elif isinstance(thing, (list, tuple)):
        inside |= {k: described(value, seen) for k, value in enumerate(thing)}
    for name, value in getattr(thing, "__dict__", {}).items():
        if not (isinstance(thing, Hub) and name in NOT_OF_THE_SCENE):
            inside[name] = described(value, seen)
    return id(thing), type(thing).__name__, inside


def rehearse(begin, before, rest):
    """Let a script come to `begin`; describe the scene before and after the rest is rehearsed."""
    hub = Hub(Console(quiet=True))
    Interpreter(hub)
    found = []

    def look():
        found.append(described(hub, set()))
        try:
            Hub.rehearse(hub)
        finally:
            found.append(described(hub, set()))
            hub.rehearsed = False  # the error is that of the rehearsal
        raise Quit

    hub.rehearse = look
    hub.interpreter.run_text(f"{before}\n{begin}\n{rest}")
    return found


def test_all_commands_are_here():
    assert set(CALLS) == set(registry.names("command"))


def write_files(name):
    """Write the files that commands read."""
    Path("more.in").write_text("fix(more, body_force, all, 0, -1)\n")
    if name == "read_restart":
        Interpreter(Hub(Console(quiet=True))).run_text(f"{SCENE}\nwrite_restart(settled.h5)")


@pytest.mark.parametrize("name", CALLS)
def test_no_command_changes_the_scene_in_a_rehearsal(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_files(name)
    before, call = CALLS[name]
    old, new = rehearse("element(e, rubber, pull)", before, call)
    assert old == new


@pytest.mark.parametrize("name", [name for name in CALLS if CALLS[name][0] is SCENE])
def test_no_command_changes_the_scene_before_a_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_files(name)
    before, call = CALLS[name]
    if name in ONLY_BEFORE_RUNS:
        with pytest.raises(ScriptError, match=r"been in a run|after the first run"):
            rehearse("run(5)", before, call)
        return
    old, new = rehearse("run(5)", before, call)
    assert old == new


BLOCK = (
    SCENE.partition("group(")[0]
    + "compute(c, center_of_mass, all)\nlog_modify(custom, step, c_x)\nset_output(5)\n"
    + "fix(g, body_force, all, 0, -0.01)\n"
)


@pytest.mark.parametrize(
    "rest, centre",
    [
        ("translate_particles(all, region, every, 1, 0)\nrun(5)", [2, 2]),
        ("run(5)\ndelete_particles(a, region, hole)\nrun(5)", [1, 1, 29 / 28]),
        ("delete_particles(a, region, hole)\nrun(5)", [29 / 28, 29 / 28]),
    ],
)
def test_points_move_and_go_once(run_interpreted, rest, centre):
    """The first solid has 16 points around x = 1, 4 of them around 0.75, and so has the second."""
    run = run_interpreted(f"{BLOCK}element(e, rubber, pull)\n{rest}")
    assert run.log["c_x"] == pytest.approx(centre, rel=1e-8)  # of nine digits


def test_mistakes_behind_a_run_are_found_before_it(run_interpreted):
    run = run_interpreted(f"{BLOCK}run(5)\ntranslate_particles(a, region, every, 1, 0)", status=1)
    assert "the points have already been in a run" in run.err
    assert not (run.folder / "log.mpm").exists()


@pytest.mark.parametrize(
    "runs, later",
    [
        ("run(100)", [[]]),
        ("element(e, rubber, pull)\nrun(100)", [[]]),
        ("element(e, rubber, pull)\nrun(100)\nrun(200)", [[200], []]),
        ("scheme(quasi-static)\nrun(1)\nrun(1)\nscheme(musl)\nrun(100)\nrun(200)",
         [[100, 200], [100, 200], [200], []]),
    ],
)  # fmt: skip
def test_advice_knows_the_runs_behind_each(runs, later, tmp_path, monkeypatch):
    """How many steps the explicit runs behind each have: advice counts them as time to come."""
    monkeypatch.chdir(tmp_path)
    hub, found = Hub(Console(quiet=True)), []

    def note(run):
        found.append([step.span[1] for step in known_failures.later_steps(hub)])
        hub.runs.append({})

    monkeypatch.setattr(RunLoop, "run", note)
    Interpreter(hub).run_text(BLOCK + runs)
    assert found == later
