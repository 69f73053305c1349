"""The example plug-in, a style of each family: installed somewhere else, found, and right."""

import ast
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from math import exp

import numpy as np
import pytest
from conftest import interpreting
from going_on import goes_on, same_files
from plugged import PLUGIN, install, offer
from scenes import block
from selection import few

pytestmark = [pytest.mark.xdist_group("plugin"), pytest.mark.usefixtures("starts_are_cheap")]
PYTHON = sys.executable  # before it is a fork

# A quarter of a period of the first mode of a bar with fixed ends.
VIBRATION = """
L = 10
E = 100
rho = 4
c = sqrt(E/rho)
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, L, 0.5)
region(bar, block, 0, L)
material(m, {law})
solid(bar, region, bar, 2, m, 0.5)
region(left, block, -INF, 0)
region(right, block, L, INF)
group(left, nodes, region, left, all)
group(right, nodes, region, right, all)
fix(left, velocity_nodes, left, 0)
fix(right, velocity_nodes, right, 0)
fix(mode, initial_velocity_particles, all, 0.001*c*sin(PI*x0/L))
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, time, Ek, Es)
set_dt(0.04)
set_output(5)
run_time(0.5*L/c)
"""

# What the example script leaves out: the fix whose hook is compiled.
DAMP = """
fix(settle, damp_nodes, all, 0.25 + 0*time)
log_modify(custom, step, time, p_x, settle_x)
"""


