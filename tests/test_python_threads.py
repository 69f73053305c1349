"""Several threads of Python at once: kernels, their exceptions, and simulations."""

import threading
from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest
from numba import config

from karamelo_py import Simulation, SimulationError
from karamelo_py.compiler import kernel, point_function

pytestmark = pytest.mark.xdist_group("disks")
compiled = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")


class Tag(NamedTuple):
    """What a point function is chosen by."""


@point_function()
def next_one(tag, x):
    """The number behind x."""


@next_one.on(Tag)
def _next_one(tag, x):
    return x + 1.0


def at_once(*functions):
    """What functions give that run at once, each in a thread; or what they raise."""
    found = [None] * len(functions)
    begin = threading.Barrier(len(functions))

    def run(k):
        begin.wait()
        try:
            found[k] = functions[k]()
        except BaseException as error:
            found[k] = error

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(functions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def _chain(a, i):
    total = 0.0
    for k in range(40):
        total = total + a[i] * k
    return total


@kernel
def _long(a, n):
    total = 0.0
    for i in range(n):
        total += _chain(a, i % a.size)
        for j in range(3):
            total += _chain(a, (i + j) % a.size) * _chain(a, j)
    return total


@compiled
def test_a_point_function_is_plain_python_while_another_thread_compiles(tmp_path, monkeypatch):
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    done = threading.Event()

    def compiling():
        try:
            return _long(np.ones(4), 10)
        finally:
            done.set()

    def plain():
        found = set()
        while not done.is_set():
            found.add(next_one(Tag(), 1.0))
        return found

    total, found = at_once(compiling, plain)
    assert total == 10 * (780 + 3 * 780**2)
    assert found == {2.0} and type(found.pop()) is float


@kernel
def _innocent(a):
    return a[0] * 2.0


@kernel
def _guilty(a):
    for i in range(a.size):
        if a[i] > 0.5:
            raise ValueError("guilty")
    return 1.0


def _often(function):
    """How often a kernel gives what, of many calls."""

    def run():
        found = Counter()
        for _ in range(5000):
            try:
                found[function(np.ones(3))] += 1
            except ValueError as error:
                found[str(error)] += 1
        return found

    return run


@compiled
def test_exceptions_are_raised_in_the_thread_whose_kernel_fails():
    a = np.ones(3)
    _innocent(a)
    with pytest.raises(ValueError, match="guilty"):
        _guilty(a)
    innocent, guilty = at_once(_often(_innocent), _often(_guilty))
    assert innocent == {2.0: 5000}
    assert guilty == {"guilty": 5000}


SCENE = """
method(ulmpm, {method})
dimension(2, 0, 1, 0, 1, 0.1)
region(box, block, 0.3, 0.6, 0.3, 0.6)
material(rubber, neo-hookean, 1000, 1000, 0.3)
solid(body, region, box, 2, rubber, 0.1, 0)
fix(v, initial_velocity_particles, all, 0.1*sin(9*x), 0)
fix(g, body_force, all, 0, {force})
"""
ONE = SCENE.format(method="FLIP, linear, 0.99", force="-0.1*x^3")
OTHER = SCENE.format(method="FLIP, linear, 1", force="-0.2")
WRONG = SCENE.format(method="FLIP, linear, 1", force="sqrt(0.2 - time)")


def _ends(script, threads=1):
    def run():
        sim = Simulation(script, threads=threads)
        sim.run(20)
        return np.concatenate([sim.points[name] for name in ("x", "y", "vx", "vy", "s11")])

    return run


def test_simulations_run_at_once(tmp_path, monkeypatch):
    """Each with the bits that it has alone; one of them on two threads, and one that goes wrong."""
    monkeypatch.chdir(tmp_path)
    ends = _ends(ONE), _ends(OTHER, 2), _ends(WRONG), _ends(ONE, 2)
    *found, last = at_once(*ends)
    one, other = _ends(ONE)(), _ends(OTHER)()
    np.testing.assert_array_equal(found[0], one)
    np.testing.assert_array_equal(found[1], other)
    np.testing.assert_array_equal(last, one)
    assert isinstance(found[2], SimulationError)
    assert "fix g gets NaN from sqrt(0.2 - time)" in str(found[2])


def test_one_simulation_takes_one_call_at_a_time():
    begun, end = threading.Event(), threading.Event()

    def wait(points):
        begun.set()
        end.wait(60)
        return 0.0

    sim = Simulation(ONE)
    sim.fix("w", "python", "all", wait)

    def second():
        begun.wait(60)
        try:
            sim.run(1)
        finally:
            end.set()

    first, refused = at_once(lambda: sim.run(1), second)
    assert first is None
    assert isinstance(refused, SimulationError)
    assert "is running in another thread" in str(refused)
    assert sim.evaluate("timestep") == 1
