"""How fast a scene runs: its speed, the time of its stages, the bytes it moves, the bandwidth."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from karamelo_py.app.bench.workloads import MOST_STEPS, Workload
from karamelo_py.compiler.compile import kernel
from karamelo_py.kernels.step import DONE, Fused, begin, finish, step
from karamelo_py.kernels.sweep import sweep_nodes, sweep_points
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.report import node_fields, point_fields
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


class Timed(NamedTuple):
    """A way of sweeping that notes how long each sweep took, then does as `mode` does."""

    mode: Any
    seconds: dict[str, float]


def _name(*tags: Any) -> str:
    return " + ".join(type(tag).__name__ for tag in tags)


@sweep_points.on(Timed)
def _(mode, visit, s, block, then, gathers, scatters, dt):
    begun = time.perf_counter()
    sweep_points(mode.mode, visit, s, block, then, gathers, scatters, dt)
    _note(mode, _name(*visit.tasks, *visit.quantities), begun)


@sweep_nodes.on(Timed)
def _(mode, task, kin, nodes, spans, dt):
    begun = time.perf_counter()
    sweep_nodes(mode.mode, task, kin, nodes, spans, dt)
    _note(mode, _name(task), begun)


def _note(mode: Timed, name: str, begun: float) -> None:
    mode.seconds[name] = mode.seconds.get(name, 0.0) + time.perf_counter() - begun


def build(
    workload: Workload, threads: int | None, presets: Mapping[str, str] | None = None
) -> Simulation:
    """The simulation of a workload, ready to step; `presets` set variables of its script."""
    hub = Hub(Console(quiet=True))
    hub.settings.threads = threads
    hub.interpreter = Interpreter(hub, presets=presets)
    hub.interpreter.run_text(workload.script, "bench")
    simulation = hub.simulation
    simulation.begin(inf)
    return simulation


def speed(
    simulation: Simulation, seconds: float, lead: int = 3, repetitions: int = 5
) -> tuple[float, float]:
    """Particle-steps per second: of the fastest repetition, and their median.

    Every repetition starts from the same state, that after `lead` steps.
    """
    _advance(simulation, lead)
    start = simulation.snapshot()
    per_step = _advance(simulation, 5) / 5
    count = min(max(5, int(seconds / repetitions / per_step)), MOST_STEPS)
    rates = []
    for _ in range(repetitions):
        simulation.restore(start)
        rates.append(simulation.count * count / _advance(simulation, count))
    simulation.restore(start)
    return max(rates), statistics.median(rates)


def _advance(simulation: Simulation, count: int) -> float:
    """Seconds that `count` steps take."""
    begun = time.perf_counter()
    if simulation.advance(count) != DONE:
        raise ScriptError("a workload went wrong")
    return time.perf_counter() - begun


def stages(simulation: Simulation, seconds: float) -> dict[str, float]:
    """Seconds per step in each sweep of a fused step, called one by one."""
    s, scheme = simulation.setup, simulation.hub.update.scheme
    timed = Timed(simulation.mode, {})
    begin(scheme, Fused(), timed, s)
    _take_step(simulation, timed)
    timed.seconds.clear()
    count = 0
    begun = time.perf_counter()
    while count < 3 or (time.perf_counter() - begun < seconds and count < MOST_STEPS):
        _take_step(simulation, timed)
        count += 1
    return {name: total / count for name, total in timed.seconds.items()}


def _take_step(simulation: Simulation, mode: Any) -> None:
    s, scheme = simulation.setup, simulation.hub.update.scheme
    if not step(scheme, Fused(), mode, s, simulation.hooks, True):
        raise ScriptError("a workload went wrong")
    finish(s.control)


class _Recorder(NamedTuple):
    """Sweeps nothing, and notes what a sweep would read and write."""

    points: list
    nodes: list


@sweep_points.on(_Recorder)
def _(mode, visit, s, block, then, gathers, scatters, dt):
    reads = {name for tag in (*visit.tasks, *visit.quantities) for name in tag.reads}
    writes = {name for tag in visit.tasks for name in tag.writes}
    mode.points.extend((*reads, *writes))


@sweep_nodes.on(_Recorder)
def _(mode, task, kin, nodes, spans, dt):
    mode.nodes.extend(task.goes_through)


def traffic(simulation: Simulation) -> float:
    """Bytes per particle-step that have to move if nothing stays in a cache.

    Fields of the points count once for each sweep that reads and once for each that writes them;
    of node fields, those that loops over nodes go through.
    """
    s, scheme = simulation.setup, simulation.hub.update.scheme
    recorder = _Recorder([], [])
    control = s.control
    kept = control.values.copy(), control.clock.copy()
    step(scheme, Fused(), recorder, s, simulation.hooks, True)
    control.values[:], control.clock[:] = kept
    of_point = {name: size for name, _, size in point_fields(s.blocks[0])}
    of_node = {name: array.itemsize * array.shape[1] for name, array in node_fields(s)}
    active = float(np.sum(s.spans[1 : 1 + s.spans[0, 0], 1] - s.spans[1 : 1 + s.spans[0, 0], 0]))
    total = simulation.count * sum(of_point.get(name, 0) for name in recorder.points)
    total += active * sum(of_node.get(name, 0) for name in recorder.nodes)
    return total / simulation.count


@kernel
def _triad(a, b, c, factor):
    for i in range(a.size):
        a[i] = b[i] + factor * c[i]


@kernel(parallel=True)
def _triad_threaded(a, b, c, factor):
    for i in prange(a.size):
        a[i] = b[i] + factor * c[i]


def bandwidth(threads: int, mebibytes: int = 256) -> float:
    """Bytes per second of a[i] = b[i] + factor c[i] over arrays far larger than the caches."""
    n = mebibytes * 2**20 // 8
    a, b, c = np.zeros(n), np.ones(n), np.ones(n)
    triad: Callable = _triad if threads == 1 else _triad_threaded
    best = inf
    for _ in range(5):
        begun = time.perf_counter()
        triad(a, b, c, 0.5)
        best = min(best, time.perf_counter() - begun)
    return 24 * n / best