def require_build_tools():
    """Skip where a package cannot be built without a network."""
    for package, least in (("pip", 0), ("setuptools", 77)):
        try:
            found = version(package)
        except PackageNotFoundError:
            pytest.skip(f"{package} is not installed")
        if int(found.partition(".")[0]) < least:
            pytest.skip(f"{package} {found} is too old to build the plug-in")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder of packages with the plug-in."""
    return install(tmp_path_factory.mktemp("plugin") / "site")


@pytest.fixture(scope="module")
def _interpreter(site):
    with interpreting(site) as process:
        yield process


def karamelo_py(site, folder, *arguments, compiling=""):
    """Run the command line where it sees the plug-in, with a Python that compiles or not."""
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": path}
    environment["NUMBA_DISABLE_JIT"] = "0" if compiling else "1"
    command = [compiling or sys.executable, "-m", "karamelo_py.app.cli", *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


def read_log(folder):
    rows = np.loadtxt(folder / "log.mpm", skiprows=1)
    return rows.T


def test_pip_installs_it_and_styles_and_help_tell_of_it(tmp_path):
    require_build_tools()
    source = shutil.copytree(PLUGIN, tmp_path / "source")  # building leaves files behind
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    command = [PYTHON, "-m", "pip", "install", "-q", *options]
    command += ["--target", str(tmp_path / "site"), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    done = karamelo_py(tmp_path / "site", tmp_path, "styles")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "mpm-examples 0.1.0" in line]
    listed = {line.split()[0]: line for line in lines}
    page = (PLUGIN / "README.md").read_text("utf-8")
    assert len(listed) == 22
    assert all(name in page for name in listed)
    assert "Slow points down" in listed["drag"]
    done = karamelo_py(tmp_path / "site", tmp_path, "help", "drag")
    assert done.returncode == 0, done.stderr
    assert "fix(ID, drag, group, rate)" in done.stdout
    assert "from mpm-examples 0.1.0" in done.stdout
    assert "a number of at least 0" in done.stdout


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf"])
def test_free_flight_under_drag_decays_exponentially(run_interpreted, scheme):
    # Exact: p = m v0 exp(-rate t).
    script = (PLUGIN / "in.drag").read_text()
    done = run_interpreted(script.replace("dimension(", f"scheme({scheme})\ndimension("))
    step, time, p, lost = read_log(done.folder)
    assert step[-1] == 100
    mass, v0, rate, dt = 3.0, 2.0, 0.5, 0.01
    np.testing.assert_allclose(p, mass * v0 * np.exp(-rate * time), rtol=1e-9)
    np.testing.assert_allclose(lost[1:], p[1:] * (exp(rate * dt) - 1), rtol=1e-7)


def test_both_kinds_of_hook_act_in_one_run(run_interpreted):
    # Exact: each step multiplies the velocity by exp(-rate dt) and by 1 - c dt.
    done = run_interpreted((PLUGIN / "in.drag").read_text().replace("run(", DAMP + "run("))
    step, time, p, force = read_log(done.folder)
    np.testing.assert_allclose(p, 6 * np.exp(-0.5 * time) * (1 - 0.25 * 0.01) ** step, rtol=1e-9)
    np.testing.assert_allclose(force[1:], -0.25 * p[1:] / (1 - 0.0025), rtol=1e-7)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("fix(air, drag, all, -1)", "argument 2 'rate' must be a number of at least 0"),
        ("fix(air, drag, all)", "fix(ID, drag, group, rate)"),
        ("fix(air, dragg, all, 1)", "did you mean 'drag'?"),
    ],
)
def test_mistakes_in_its_arguments_are_marked(run_interpreted, line, message):
    script = (PLUGIN / "in.drag").read_text().replace("fix(air, drag, all, rate)", line)
    done = run_interpreted(script, status=1)
    assert message in done.err
    assert "in.script:11:" in done.err


def test_the_material_is_a_linear_one_at_small_strain(run_interpreted):
    # In one dimension both laws are sigma = E du/dx; the exact period is 2 L / c = 4.
    logs = []
    for number, law in enumerate(("elastic-fluid, rho, E", "linear, rho, E, 0")):
        done = run_interpreted(VIBRATION.replace("{law}", law), folder=str(number))
        logs.append(read_log(done.folder))
    (time, kinetic, stored), (_, reference, stored_reference) = logs
    start = kinetic[0]
    np.testing.assert_allclose(kinetic, reference, atol=0.002 * start)
    np.testing.assert_allclose(stored, stored_reference, atol=0.002 * start)
    np.testing.assert_allclose(kinetic, start * np.cos(np.pi * time / 2) ** 2, atol=0.05 * start)


# A bar that is pulled at a constant rate, in uniaxial strain. The two fixes that hold it back do
# nothing to that, as the velocity of all nodes is given, but both are at work.
PULL = """
rate = 10
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 4, 0.5)
region(bar, block, 1, 3)
eos(bulk, linear, 1000, 5e7)
strength(hot, recovering, 25e6, 20e3, 1e6, {recovery})
material(m, eos-strength, bulk, hot)
solid(bar, region, bar, 1, m, 0.5)
region(everywhere, block, -INF, INF)
group(nodes, nodes, region, everywhere, all)
fix(pull, velocity_nodes, nodes, rate*x)
fix(start, initial_velocity_particles, all, rate*x0)
set_dt(2e-5)
fix(air, drag, all, 0.5)
fix(settle, damp_nodes, all, 0.25 + 0*time)
compute(p, momentum, all)
compute(hard, probe, all, R)
log_modify(custom, step, hard, p_x, air_x, settle_x)
dump(points, all, particle, 100, points.*.LAMMPS, ep, R, seq)
run(100)
"""
PICTURE = "dump(picture, all, pyplot, 100, picture.*.png, 200, 200, R)\n"


@pytest.mark.parametrize("compiled", few((False, True), True))
def test_a_strength_shows_its_own_number(site, compiling, tmp_path, compiled):
    recovery = 4e3
    script = PULL.replace("{recovery}", str(recovery)).replace("run(", PICTURE + "run(")
    (tmp_path / "in.pull").write_text(script)
    done = karamelo_py(site, tmp_path, "in.pull", compiling=compiling * compiled)
    assert done.returncode == 0, done.stderr
    rows = np.loadtxt(tmp_path / "points.100.LAMMPS", skiprows=11)
    ep, R, q = rows[:, -3:].T
    # Exact for steady flow, whose strain rate is 2/3 of the stretching: R = H (dep/dt) / rate.
    np.testing.assert_allclose(R, 1e6 * (2 / 3 * 10) / recovery, rtol=2e-3)
    np.testing.assert_allclose(q, 20e3 + R, rtol=1e-6)
    _, hard, p, lost, force = read_log(tmp_path)
    np.testing.assert_allclose(hard[-1], R, rtol=1e-8)  # all points are alike
    # The nodes have the momentum that the Python hook left in this step.
    np.testing.assert_allclose(force[1:], -0.25 * (p[:-1] - lost[1:]), rtol=1e-7)
    assert (tmp_path / "picture.100.png").stat().st_size > 1000
    assert (ep > 0.01).all()


def lines_of_code(path):
    """Lines of a file that are neither empty, comments, nor part of a docstring."""
    text = path.read_text("utf-8")
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef)
    told = [n.body[0] for n in ast.walk(ast.parse(text)) if isinstance(n, owners)]
    told = [n for n in told if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)]
    shown = {k for n in told for k in range(n.lineno, n.end_lineno + 1)}
    empty = {k for k, line in enumerate(text.splitlines(), 1) if re.fullmatch(r" *(#.*)?", line)}
    return len(text.splitlines()) - len(shown | empty)


def test_the_message_of_the_page(tmp_path):
    """A slip in drag.py is told as the page says."""
    page = (PLUGIN.parents[1] / "docs" / "plugins.md").read_text("utf-8")
    (message,) = re.findall(r"^in\.drag.*error: fix drag.*$", page, re.M)
    file = install(tmp_path / "site") / "mpm_examples" / "drag.py"
    file.write_text(file.read_text("utf-8").replace("exp(-self", "exq(-self"), "utf-8")
    shutil.copy(PLUGIN / "in.drag", tmp_path)
    done = karamelo_py(tmp_path / "site", tmp_path, "in.drag")
    assert done.returncode == 1
    assert done.stderr.splitlines()[0] == message


@pytest.mark.parametrize("whole", [True, False])
def test_no_total_of_points_that_come_in_pieces(tmp_path, whole):
    """Before the first step, where a fix says that it looks at each point on its own."""
    file = install(tmp_path / "site") / "mpm_examples" / "drag.py"
    text = file.read_text("utf-8").replace("points.mass @ lost", "points.total(points.velocity)")
    said = f"first_step_only = True\n    point_by_point = {not whole}\n    published ="
    file.write_text(text.replace("published =", said), "utf-8")
    shutil.copy(PLUGIN / "in.drag", tmp_path)
    done = karamelo_py(tmp_path / "site", tmp_path, "in.drag")
    assert done.returncode == (not whole), done.stderr
    assert ("points.total(terms) is known only in steps" in done.stderr) == (not whole)


# --- compiled hooks of whole points ---------------------------------------------------------------

# A body that is as soft as air flies through it.
AIR = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -10, 30, -10, 30, 1)
region(b, block, 0, 2, 0, 2)
material(m, linear, 1, 100, 0.3)
solid(s, region, b, 1, m, 1)
fix(v, initial_velocity_particles, all, 3, 4)
fix(wind, air_drag, all, 0.1)
compute(p, linear_momentum, all)
log_modify(custom, step, time, p_x, p_y, wind_x, wind_y)
set_dt(0.002)
set_output(50)
run({steps})
"""


