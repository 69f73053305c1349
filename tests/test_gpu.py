"""Steps on a GPU, emulated by the processor: the same code, one thread after another."""

from math import inf

import numpy as np
import pytest
from numba import config
from selection import few

from karamelo_py.compiler.disk import cache
from karamelo_py.compiler.gpu import Emulator
from karamelo_py.compiler.trace.functions import forget
from karamelo_py.kernels.arrays import arrays_of
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.gpu import StepsOnCard
from karamelo_py.scene.hub import Hub

pytestmark = [
    pytest.mark.skipif(bool(config.DISABLE_JIT), reason="threads of a GPU are compiled"),
    pytest.mark.xdist_group("gpu"),
]

DISKS = """
precision({precision})
method({method})
scheme({scheme})
dimension(2, -0.5, 0.5, -0.5, 0.5, 0.1)
region(lower, cylinder, -0.2, -0.2, 0.2)
region(upper, cylinder, 0.2, 0.2, 0.2)
material(rubber, neo-hookean, 1000, 1000, 0.3)
solid(disk1, region, lower, 2, rubber, 0.1, 0)
solid(disk2, region, upper, 2, rubber, 0.1, 0)
group(disk1, particles, region, lower, solid, disk1)
group(disk2, particles, region, upper, solid, disk2)
fix(v1, initial_velocity_particles, disk1, 0.1, 0.1)
fix(v2, initial_velocity_particles, disk2, -0.1, -0.1)
"""


def begun(script):
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(script)
    hub.simulation.begin(np.inf)
    return hub, hub.simulation


def state(simulation):
    """Velocities, places and states of all points, by id."""
    found = []
    for block in simulation.setup.blocks:
        points, order = block.points, np.argsort(block.points.id)
        found += [a[..., order] for a in (points.v, points.x[simulation.now], points.state)]
    return found


@pytest.mark.parametrize(
    ("method", "scheme", "precision"),
    [
        pytest.param("ulmpm, FLIP, linear, 0.99", "musl", "double", marks=pytest.mark.full),
        ("ulmpm, MLS, quadratic-spline", "usl", "single"),
        # As in test_gpu_runs.py, interpreted.
        pytest.param("tlmpm, FLIP, linear, 0.99", "usf", "double", marks=pytest.mark.full),
    ],
)
def test_same_as_processor(method, scheme, precision):
    """Sums have another order: some round-off errors of the largest number."""
    script = DISKS.format(method=method, scheme=scheme, precision=precision)
    (hub, one), (_, other) = begun(script), begun(script)
    steps = StepsOnCard(Emulator(), one.setup, (hub.update.scheme, type(one.visits)))
    steps.send()
    assert steps.advance(30) == other.advance(30) == 0
    steps.fetch()
    assert one.time == pytest.approx(other.time, rel=1e-12 if precision == "double" else 1e-5)
    error = 1e3 * np.finfo({"double": float, "single": np.float32}[precision]).eps
    for here, there in zip(state(one), state(other), strict=True):
        assert np.abs(here - there).max() <= error * np.abs(there).max()


WATER = """
method(ulmpm, FLIP, linear, 0.99)
h = 0.1
dimension(2, 0, 1.2, 0, 0.8, h)
region(column, block, 0, 0.5, 0, 0.5)
eos(water, fluid, 1000, 1e6, 7)
strength(water, fluid, 1e-3)
material(water, eos-strength, water, water)
solid(water, region, column, 2, water, h, 0)
region(sides, block, -h/4, h/4, INF, INF)
region(base, block, INF, INF, -h/4, h/4)
group(sides, nodes, region, sides, all)
group(base, nodes, region, base, all)
region(top, block, INF, INF, 0.4, 0.5)
group(top, particles, region, top, solid, water)
fix(sides, velocity_nodes, sides, 0, NULL)
fix(base, velocity_nodes, base, NULL, geq0, mu=0.2)
fix(gravity, body_force, all, 0.1*sin(x), -9.81*min(1, time/0.01))
fix(push, velocity_particles, top, 0.1*cos(40*time) + 1e-4*base_y, NULL)
"""


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory):
    """A folder for kernels, empty at first."""
    return str(tmp_path_factory.mktemp("cache"))


@pytest.mark.parametrize("method", few(("ulmpm", "tlmpm"), "ulmpm"))
def test_fixes(monkeypatch, own_cache, method):
    """Walls with friction in common nodes, formulas, forces on points; the balance of energy.

    Reactions are sums without rounding: they differ by what their terms do. The code of threads is
    made where nothing else was compiled before, as where the processor's kernels are on disk:
    formulas of two fixes have one signature, and only the second asks for the larger of two.
    """
    script = WATER.replace("ulmpm", method)
    (hub, one), (other_hub, other) = begun(script), begun(script)
    hooks = one.hooks, one.fixes.lasting.functions
    forget()
    monkeypatch.setenv("KARAMELO_PY_CACHE", own_cache)
    steps = StepsOnCard(Emulator(), one.setup, (hub.update.scheme, type(one.visits)), hooks)
    steps.send()
    assert steps.advance(21) == other.advance(21) == 0
    steps.fetch()
    for here, there in zip(state(one), state(other), strict=True):
        assert np.abs(here - there).max() <= 1e-12 * np.abs(there).max()
    published = [name for name in hub.values.names() if name.endswith(("_x", "_y"))]
    assert len(published) == 8
    for name in published:
        value = other_hub.values.get(name)
        assert hub.values.get(name) == pytest.approx(value, rel=1e-10, abs=1e-9), name
    assert method != "ulmpm" or hub.values.get("base_y") > 100  # it bears the column by now
    watches = one.control.energy[0], other.control.energy[0]
    assert watches[0].looks == watches[1].looks == 3
    for name in ("kinetic", "stored", "work", "balance", "of_drift", "elastic", "lost", "crossed"):
        assert watches[0][name] == pytest.approx(watches[1][name], rel=1e-9, abs=1e-12), name


def test_order_in_memory_changes_nothing():
    """Points are summed in the order of their ids, wherever they lie."""
    script = DISKS.format(method="ulmpm, MLS, quadratic-spline", scheme="usl", precision="single")
    found = []
    for shuffled in (False, True):
        hub, simulation = begun(script)
        if shuffled:
            for block in simulation.setup.blocks:
                order = np.random.default_rng(1).permutation(block.points.id.size)
                for _, array in arrays_of(block.points):
                    array[...] = array[..., order]
        steps = StepsOnCard(
            Emulator(), simulation.setup, (hub.update.scheme, type(simulation.visits))
        )
        steps.send()
        assert steps.advance(20) == 0
        steps.fetch()
        found.append(state(simulation))
    for here, there in zip(*found, strict=True):
        assert (here == there).all()


def test_code_is_kept(monkeypatch, own_cache):
    """The second run of a kind of scene compiles nothing."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", own_cache)
    # Sources of plug-ins that earlier tests have written count as old.
    monkeypatch.setattr(cache, "_began", inf)

    def made_again(self, function, *_):
        raise AssertionError(f"{function.__qualname__} is compiled again")

    for again in (False, True):
        if again:
            monkeypatch.setattr(Emulator, "_compiled", made_again)
        hub, one = begun(WATER)
        hooks = one.hooks, one.fixes.lasting.functions
        StepsOnCard(Emulator(), one.setup, (hub.update.scheme, type(one.visits)), hooks)
