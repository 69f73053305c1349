"""What a simulation leaves in memory when it is closed and nothing refers to it."""

import gc
import json
import os
import subprocess
import sys
import time
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from numba import types
from scenes import block
from test_heat import slab

from karamelo_py import Simulation, SimulationError
from karamelo_py.compiler import address_of_python, caller_of, kernel
from karamelo_py.kernels import touching
from karamelo_py.styles.fixes import grip
from karamelo_py.styles.fixes.grip import Grip, memory_for

pytestmark = pytest.mark.xdist_group("surface")
INDENT = "fix(dent, indent/minimize_penetration, all, sphere, 0.1, 0.45, 0.55, 0, 0, 0, 0, 0.2)"
PRESSURE = "fix(p, edge_pressure, all, box, 5*time)"


def touched(name="touch", bottom=0.0, top=0.3):
    """A block that touches a base, with the fixes that kernels call while they run."""
    return block(
        2,
        f"region(base, block, 0, 1.2, {bottom}, {top})",
        f"fix({name}, contact/surface, all, base, 0.2)",
        INDENT,
        PRESSURE,
        law="soft",
    )


NO_FIXES = SimpleNamespace(fixes={})
PLANE = "fix(p, contact/minimize_penetration/plane, body, 0.32, 0, 0, 1, 0, 0, 0.3)"
SCENES = {
    "contact/surface, indent and edge_pressure": touched(),
    "indent": block(2, INDENT),
    "plane": block(2, PLANE),
    "edge_pressure": block(2, PRESSURE),
    "edge_convection": slab("fix(wind, edge_convection, all, slab, 0.02, 200)", run=""),
    "body_force": block(2, "fix(g, body_force, all, 0, -1)"),
}


def stays(scene):
    """Whether a scene is in memory after two runs, when its simulation was closed."""
    sim = Simulation(scene)
    sim.run(2)
    sim.run(1)
    hub = weakref.ref(sim.hub)
    sim.close()
    del sim
    gc.collect()
    return hub() is not None


def test_interpreted(tmp_path):
    program = f"""
import sys, json
sys.path.insert(0, {str(Path(__file__).parent)!r})
import test_freed as t
print(json.dumps({{name: t.stays(scene) for name, scene in t.SCENES.items()}}))
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], cwd=tmp_path, capture_output=True,
        text=True, env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == dict.fromkeys(SCENES, False)


def test_compiled():
    """A second scene has the kernels of the first one, and they call what the second one has."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert not stays(touched())
        deep = Simulation(touched("deep", bottom=-10, top=10))
        with pytest.raises(SimulationError, match="is so deep in region 'base' of fix 'deep'"):
            deep.run(2)


CALL = types.int64(types.int64)
_call = caller_of(CALL)


@kernel
def _of_arguments(arguments, number):
    return _call(arguments[0], number)


def test_arguments_hold_what_kernels_call():
    """For as long as they are there, whoever else has let go of it."""

    class Owner:
        def add_one(self, number):
            return number + 1

    owner = Owner()
    there = weakref.ref(owner)
    arguments = (address_of_python(owner.add_one, CALL), 2.5)
    del owner
    gc.collect()
    assert _of_arguments(arguments, 41) == 42
    del arguments
    gc.collect()
    assert there() is None


class Rough(Grip):
    """A grip that no other test has."""


@pytest.mark.parametrize(
    ("module", "ask"),
    [
        (touching, lambda: touching.touch_kind(Rough, None)),
        (grip, lambda: memory_for(NO_FIXES, Rough)),
    ],
    ids=["touch", "grip"],
)
def test_threads_find_one_class(monkeypatch, module, ask):
    """Kernels find it by its name: of two classes of one name they would know only the second."""
    made = []

    def slowly(*arguments):
        made.append(arguments)
        time.sleep(0.05)
        return type(*arguments)

    monkeypatch.setattr(module, "type", slowly, raising=False)
    with ThreadPoolExecutor(4) as threads:
        found = [one.result() for one in [threads.submit(ask) for _ in range(4)]]
    assert len(made) == len(set(found)) == 1