@pytest.mark.parametrize("style", few(("air_drag", "node_drag"), "air_drag"))
def test_a_force_by_the_whole_velocity(run_interpreted, style):
    """dv/dt = -c |v| v: v = v0/(1 + c |v0| t), of first order in dt."""
    done = run_interpreted(AIR.format(steps=50).replace("air_drag", style))
    _, time, *p, fx, fy = read_log(done.folder)
    assert "energy" in done.out + done.err  # the work of the force is added up
    slower = 1 / (1 + 0.1 * 5 * time)
    np.testing.assert_allclose(p, 4 * np.outer([3, 4], slower), rtol=1e-3)
    np.testing.assert_allclose(np.hypot(fx, fy)[1:], (4 * 0.1 * 25 * slower**2)[1:], rtol=3e-3)


def test_compiled_hooks_do_what_interpreted_ones_do(site, compiling, tmp_path, run_interpreted):
    """On two threads, of points and of nodes."""
    lines = "fix(wind, air_drag, all, 0.1)\nfix(reeds, node_drag, all, 0.2)"
    scene = AIR.format(steps=20).replace("fix(wind, air_drag, all, 0.1)", lines)
    scene = scene.replace("set_output(50)", "set_output(10)").replace("p_y,", "p_y, reeds_x,")
    (tmp_path / "in.air").write_text(scene)
    done = karamelo_py(site, tmp_path, "in.air", "--threads", "2", compiling=compiling)
    assert done.returncode == 0, done.stderr
    found = read_log(tmp_path)[:4]
    assert found[2][-1] < 0.99 * found[2][0]
    np.testing.assert_array_equal(found, read_log(run_interpreted(scene).folder)[:4])


# Hooks that publish more numbers than there are directions, under names that a test gives.
MANY = """
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.modify import Fix, vector_hook


def of_point(mass, velocity, values, dt):
    return velocity, (mass, 2 * mass, 3 * mass, 4 * mass)


def of_node(mass, force, values, dt):
    return force, (mass, 2 * mass, 3 * mass, 4 * mass)


class OfPoints(Fix):
    published = {names}
    final_integrate = vector_hook(
        of_point, reads=("mass", "velocity"), writes=("velocity",), publishes=True
    )

    def __init__(self, hub, group: ParticleGroup):
        super().__init__(hub, group)


class OfNodes(Fix):
    published = {names}
    post_particles_to_grid = vector_hook(
        of_node, reads=("mass", "force"), writes=("force",), publishes=True, nodes=True
    )

    def __init__(self, hub, group: NodeGroup):
        super().__init__(hub, group)


class Others(OfNodes):
    published = ("d", "c", "b", "a")
"""
PUBLISHING = """
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 1, 0, 1, 0.2)
region(box, block, 0.2, 0.8, 0.2, 0.8)
material(rubber, linear, 1000, 1000, 0.3)
solid(body, region, box, 2, rubber, 0.2, 0)
fix(p, many/points, all)
fix(n, many/nodes, all)
log_modify(custom, step, p_a, p_b, p_c, p_d, n_a, n_b, n_c, n_d)
run(2)
"""


def many(folder, names):
    """A folder of packages with the styles above."""
    (folder / "many_totals.py").write_text(MANY.replace("{names}", repr(names)))
    classes = {"many/points": "OfPoints", "many/nodes": "OfNodes", "many/others": "Others"}
    styles = {style: f"many_totals:{name}" for style, name in classes.items()}
    return offer(folder, "many-totals", "1", {"karamelo_py.fix": styles})


@pytest.mark.parametrize(
    "how, compiled", [((), False), (("--threads", "2"), True), (("--gpu",), False)]
)
def test_hooks_publish_any_number_of_totals(compiling, tmp_path, how, compiled):
    """Once, twice, three and four times the mass, of 360 kg; in several threads and on a card."""
    site = many(tmp_path, ("a", "b", "c", "d"))
    (tmp_path / "in.many").write_text(PUBLISHING)
    done = karamelo_py(site, tmp_path, "in.many", *how, compiling=compiling * compiled)
    assert done.returncode == 0, done.stderr
    expected = 360 * np.array([1, 2, 3, 4, 1, 2, 3, 4])
    np.testing.assert_allclose(read_log(tmp_path)[1:, -1], expected, rtol=1e-8)


def test_another_fix_of_the_same_name_publishes_in_its_own_order(tmp_path):
    site = many(tmp_path, ("a", "b", "c", "d"))
    lines = "fix(n, many/others, all)\nrun(1)"
    (tmp_path / "in.many").write_text(PUBLISHING.replace("run(2)", f"run(1)\n{lines}"))
    done = karamelo_py(site, tmp_path, "in.many")
    assert done.returncode == 0, done.stderr
    expected = 360 * np.array([4, 3, 2, 1])
    np.testing.assert_allclose(read_log(tmp_path)[5:, -1], expected, rtol=1e-8)


