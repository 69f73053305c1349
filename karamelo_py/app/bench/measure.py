"""The speed of a scene: time of its stages, bytes that it moves, bandwidth of the memory."""

import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import config

from karamelo_py.app.bench.workloads import MOST_STEPS, Workload
from karamelo_py.compiler.compile import index, shared
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.kernels.clock import finish
from karamelo_py.kernels.step import DONE, Fused, begin, step
from karamelo_py.kernels.sums import columns_of
from karamelo_py.kernels.sweep import sum_buffers, sweep_nodes, sweep_points
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.lower.memory import node_fields, nodes_in_use, point_fields
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

ARRAYS = 3 * 256 * 2**20  # bytes
REPETITIONS = 5
ALONE = 0.5  # the share of a step from which on something is said to limit it
APART = 1.5  # times a step in one compiled loop, up to which its sweeps one by one are believed


class Timed(NamedTuple):
    """A way of sweeping that notes how long each sweep took, then does as `mode` does.

    What it takes to call the same sweep over nothing is taken off.
    """

    mode: Any
    of_points: dict[str, list[float]]
    of_nodes: dict[str, list[float]]


class Measured(NamedTuple):
    """Measured speed of a workload.

    Attributes
    ----------
    points
        How many.
    speeds
        Particle-steps per second of each repetition.
    bytes_per_particle, bytes_per_step
        Those that a point holds, and those that move in a particle-step if no cache keeps them.
    roofline
        The share of the memory's bandwidth that these take at the best speed.
    roofline_in_place
        The same, of the bandwidth of arrays as large as the scene, which caches may keep.
    of_points, of_nodes
        Seconds per step in sweeps over points and over nodes, without the way there.
    waits
        Seconds per step of these in which threads begin and wait for each other.
    precision
        ``double`` or ``single``.
    """

    points: int
    speeds: list[float]
    bytes_per_particle: int
    bytes_per_step: float
    roofline: float
    roofline_in_place: float
    of_points: dict[str, float]
    of_nodes: dict[str, float]
    waits: float
    precision: str

    @property
    def best(self) -> float:
        """Particle-steps per second of the fastest repetition."""
        return max(self.speeds)

    @property
    def median(self) -> float:
        """Their median."""
        return statistics.median(self.speeds)

    @property
    def swept(self) -> float:
        """Sweeps one by one, as a share of a step in one compiled loop."""
        swept = sum(self.of_points.values()) + sum(self.of_nodes.values())
        return (swept - self.waits) * self.best / self.points

    @property
    def told_apart(self) -> bool:
        """True if sweeps are long enough to be timed one by one: of few points they are not."""
        return self.swept <= APART

    @property
    def rest(self) -> float:
        """The share of a step beside the work of sweeps: control, threads that wait."""
        return min(1.0, max(0.0, 1 - self.swept))

    @property
    def nodes(self) -> float:
        """The share of sweeps over nodes in the time of all sweeps."""
        nodes = sum(self.of_nodes.values())
        swept = nodes + sum(self.of_points.values())
        return nodes / swept if swept else 0.0

    @property
    def limit(self) -> str:
        """The first of these that takes at least half of a step.

        ``overhead`` (the rest), ``nodes``, ``memory`` (at least half of the bandwidth of arrays as
        large as the scene), else ``arithmetic``: sweeps over points that wait for instructions,
        or for single numbers, more than for bandwidth. ``unknown`` where sweeps are not
        `told_apart`.
        """
        if not self.told_apart:
            return "unknown"
        if self.rest >= ALONE:
            return "overhead"
        if self.nodes >= ALONE:
            return "nodes"
        return "memory" if self.roofline_in_place >= ALONE else "arithmetic"


def _name(*tags: Any) -> str:
    return " + ".join(type(tag).__name__ for tag in tags)


@sweep_points.on(Timed)
def _sweep_points_timed(mode, visit, s, block, then, gathers, scatters, dt):
    nothing = block._replace(tiling=block.tiling._replace(count=np.zeros(3, np.int64)))
    name = _name(*visit.tasks, *visit.quantities)
    with _noted(mode.of_points, name):
        sweep_points(mode.mode, visit, s, block, then, gathers, scatters, dt)
    with _noted(mode.of_points, name):
        sweep_points(mode.mode, visit, s, nothing, then, gathers, scatters, dt)


