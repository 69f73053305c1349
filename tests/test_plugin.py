"""The example plug-in: installed by pip somewhere else, found by its entry points, right."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from math import exp
from pathlib import Path

import numpy as np
import pytest

PLUGIN = Path(__file__).parent / "plugin"

# One period of the first mode of a bar with fixed ends.
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
set_dt(0.02)
set_output(10)
run_time(2*L/c)
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
    """A folder of packages with the plug-in, as pip installs it."""
    require_build_tools()
    folder = tmp_path_factory.mktemp("plugin")
    source = shutil.copytree(PLUGIN, folder / "source")  # building leaves files behind
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", "-q", *options]
    command += ["--target", str(folder / "site"), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return folder / "site"


def karamelo_py(site, folder, *arguments, compiled=False):
    """Run the command line in a process of its own that sees the plug-in."""
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": path, "KARAMELO_PY_CACHE": str(site.parent / "cache")}
    environment["NUMBA_DISABLE_JIT"] = "0" if compiled else "1"
    command = [sys.executable, "-m", "karamelo_py.app.cli", *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


def read_log(folder):
    rows = np.loadtxt(folder / "log.mpm", skiprows=1)
    return rows.T


def test_styles_names_the_package(site, tmp_path):
    done = karamelo_py(site, tmp_path, "styles")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "mpm-drag 0.1.0" in line]
    listed = {line.split()[0]: line for line in lines}
    assert set(listed) == {"drag", "damp_nodes", "momentum", "elastic-fluid", "recovering"}
    assert "Slow points down" in listed["drag"]


def test_help_explains_it(site, tmp_path):
    done = karamelo_py(site, tmp_path, "help", "drag")
    assert done.returncode == 0, done.stderr
    assert "fix(ID, drag, group, rate)" in done.stdout
    assert "from mpm-drag 0.1.0" in done.stdout
    assert "a number of at least 0" in done.stdout


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf"])
def test_free_flight_under_drag_decays_exponentially(site, tmp_path, scheme):
    # Exact: p = m v0 exp(-rate t).
    script = (PLUGIN / "in.drag").read_text()
    (tmp_path / "in.drag").write_text(script.replace("dimension(", f"scheme({scheme})\ndimension("))
    done = karamelo_py(site, tmp_path, "in.drag")
    assert done.returncode == 0, done.stderr
    step, time, p, lost = read_log(tmp_path)
    assert step[-1] == 100
    mass, v0, rate, dt = 3.0, 2.0, 0.5, 0.01
    np.testing.assert_allclose(p, mass * v0 * np.exp(-rate * time), rtol=1e-9)
    np.testing.assert_allclose(lost[1:], p[1:] * (exp(rate * dt) - 1), rtol=1e-7)


@pytest.mark.parametrize("compiled", [False, True])
def test_both_kinds_of_hook_act_in_one_run(site, tmp_path, compiled):
    # Exact: each step multiplies the velocity by exp(-rate dt) and by 1 - c dt.
    script = (PLUGIN / "in.drag").read_text().replace("run(", DAMP + "run(")
    (tmp_path / "in.both").write_text(script)
    done = karamelo_py(site, tmp_path, "in.both", compiled=compiled)
    assert done.returncode == 0, done.stderr
    step, time, p, force = read_log(tmp_path)
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
def test_mistakes_in_its_arguments_are_marked(site, tmp_path, line, message):
    script = (PLUGIN / "in.drag").read_text().replace("fix(air, drag, all, rate)", line)
    (tmp_path / "in.wrong").write_text(script)
    done = karamelo_py(site, tmp_path, "in.wrong")
    assert done.returncode == 1
    assert message in done.stderr
    assert "in.wrong:11:" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_material_is_a_linear_one_at_small_strain(site, tmp_path):
    # In one dimension both laws are sigma = E du/dx; the exact period is 2 L / c = 4.
    logs = []
    for number, law in enumerate(("elastic-fluid, rho, E", "linear, rho, E, 0")):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "in.bar").write_text(VIBRATION.replace("{law}", law))
        done = karamelo_py(site, folder, "in.bar")
        assert done.returncode == 0, done.stderr
        logs.append(read_log(folder))
    (time, kinetic, stored), (_, reference, stored_reference) = logs
    start = kinetic[0]
    np.testing.assert_allclose(kinetic, reference, atol=0.002 * start)
    np.testing.assert_allclose(stored, stored_reference, atol=0.002 * start)
    np.testing.assert_allclose(kinetic, start * np.cos(np.pi * time / 2) ** 2, atol=0.05 * start)


# A bar that is pulled at a constant rate, in uniaxial strain.
PULL = """
rate = 10
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 4, 0.5)
region(bar, block, 1, 3)
eos(bulk, linear, 1000, 5e7)
strength(hot, recovering, 25e6, 20e3, 1e6, {recovery})
material(m, eos-strength, bulk, hot)
solid(bar, region, bar, 2, m, 0.5)
region(everywhere, block, -INF, INF)
group(nodes, nodes, region, everywhere, all)
fix(pull, velocity_nodes, nodes, rate*x)
fix(start, initial_velocity_particles, all, rate*x0)
set_dt(2e-5)
set_output(100)
dump(points, all, particle, 100, points.*.LAMMPS, ep, R, seq)
run(100)
"""


@pytest.mark.parametrize("compiled", [False, True])
def test_a_strength_shows_its_own_number(site, tmp_path, compiled):
    recovery = 4e3
    (tmp_path / "in.pull").write_text(PULL.replace("{recovery}", str(recovery)))
    done = karamelo_py(site, tmp_path, "in.pull", compiled=compiled)
    assert done.returncode == 0, done.stderr
    rows = np.loadtxt(tmp_path / "points.100.LAMMPS", skiprows=11)
    ep, R, q = rows[:, -3:].T
    # Exact for steady flow, whose strain rate is 2/3 of the stretching: R = H (dep/dt) / rate.
    np.testing.assert_allclose(R, 1e6 * (2 / 3 * 10) / recovery, rtol=2e-3)
    np.testing.assert_allclose(q, 20e3 + R, rtol=1e-6)
    assert (ep > 0.01).all()
