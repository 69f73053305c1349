"""Steps on a GPU, emulated by the processor: the same code, one thread after another."""

import numpy as np
import pytest
from numba import config

from karamelo_py.compiler.gpu import Emulator
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.gpu import StepsOnCard
from karamelo_py.scene.hub import Hub

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="threads of a GPU are compiled")

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
        ("ulmpm, FLIP, linear, 0.99", "musl", "double"),
        ("ulmpm, MLS, quadratic-spline", "usl", "single"),
        ("tlmpm, FLIP, linear, 0.99", "usf", "double"),
    ],
)
def test_same_as_processor(method, scheme, precision):
    """Sums have another order: some round-off errors of the largest number."""
    script = DISKS.format(method=method, scheme=scheme, precision=precision)
    (hub, one), (_, other) = begun(script), begun(script)
    steps = StepsOnCard(Emulator(), one.setup, hub.update.scheme, type(one.visits))
    steps.send()
    assert steps.advance(30) == other.advance(30) == 0
    steps.fetch()
    assert one.time == pytest.approx(other.time, rel=1e-12 if precision == "double" else 1e-5)
    error = 1e3 * np.finfo({"double": float, "single": np.float32}[precision]).eps
    for here, there in zip(state(one), state(other), strict=True):
        assert np.abs(here - there).max() <= error * np.abs(there).max()