@sweep_nodes.on(Timed)
def _sweep_nodes_timed(mode, task, kin, nodes, ranges, dt):
    nothing = np.zeros_like(ranges)
    with _noted(mode.of_nodes, _name(task)):
        sweep_nodes(mode.mode, task, kin, nodes, ranges, dt)
    with _noted(mode.of_nodes, _name(task)):
        sweep_nodes(mode.mode, task, kin, nodes, nothing, dt)


@sum_buffers.on(Timed)
def _sum_buffers_timed(mode, quantities, s, due):
    for now in (due, False):
        with _noted(mode.of_nodes, "sums of " + _name(*quantities)):
            sum_buffers(mode.mode, quantities, s, now)


@contextmanager
def _noted(seconds: dict[str, list[float]], name: str) -> Iterator[None]:
    begun = time.perf_counter()
    yield
    seconds.setdefault(name, []).append(time.perf_counter() - begun)


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


def measured(
    simulation: Simulation,
    seconds: float,
    triad: float,
    lead: int = 3,
    repetitions: int = REPETITIONS,
) -> Measured:
    """Measure a scene for about so many seconds; `triad` is the bandwidth of the memory."""
    rates = speeds(simulation, seconds, lead, repetitions)
    per_step, held, regions = traffic(simulation)
    return Measured(
        simulation.count,
        rates,
        sum(size for _, _, size in point_fields(simulation.setup.blocks[0])),
        per_step,
        max(rates) * per_step / triad,
        max(rates) * per_step / bandwidth(simulation.threads, held),
        *stages(simulation, seconds / 4),
        regions * start_of_threads() if simulation.threads > 1 else 0.0,
        simulation.hub.settings.precision,
    )


def speeds(
    simulation: Simulation, seconds: float, lead: int = 3, repetitions: int = REPETITIONS
) -> list[float]:
    """Particle-steps per second of each repetition.

    Every repetition starts from the same state, that after `lead` steps.
    """
    timed_steps(simulation, lead)
    start = simulation.snapshot()
    count = step_count(timed_steps(simulation, 5) / 5, seconds, repetitions)
    rates = []
    for _ in range(repetitions):
        simulation.restore(start)
        rates.append(simulation.count * count / timed_steps(simulation, count))
    simulation.restore(start)
    return rates


def step_count(per_step: float, seconds: float, repetitions: int = REPETITIONS) -> int:
    """Steps of a repetition, where one takes so long and all together about `seconds`."""
    return min(max(5, int(seconds / repetitions / per_step)), MOST_STEPS)


def timed_steps(simulation: Simulation, count: int) -> float:
    """Seconds that `count` steps take."""
    begun = time.perf_counter()
    if simulation.advance(count) != DONE:
        raise ScriptError("a workload went wrong")
    return time.perf_counter() - begun