def test_totals_whose_names_do_not_lie_in_a_row_are_refused(tmp_path):
    site = many(tmp_path, ("x", "a", "b", "c"))
    (tmp_path / "in.many").write_text(PUBLISHING)
    done = karamelo_py(site, tmp_path, "in.many")
    assert done.returncode == 1
    assert "published = ('x', 'a', 'b', 'c') has to be a part of x, y, z, s" in done.stderr


# Schemes with rows of a kind that is new: nodes lose half of v*.
BRAKES = """
from typing import NamedTuple

from karamelo_py.compiler.gpu import Card
from karamelo_py.kernels import gpu
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.sweep import sweep_nodes
from karamelo_py.kernels.table import NodeTask, Processor, take
from karamelo_py.schemes.usl import USL


@node_task
class Halve(NamedTuple):
    goes_through = ("update", "update")

    def at_node(task, kin, nodes, n, dt):
        for k in range(kin.dimension):
            nodes.update[n, k] *= 0.5


class Brake(NamedTuple): ...


class OnProcessors(NamedTuple): ...


@take.on(OnProcessors, Processor)
@take.on(Brake, Processor)
def _brake(row, s, step):
    sweep_nodes(step.mode, Halve(), s, kick(s))


@take.on(Brake, Card)
def _brake_on_card(row, steps):
    yield steps.launch(gpu.of_nodes(NodeTask(Halve())), steps.nodes, steps.s, steps.use)


def rows_with(brake):
    k = next(k for k, row in enumerate(USL.rows) if type(row) is NodeTask and callable(row.task))
    return (*USL.rows[:k], brake, *USL.rows[k:])


class Braked(NamedTuple):
    traits = USL.traits
    rows = rows_with(Brake())


class Half(NamedTuple):
    traits = USL.traits
    rows = rows_with(OnProcessors())
"""
STOPPING = """
method(ulmpm, PIC, linear)
scheme({scheme})
dimension(2, 0, 1, 0, 1, 0.25)
region(box, block, 0.25, 0.5, 0.25, 0.5)
material(m, linear, 1, 1e-6, 0)
solid(body, region, box, 2, m, 0.25)
fix(v, initial_velocity_particles, all, 1e-3, 0)
compute(Ek, kinetic_energy, all)
log_modify(custom, step, Ek)
set_dt(1)
run(2)
"""


def test_a_row_of_a_plug_in_is_taken_on_both_back_ends_or_refused(tmp_path):
    """Half of the velocity is left after each step; a card without a way to take a row says so."""
    (tmp_path / "mpm_brakes.py").write_text(BRAKES)
    styles = {"braked": "mpm_brakes:Braked", "half": "mpm_brakes:Half"}
    site = offer(tmp_path, "mpm-brakes", "1", {"karamelo_py.scheme": styles})
    for scheme, how in (("braked", ()), ("braked", ("--gpu",)), ("half", ())):
        (tmp_path / "in.brakes").write_text(STOPPING.format(scheme=scheme))
        done = karamelo_py(site, tmp_path, "in.brakes", *how)
        assert done.returncode == 0, done.stderr
        assert read_log(tmp_path)[1] == pytest.approx(0.03125e-6 * np.array([1, 1 / 4, 1 / 16]))
    done = karamelo_py(site, tmp_path, "in.brakes", "--gpu")
    assert done.returncode == 1
    assert "a GPU does not support the row OnProcessors of scheme half" in done.stderr
    assert "scheme(half)" in done.stderr