def stages(simulation: Simulation, seconds: float) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds per step in each sweep of a fused step over points and over nodes.

    They are called one by one, some in each step more than once; sums of medians.
    """
    s, scheme = simulation.setup, simulation.hub.update.scheme
    timed = Timed(simulation.mode, {}, {})
    begin(scheme, Fused(), timed, s)
    _take_step(simulation, timed)
    timed.of_points.clear()
    timed.of_nodes.clear()
    count = 0
    begun = time.perf_counter()
    while count < 3 or (time.perf_counter() - begun < seconds and count < MOST_STEPS):
        _take_step(simulation, timed)
        count += 1
        clock = s.control.clock[0]
        if clock.drift > clock.drift_limit:  # points would give nothing any more
            simulation.sort()
            begin(scheme, Fused(), simulation.mode, s)
    of_points, of_nodes = (
        {name: _per_step(taken, count) for name, taken in kind.items()} for kind in timed[1:]
    )
    return of_points, of_nodes


def _per_step(taken: list[float], count: int) -> float:
    real, way = taken[::2], taken[1::2]  # a sweep, then the same over nothing
    return len(real) / count * max(0.0, statistics.median(real) - statistics.median(way))


def _take_step(simulation: Simulation, mode: Any) -> None:
    s, scheme = simulation.setup, simulation.hub.update.scheme
    if not step(scheme, Fused(), mode, s, simulation.hooks, True):
        raise ScriptError("a workload went wrong")
    finish(s.control)


class _Recorder(NamedTuple):
    """Sweeps nothing, and notes what a sweep would read and write."""

    points: list
    nodes: list
    sums: list
    regions: list  # how often threads begin and wait for each other


@sweep_points.on(_Recorder)
def _sweep_points_recorder(mode, visit, s, block, then, gathers, scatters, dt):
    reads = {name for tag in (*visit.tasks, *visit.quantities) for name in tag.reads}
    writes = {name for tag in visit.tasks for name in tag.writes}
    mode.points.extend((*reads, *writes))
    mode.regions.append(1)


@sweep_nodes.on(_Recorder)
def _sweep_nodes_recorder(mode, task, kin, nodes, ranges, dt):
    mode.nodes.extend(task.goes_through)
    mode.regions.append(1)


@sum_buffers.on(_Recorder)
def _sum_buffers_recorder(mode, quantities, s, due):
    if due:
        there = {type(one) for one in s.nodes.fields}
        columns = columns_of(quantities, s.kin)
        mode.sums.extend(b - a for array, a, b in columns if type(array) is str or array in there)
        mode.regions.append(1)


def traffic(simulation: Simulation) -> tuple[float, float, int]:
    """Bytes per particle-step that have to move if nothing stays in a cache; what else follows.

    The others are the bytes that the scene holds, and how often in a step threads begin.

    Fields of the points count once for each sweep that reads and once for each that writes them;
    of node fields, those that loops over nodes go through; of the tiles' buffers, what is given to
    them and summed.
    """
    s, scheme = simulation.setup, simulation.hub.update.scheme
    recorder = _Recorder([], [], [], [])
    control = s.control
    kept = control.values.copy(), control.clock.copy()
    step(scheme, Fused(), recorder, s, simulation.hooks, True)
    control.values[:], control.clock[:] = kept
    of_point = {name: size for name, _, size in point_fields(s.blocks[0])}
    of_node = {name: array.itemsize * array.shape[1] for name, array in node_fields(s)}
    active = nodes_in_use(s)
    given = sum(float(np.ptp(b.tiling.buffer[: b.tiling.count[0], :2])) for b in s.blocks)
    total = simulation.count * sum(of_point.get(name, 0) for name in recorder.points)
    total += active * sum(of_node.get(name, 0) for name in recorder.nodes)
    total += (active + 2 * given) * sum(recorder.sums) * s.nodes.sums.itemsize
    held = simulation.count * sum(of_point.values()) + active * sum(of_node.values())
    return total / simulation.count, held, sum(recorder.regions)


def _triad_part(a, b, c, factor, parts, k):
    for i in range(a.size * k // parts, a.size * (k + 1) // parts):
        a[index(i)] = b[index(i)] + factor * c[index(i)]


_triad_parts = shared_out(shared(_triad_part), "a, b, c, factor, parts")


@kernel
def _triad(mode, a, b, c, factor, parts, times):
    for _ in range(times):
        _triad_parts(mode, parts, a, b, c, factor, parts)


def _fastest(calls: int, act: Callable, *arguments: Any) -> float:
    best = inf
    for _ in range(calls):
        begun = time.perf_counter()
        act(*arguments)
        best = min(best, time.perf_counter() - begun)
    return best


def bandwidth(threads: int, size: float = ARRAYS) -> float:
    """Bytes per second of a[i] = b[i] + factor c[i] over three arrays of `size` bytes together.

    By default they are far larger than the caches.
    """
    n = max(1000, int(size / 24))
    a, b, c = np.zeros(n), np.ones(n), np.ones(n)
    mode = Serial() if threads == 1 else Threaded()
    calls, times = (5, 1) if size >= ARRAYS else (20, 100)
    return 24 * n * times / _fastest(calls, _triad, mode, a, b, c, 0.5, threads, times)


def start_of_threads() -> float:
    """Seconds that it takes threads to begin and to wait for each other, for next to no work."""
    return _fastest(200, _triad, Threaded(), *np.ones((3, 64)), 0.5, config.NUMBA_NUM_THREADS, 1)