# Dust that feels no stress is blown up by its charge.
DUST = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -10, 10, -10, 10, 1)
region(b, block, 1, 2, 1, 2)
material(m, linear, 1, 1e-6, 0)
solid(s, region, b, 1, m, 1)
fix(dust, charged, all, {k}, {leak})
compute(c, probe, all, charge)
compute(x, center_of_mass, all)
log_modify(custom, step, time, c, x_x, x_y)
set_dt(0.004)
set_output(25)
run(100)
"""


def test_a_force_by_a_field_of_the_points_own(run_interpreted):
    """x'' = k q x: x0 cosh(sqrt(k) t) at constant charge; a charge that leaks falls as exp(-t)."""
    _, time, charge, x, y = read_log(run_interpreted(DUST.format(k=1, leak=0)).folder)
    assert (charge == 1).all()
    np.testing.assert_allclose(x, 1.5 * np.cosh(time), rtol=1e-3)
    np.testing.assert_array_equal(x, y)
    _, time, charge, x, _ = read_log(run_interpreted(DUST.format(k=0, leak=1)).folder)
    np.testing.assert_allclose(charge, np.exp(-time), rtol=1e-3)
    assert (x == 1.5).all()


# Shear far beyond the yield stress; heat stays where it is made.
SHEARED = """
method(ulmpm, FLIP, linear, 1, thermo-mechanical)
dimension(2, -1, 1, -1, 1, 0.5)
region(b, block, -0.5, 0.5, -0.5, 0.5)
eos(bulk, linear, 1, 160)
strength(y, plastic, 80, 0.4)
temperature(warm, plastic_work, {by_law}, 0.005, 0, 0, 300, 1300)
material(m, eos-strength, bulk, y, warm)
solid(s, region, b, 1, m, 0.5, 300)
fix(v, initial_velocity_particles, all, 0.3*y, 0.3*x)
fix(lead, velocity_particles, all, 0.3*y, 0.3*x)
fix(heat, plastic_heat, all, {by_fix})
compute(T, average_temperature, all)
log_modify(custom, step, time, T, heat_s)
set_dt(0.005)
set_output(1)
run(20)
"""


def test_heat_by_stress_and_plastic_strain(run_interpreted):
    """The heat of plastic work that the law makes itself, a step later, for the fix comes first."""
    own = read_log(run_interpreted(SHEARED.format(by_law=0.9, by_fix=0)).folder)[2]
    _, _, T, heat = read_log(run_interpreted(SHEARED.format(by_law=0, by_fix=0.9)).folder)
    assert T[-1] > 301
    np.testing.assert_allclose(T[1:], own[:-1], atol=2e-4)
    np.testing.assert_allclose(np.diff(T)[1:], 0.005 * heat[2:] / 0.005, rtol=1e-6, atol=1e-6)


def test_the_page_tells_what_each_costs():
    page = (PLUGIN.parents[1] / "docs" / "plugins.md").read_text("utf-8")
    told = dict(re.findall(r"^\| .* \| `(\w+\.py)` \| (\d+) \|$", page, re.M))
    files = (PLUGIN / "src" / "mpm_examples").glob("[!_]*.py")
    assert told == {file.name: str(lines_of_code(file)) for file in files}


# --- a field of a fix ---------------------------------------------------------------------------

# Points that fly freely through cells and tiles; the second half of them leaves the domain.
IRRADIATED = """
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 12, 0.5)
boundary(delete)
region(bar, block, 1, 3)
material(m, linear, 3, 100, 0.3)
solid(bar, region, bar, 2, m, 0.5)
fix(start, initial_velocity_particles, all, 100)
fix(sun, irradiate, all, 2, 5)
compute(d, probe, all, dose, point=1)
log_modify(custom, step, d)
set_dt(1e-3)
set_output(10)
plot(dose, 10, step, d)
save_plot(curve.png)
dump(points, all, particle, 50, points.*.LAMMPS, x, x0, dose)
dump(picture, all, pyplot, 100, picture.*.png, 200, 200, dose)
"""


def dose_of(x0, steps):
    """The sum of the geometric series of rates at the places at the beginnings of the steps."""
    q = exp(-100 * 1e-3 / 5)
    return 2e-3 * np.exp(-x0 / 5) * (1 - q**steps) / (1 - q)


@pytest.mark.parametrize("cut", few(("run(100)", "run(41)\nrun(59)"), "run(41)\nrun(59)"))
def test_a_field_of_a_fix_and_its_column(run_interpreted, cut):
    done = run_interpreted(IRRADIATED + cut)
    for step, left in ((50, 8), (100, 4)):
        rows = np.loadtxt(done.folder / f"points.{step}.LAMMPS", skiprows=11, ndmin=2)
        ids, _, x, _, _, x0, dose = rows.T
        assert len(rows) == left
        assert (ids == np.arange(1, left + 1)).all()
        np.testing.assert_allclose(x, x0 + 0.1 * step, rtol=1e-9)
        np.testing.assert_allclose(dose, dose_of(x0, step), rtol=1e-8)  # nine digits
    log = np.loadtxt(done.folder / "log.mpm", skiprows=1, comments="#")
    np.testing.assert_allclose(log[:, 1], dose_of(x0[0], log[:, 0]), rtol=1e-8)
    assert (done.folder / "curve.png").stat().st_size > 1000
    assert (done.folder / "picture.100.png").stat().st_size > 1000


# A body that flies freely from left to right over a grid that it leaves behind.
FLYING = """
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 6, 0, 2, 0.25)
region(bar, block, 1, 1.5, 0.75, 1)
material(m, linear, 3, 100, 0.3)
solid(bar, region, bar, 2, m, 0.25)
fix(start, initial_velocity_particles, all, 10, 0)
fix(p, peak_speed, all)
set_dt(1e-2)
set_output(1000)
log_modify(custom, step, time)
dump(n, all, grid, 1000, n.*.LAMMPS, peak, mass)
dump(o, all, grid/hdf5, 15, o.h5, peak)
restart(6, r.*.h5)
"""
LATE = """
region(late, block, 1, 1.5, 0.75, 1)
solid(late, region, late, 2, m, 0.25)
"""
GROWING = f"run(15){LATE}run(15)"


@pytest.mark.parametrize("cut", few(("run(30)", GROWING), GROWING))
def test_a_field_of_nodes_and_its_column(state_interpreted, run_interpreted, tmp_path, cut):
    """Free flight: all nodes that the body has come over know its speed, exactly."""
    assert "not monitored" not in run_interpreted(FLYING + "run(0)", folder="watched").out
    goes_on(run_interpreted, FLYING + cut)
    rows = np.loadtxt(tmp_path / "whole" / "n.30.LAMMPS", skiprows=11, ndmin=2)
    _, _, x, y, _, peak, mass = rows.T
    passed = (x > 0.75) & (x < 4.75) & (y > 0.5) & (y < 1.25)
    np.testing.assert_allclose(peak, np.where(passed, 10, 0), rtol=1e-9)  # ten digits
    assert (mass[passed] == 0).any()
    state_interpreted(FLYING + cut, out="one", boxes=True)
    state_interpreted(FLYING + cut, out="two", ranks=2, boxes=True)
    same_files(tmp_path / "one", tmp_path / "two")


def test_check_counts_the_field_and_the_log_says_how_to_read_it(run_interpreted, site, tmp_path):
    script = tmp_path / "in.dose"
    script.write_text(IRRADIATED + "run(10)")
    done = karamelo_py(site, tmp_path, "check", "in.dose")
    assert done.returncode == 0, done.stderr
    assert re.search(r"^  dose +1 +8$", done.stdout, re.M)
    assert "dump: dose will be 0" not in done.stderr
    done = run_interpreted(IRRADIATED.replace("step, d)", "step, dose)"), status=1)
    assert "compute(ID, probe, all, dose) measures it" in done.err
    done = run_interpreted(IRRADIATED.replace("x0, dose)", "x0, doses)"), status=1)
    assert "did you mean 'dose'?" in done.err


# --- the other families -------------------------------------------------------------------------


def test_a_body_of_a_transfer_and_a_basis_grows(run_interpreted):
    """A body that nothing acts on: a step multiplies its velocity by factor^times, exactly."""
    script = block(
        2,
        "fix(v, initial_velocity_particles, all, 1e-3, -2e-3)",
        "compute(v, average_velocity, all)",
        "log_modify(custom, step, v_x, v_y)",
        "set_dt(1e-6)",
        "run(5)",
    )
    done = run_interpreted(script.replace("FLIP, linear, 1", "growing, smooth, 1.5, 2, 0.25"))
    step, x, y = read_log(done.folder)
    growth = 1.5 ** (2 * step)
    np.testing.assert_allclose(x, 1e-3 * growth, rtol=1e-9)  # ten digits
    np.testing.assert_allclose(y, -2e-3 * growth, rtol=1e-9)  # ten digits


def test_a_part_declares_what_it_is_known_for(run_interpreted):
    """Its rule speaks before the run and in `check`, once, with the facts of the scene."""
    start = "fix(v, initial_velocity_particles, all, 1e-3, -2e-3)"
    script = block(2, start, "set_dt(1e-6)", "run(1)", "run(1)")
    script = script.replace("FLIP, linear, 1", "growing, smooth, 1.5, 2, 0.25")
    for command in ("run", "check"):
        said = run_interpreted(script, command=command).err
        assert said.count("warning: growing velocities: ") == 1
        assert "with smooth functions points at 0.002 are 1.5 times as fast after each step" in said
        assert "fix: a factor of 1 at most" in said and "| method(" in said
    assert "growing" not in run_interpreted(script.replace("1.5, 2,", "1, 2,")).err


def test_a_fault_in_a_rule_names_the_part(tmp_path):
    file = install(tmp_path / "site") / "mpm_examples" / "growing.py"
    file.write_text(file.read_text("utf-8").replace("scene.fastest > 0", "scene.fast > 0"), "utf-8")
    script = block(2, "run(1)").replace("FLIP, linear, 1", "growing, smooth, 1.5, 2, 0.25")
    (tmp_path / "in.script").write_text(script, "utf-8")
    done = karamelo_py(tmp_path / "site", tmp_path, "in.script")
    assert done.returncode == 1
    assert "error: transfer growing (of mpm-examples" in done.stderr
    assert "no attribute 'fast' (growing.py:" in done.stderr


MOVING = (
    "fix(v, initial_velocity_particles, all, 0.5*x0*y0, -x0)",
    "set_dt(1e-3)",
    "dump(d, all, particle, 5, d.*.LAMMPS, x, y, vx, vy, s11, s12)",
    "run(5)",
)


def test_a_scheme_and_a_method_are_the_built_in_ones_where_they_must_be(run_interpreted):
    def dumped(script, folder):
        rows = np.loadtxt(run_interpreted(script, folder=folder).folder / "d.5.LAMMPS", skiprows=11)
        return np.array(sorted(map(tuple, rows[:, 2:])))  # in whichever order they were put

    # usl looks after light nodes with bases of steep edges only, of which splines are none.
    usl = block(2, *MOVING, transfer="FLIP quadratic", scheme="usl")
    plain = usl.replace("scheme(usl)", "scheme(plain-usl)")
    assert (dumped(usl, "usl") == dumped(plain, "plain")).all()
    # A grid that is coarser than the domain's is the grid of a coarser domain.
    fine = block(2, *MOVING).replace("0, 1.2, 0.1)", "0, 1.2, 0.05)")
    fine = fine.replace("box, 2, rubber, 0.1", "box, 1, rubber, 0.05")
    coarse = fine.replace("ulmpm, FLIP, linear, 1", "coarse, FLIP, linear, 1, 2")
    assert (dumped(block(2, *MOVING), "domain") == dumped(coarse, "coarse")).all()


def test_a_region_a_command_and_a_dump(run_interpreted):
    done = run_interpreted("""
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.02)
        region(egg, ellipse, 0.5, 0.5, 0.3, 0.2)
        material(m, linear, 3, 100, 0.3)
        solid(egg, region, egg, 2, m, 0.02)
        m = mass_of(egg)
        log_modify(custom, step, m)
        dump(d, all, csv, 1, d.*.csv, x, y, mass)
        run(0)
    """)
    _, mass = np.loadtxt(done.folder / "log.mpm", skiprows=1)
    rows = np.genfromtxt(done.folder / "d.0.csv", delimiter=",", names=True)
    # pi a b rho; the staircase of points of side 0.01 follows the edge to a percent of the area.
    np.testing.assert_allclose(mass, np.pi * 0.3 * 0.2 * 3, rtol=0.01)
    np.testing.assert_allclose(rows["mass"].sum(), mass, rtol=1e-9)
    inside = ((rows["x"] - 0.5) / 0.3) ** 2 + ((rows["y"] - 0.5) / 0.2) ** 2
    assert (inside <= 1).all()


def test_an_eos_under_compression(run_interpreted):
    """Squeezed at a constant rate in one direction, J = 1 - rate t by the steps' product."""
    script = PULL.replace("rate = 10", "rate = -10").replace("bulk, linear", "bulk, logarithmic")
    script = script.replace("ep, R, seq", "s11, s22, volume").replace("{recovery}", "1")
    script = script.replace("20e3, 1e6", "20e30, 1e6")  # elastic
    done = run_interpreted(script)
    s11, s22, volume = np.loadtxt(done.folder / "points.100.LAMMPS", skiprows=11)[:, -3:].T
    J = volume / 0.5
    assert (J < 0.99).all()
    # The trace of the stress in uniaxial strain: s11 + 2 s22 = -3 p = 3 K ln J, with nine digits
    # of J, and so seven of ln J = -0.02.
    np.testing.assert_allclose(s11 + 2 * s22, 3 * 5e7 * np.log(J), rtol=1e-7)


@pytest.mark.parametrize("part", ["damage(d, worn, 0.1)", "temperature(d, heating, 2, 300)"])
def test_a_damage_and_a_temperature(run_interpreted, part):
    """Pulled beyond yield: D = ep / limit takes its share of Y; dT is Y dep / (rho cp).

    With rho = rho0 / J and dep = 2/3 dJ/J that is 2/3 Y (J - J at yield) / (rho0 cp).
    """
    law = f"plastic, 25e6, 20e3)\n{part[:-1]}"
    script = PULL.replace("recovering, 25e6, 20e3, 1e6, {recovery}", law)
    script = script.replace("bulk, hot)", "bulk, hot, d)")
    column = "damage" if "worn" in part else "T"
    script = script.replace("ep, R, seq", f"ep, {column}, seq")
    script = script.replace("compute(hard, probe, all, R)", f"compute(hard, probe, all, {column})")
    done = run_interpreted(script)
    ep, number, q = np.loadtxt(done.folder / "points.100.LAMMPS", skiprows=11)[:, -3:].T
    assert (ep > 0.01).all()
    if "worn" in part:
        np.testing.assert_allclose(number, ep / 0.1, rtol=1e-7)
        np.testing.assert_allclose(q, (1 - ep / 0.1) * 20e3, rtol=1e-7)
    else:
        J = (1 + 10 * 2e-5) ** 100
        exact = 2 / 3 * 20e3 * J * (1 - np.exp(-1.5 * ep)) / (1000 * 2)
        np.testing.assert_allclose(number - 300, exact, rtol=2e-4)  # a step stretches by 2e-4


def test_a_solid(run_interpreted):
    """A ring of 40 squares has their mass, and its centre; what lies outside is told."""
    script = """
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.1)
        material(m, linear, 3, 100, 0.3)
        solid(hoop, ring, {}, 0.5, 0.3, 40, m, 0.1)
        compute(c, center_of_mass, all)
        m = mass_of(hoop)
        log_modify(custom, step, m, c_x, c_y)
        run(0)
    """
    _, mass, x, y = np.loadtxt(run_interpreted(script.format(0.5)).folder / "log.mpm", skiprows=1)
    np.testing.assert_allclose(mass, 3 * 40 * (2 * np.pi * 0.3 / 40) ** 2, rtol=1e-9)
    np.testing.assert_allclose([x, y], 0.5, rtol=1e-9)
    assert "points of ring outside the domain left out" in run_interpreted(script.format(0.8)).err


NEXT_TO_IT = """
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 0.5)
region(bar, block, 1, 2)
material(m, myfluid.ElasticFluid, 3, 100)
solid(bar, region, bar, 2, m, 0.5)
fix(start, initial_velocity_particles, all, 2)
fix(air, mydrag.Drag, all, 0.5)
compute(v, average_velocity, all)
set_dt(0.01)
log_modify(custom, time, v_x)
run(20)
"""


RUN_BOTH = """
import sys
from karamelo_py import Simulation
for folder in sys.argv[1:]:
    sim = Simulation(folder + "/in.file", out=folder)
    sim.run()
    sim.close()
"""


def test_classes_next_to_the_script_are_styles(tmp_path, site):
    """v = v0 exp(-c t). Another folder has another class of that name; `help` finds both."""
    folders = tmp_path / "one", tmp_path / "two"
    for factor, folder in enumerate(folders, 1):
        folder.mkdir()
        for file, target in (("elastic_fluid", "myfluid"), ("drag", "mydrag")):
            text = (PLUGIN / "src" / "mpm_examples" / f"{file}.py").read_text("utf-8")
            text = text.replace("-self.rate", f"-{factor} * self.rate")
            (folder / f"{target}.py").write_text(text, "utf-8")
        (folder / "in.file").write_text(NEXT_TO_IT, "utf-8")
    # In another process: modules stay imported, and their kernels have no keys.
    command = [sys.executable, "-c", RUN_BOTH, *map(str, folders)]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    for factor, folder in enumerate(folders, 1):
        time, v = np.loadtxt(folder / "log.mpm", skiprows=1, unpack=True)
        np.testing.assert_allclose(v, 2 * np.exp(-0.5 * factor * time), rtol=1e-9)
    helped = karamelo_py(site, folder, "help", "fix", "mydrag.Drag")
    assert "rate" in helped.stdout and "from the module mydrag" in helped.stdout


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("mydrag.Dreg", "mydrag.Dreg' of the module mydrag cannot be loaded: AttributeError"),
        ("mydrog.Drag", "there is no mydrog.py next to the script"),
    ],
)
def test_wrong_names_of_classes_next_to_the_script(tmp_path, site, wrong, said):
    (tmp_path / "mydrag.py").write_text("class Drag:\n    pass\n", "utf-8")
    script = NEXT_TO_IT.replace("mydrag.Drag", wrong).replace("myfluid.ElasticFluid", "linear")
    (tmp_path / "in.file").write_text(script.replace("3, 100", "3, 100, 0"), "utf-8")
    done = karamelo_py(site, tmp_path, "in.file")
    assert done.returncode == 1 and said in done.stderr and "in.file:8" in done.stderr


def test_the_loss_of_a_scheme_of_a_plug_in_is_not_known(run_interpreted):
    text = VIBRATION.partition("compute(")[0].replace("{law}", "linear, rho, E, 0")
    text += "scheme(plain-usl)\nset_dt(0.04)\nrun(60)\n"
    text = re.sub("FLIP, ([a-z]+), [0-9.]+", r"FLIP, \1, 0.9", text)
    done = run_interpreted(text)
    assert "  energy " in done.out and "lost by transfer" not in done.out
    compute = "compute(lost, transfer_loss, all)\nset_dt("
    said = run_interpreted(text.replace("set_dt(", compute), status=1).err
    assert "compute transfer_loss does not support scheme plain-usl" in said


def test_rubber_of_a_plug_in_is_the_built_in(run_interpreted):
    """A law of F in Python: the same stress along three paths as by its energy."""
    paths = {"pull": "exx=1, syy=0, szz=0", "sheet": "exx=0.6, eyy=0.4, szz=0", "shear": "gxy=0.8"}
    lines = [
        "material(own, mpm_examples.rubber.BlatzKo, 1000, 3e5)",
        "material(energy, hyperelastic, 1000, mu/2*(I2/J^2 + 2*J - 5), mu=3e5)",
    ]
    for name, ends in paths.items():
        lines += [f"load_path({name}, 2, {ends})"]
        lines += [f"element({law}_{name}, {law}, {name})" for law in ("own", "energy")]
    folder = run_interpreted("\n".join(lines)).folder
    for name in paths:
        own, energy = (
            np.loadtxt(folder / f"element_{law}_{name}.txt", skiprows=1)
            for law in ("own", "energy")
        )
        np.testing.assert_allclose(own, energy, rtol=1e-8, atol=1e-2)
    said = run_interpreted(lines[0].replace("1000", "-1000"), status=1).err
    assert "'rho' must be a number above 0" in said


MUD = """
method(ulmpm, APIC, quadratic-spline)
dimension(2, 0, 1, 0, 1, 0.25)
region(box, block, 0, 1, 0, 1)
eos(mud, fluid, 1500, 1e5, 7)
strength(thin, mpm_examples.thick.Bingham, 5, 20, 1e-2)
strength(stiff, mpm_examples.thick.Bingham, 5, 20, 2e-5)
material(thin, eos-strength, mud, thin)
material(stiff, eos-strength, mud, stiff)
load_path(shear, 1, exy=0.01, duration=0.02)
element(e, thin, shear)
solid(mud, region, box, 1, stiff, 0.25)
log_modify(custom, step, dt)
run(1)
"""


def test_mud_of_a_plug_in_tells_the_step_of_its_viscosity(run_interpreted):
    """tau = mu d + tau_y d/(d + slowest) at the rate d = 1; the step is that of nu at rest."""
    folder = run_interpreted(MUD).folder
    row = np.genfromtxt(folder / "element_e.txt", names=True)[-1]
    assert row["sxy"] == pytest.approx(5 + 20 / (1 + 1e-2), rel=1e-9)
    assert row["dissipated"] == pytest.approx(0.02 * row["sxy"], rel=1e-3)
    dt = np.loadtxt(folder / "log.mpm", skiprows=1)[-1, 1]
    nu, c = 4 / 3 * (5 + 20 / 2e-5) / 1500, np.sqrt(7e5 / 1500)
    a = nu / 0.25
    assert dt <= 0.25 / (np.hypot(c, a) + a)
    assert dt < 0.5 * 0.25 / c
