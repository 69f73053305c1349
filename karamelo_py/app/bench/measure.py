"""Speed of a scene, memory traffic and bandwidth."""

import statistics
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import config

from karamelo_py.app.launch import share
from karamelo_py.compiler import index, kernel
from karamelo_py.compiler.threads import Serial, Threaded, new_team, shared_out
from karamelo_py.kernels.arrays import NoHooks
from karamelo_py.kernels.clock import finish
from karamelo_py.kernels.step import DONE, Fused, StepKind, begin, step
from karamelo_py.kernels.sums import columns_of
from karamelo_py.kernels.sweep import sum_buffers, sweep_nodes, sweep_points
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.lower.memory import node_fields, nodes_in_use, point_fields
from karamelo_py.run.mpi.comm import MpiComm
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

MOST_STEPS = 2500  # number of steps after which points may leave the domain
ARRAYS = 3 * 256 * 2**20  # bytes, far more than caches hold
REPETITIONS = 5
ALONE = 0.5  # fraction of a step above which a component limits it
APART = 1.5  # largest trusted ratio of the time of separate sweeps to the time of a compiled step


class Workload(NamedTuple):
    title: str
    script: str
    lead: int = 3  # steps taken before the measurement
    karamelo: float | None = None  # published speed, million/s on one core of a small AMD EPYC


def _read_workloads() -> dict[str, Workload]:
    path = Path(__file__).with_name("workloads.toml")
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    texts = tables["scenes"]

    def workload(
        *, title: str, scenes: Sequence[str], variables: Mapping[str, str | int],
        method: str = "ulmpm, FLIP, linear, 1", scheme: str = "musl", precision: str = "double",
        **rest,
    ) -> Workload:  # fmt: skip
        lines = [f"precision({precision})", f"method({method})", f"scheme({scheme})"]
        for name, value in variables.items():
            lines.append(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}")
        return Workload(title, "\n".join([*lines, *(texts[name] for name in scenes)]), **rest)

    return {name: workload(**each) for name, each in tables["workloads"].items()}


WORKLOADS = _read_workloads()


class Timed(NamedTuple):
    """One row of a step, timed alternately with and without points."""

    mode: Any
    of_points: dict[str, list[float]]
    of_nodes: dict[str, list[float]]


class Measured(NamedTuple):
    points: int
    speeds: list[float]
    bytes_per_particle: int
    bytes_per_particle_step: float  # memory traffic without caches
    roofline: float  # fraction of the memory bandwidth at the best speed
    roofline_in_place: float  # fraction of the bandwidth measured on arrays as large as the scene
    sweeps_of_points: dict[str, float]
    sweeps_of_nodes: dict[str, float]
    waits: float  # seconds per step to start and join threads
    precision: str

    @property
    def best(self) -> float:
        return max(self.speeds)

    @property
    def median(self) -> float:
        return statistics.median(self.speeds)

    @property
    def swept(self) -> float:
        swept = sum(self.sweeps_of_points.values()) + sum(self.sweeps_of_nodes.values())
        return (swept - self.waits) * self.best / self.points

    @property
    def distinguished(self) -> bool:
        return self.swept <= APART

    @property
    def rest(self) -> float:
        """Fraction of the step spent in control flow and waiting for threads."""
        return min(1.0, max(0.0, 1 - self.swept))

    @property
    def nodes(self) -> float:
        nodes = sum(self.sweeps_of_nodes.values())
        swept = nodes + sum(self.sweeps_of_points.values())
        return nodes / swept if swept else 0.0

    @property
    def limit(self) -> str:
        """The component that takes at least half of a step: ``overhead``, ``nodes`` or ``memory``.

        The result is ``arithmetic`` (instructions or latency) if no component takes half of a step;
        ``unknown`` if not `distinguished`.
        """
        if not self.distinguished:
            return "unknown"
        if self.rest >= ALONE:
            return "overhead"
        if self.nodes >= ALONE:
            return "nodes"
        return "memory" if self.roofline_in_place >= ALONE else "arithmetic"

    def record(self) -> dict[str, Any]:
        speeds = {"best": self.best, "median": self.median, "limited_by": self.limit}
        return speeds | {"share_of_nodes": self.nodes, "share_of_rest": self.rest} | self._asdict()


class Solved(NamedTuple):
    points: int
    speeds: list[float]
    unknowns: int
    corrections: float  # Newton iterations per step
    stages: dict[str, float]
    precision: str

    best = Measured.best
    median = Measured.median

    def record(self) -> dict[str, Any]:
        return {"best": self.best, "median": self.median} | self._asdict()


def _name(*tags: Any) -> str:
    return ", ".join(tag.says or type(tag).__name__ for tag in tags)


@sweep_points.on(Timed)
def _sweep_points_timed(mode, visit, s, block):
    nothing = block._replace(tiling=block.tiling._replace(count=np.zeros(3, np.int64)))
    for swept in (block, nothing):
        with _noted(mode.of_points, _name(*visit.tasks, *visit.quantities)):
            sweep_points(mode.mode, visit, s, swept)


@sweep_nodes.on(Timed)
def _sweep_nodes_timed(mode, task, s, dt):
    for swept in (s, s._replace(ranges=np.zeros_like(s.ranges))):
        with _noted(mode.of_nodes, _name(task)):
            sweep_nodes(mode.mode, task, swept, dt)


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
    workload: Workload, threads: int | None, presets: Mapping[str, str],
    comm: MpiComm | None = None, card: Any = None,
) -> Simulation:  # fmt: skip
    hub = Hub(Console(quiet=True))
    hub.settings.threads = threads
    if card is not None:
        hub.settings.engine, hub.settings.card = "gpu", card
    if comm is not None:
        share(hub, comm)
    hub.interpreter = Interpreter(hub, presets=presets)
    hub.interpreter.run_text(workload.script, "bench")
    hub.simulation.begin(inf)
    return hub.simulation


def measured(simulation: Simulation, seconds: float, triad: float, lead: int) -> Measured | Solved:
    if simulation.implicit:
        return _solved(simulation, seconds, lead)
    count, times = repeated(simulation, seconds, lead)
    rates = [simulation.count * count / taken for taken, _ in times]
    per_step, scene_bytes, regions = traffic(simulation)
    return Measured(
        simulation.count,
        rates,
        sum(size for _, _, size in point_fields(simulation.setup.blocks[0])),
        per_step,
        max(rates) * per_step / triad,
        max(rates) * per_step / bandwidth(simulation.threads, scene_bytes),
        *stages(simulation, seconds / 4),
        regions * start_of_threads() if simulation.threads > 1 else 0.0,
        simulation.hub.settings.precision,
    )


def _solved(simulation: Simulation, seconds: float, lead: int) -> Solved:
    timed_steps(simulation, lead)
    steps, before = simulation.load_steps, simulation.step
    steps.seconds.clear()
    steps.corrections = 0
    taken = timed_steps(simulation, 5)
    fractions = {stage: spent / taken for stage, spent in steps.seconds.items()}
    corrections = steps.corrections / (simulation.step - before)
    count, times = repeated(simulation, seconds, 0)
    rates = [simulation.count * count / spent for spent, _ in times]
    fractions["rest"] = 1 - sum(fractions.values())
    precision = simulation.hub.settings.precision
    return Solved(simulation.count, rates, steps.unknowns, corrections, fractions, precision)


def repeated(
    simulation: Simulation, seconds: float, lead: int
) -> tuple[int, list[tuple[float, np.ndarray]]]:
    """Repeat steps from the state after `lead` steps, for `seconds` in total.

    Returns the number of steps per repetition and, for each repetition, its duration and the time
    that each process waited, in seconds.
    """
    timed_steps(simulation, lead)
    start = simulation.snapshot()
    count = int(seconds / REPETITIONS / (timed_steps(simulation, 5) / 5))
    count = simulation.comm.bcast(min(max(5, count), MOST_STEPS))
    times = []
    for _ in range(REPETITIONS):
        simulation.restore(start)
        before, begun = _waits(simulation), time.perf_counter()
        timed_steps(simulation, count)
        after = _waits(simulation)  # synchronises the processes
        times.append((time.perf_counter() - begun, after - before))
    simulation.restore(start)
    return count, times


def _waits(simulation: Simulation) -> np.ndarray:
    return np.array(simulation.comm.allgather(simulation.comm.waited))


def timed_steps(simulation: Simulation, count: int) -> float:
    card = simulation.hub.settings.card
    wait = card.wait if card else lambda: None
    wait()
    begun = time.perf_counter()
    if simulation.advance(count) != DONE:
        raise ScriptError("a workload went wrong")
    wait()
    return time.perf_counter() - begun


def stages(simulation: Simulation, seconds: float) -> tuple[dict[str, float], dict[str, float]]:
    s, scheme = simulation.setup, simulation.hub.update.scheme
    timed = Timed(simulation.mode, {}, {})
    begin(StepKind(scheme, Fused(), timed), s, NoHooks(), True)
    _take_step(simulation, timed)
    timed.of_points.clear()
    timed.of_nodes.clear()
    count = 0
    begun = time.perf_counter()
    while count < 3 or (time.perf_counter() - begun < seconds and count < MOST_STEPS):
        _take_step(simulation, timed)
        count += 1
        motion = s.control.motion[0]
        if motion.drift > motion.drift_limit:  # points must be sorted into tiles again
            simulation.sort()
            begin(StepKind(scheme, Fused(), simulation.mode), s, NoHooks(), True)
    of_points, of_nodes = (
        {name: _per_step(taken, count) for name, taken in kind.items()} for kind in timed[1:]
    )
    return of_points, of_nodes


def _per_step(taken: list[float], count: int) -> float:
    real, way = taken[::2], taken[1::2]  # steps with and without points alternate
    return len(real) / count * max(0.0, statistics.median(real) - statistics.median(way))


def _take_step(simulation: Simulation, mode: Any) -> None:
    s, scheme = simulation.setup, simulation.hub.update.scheme
    if not step(StepKind(scheme, Fused(), mode), s, simulation.hooks, True):
        raise ScriptError("a workload went wrong")
    finish(s.control)


class _Recorder(NamedTuple):
    points: list
    nodes: list
    sums: list
    regions: list


@sweep_points.on(_Recorder)
def _sweep_points_recorder(mode, visit, s, block):
    reads = {name for tag in (*visit.tasks, *visit.quantities) for name in tag.reads}
    writes = {name for tag in visit.tasks for name in tag.writes}
    mode.points.extend((*reads, *writes))
    mode.regions.append(1)


@sweep_nodes.on(_Recorder)
def _sweep_nodes_recorder(mode, task, s, dt):
    mode.nodes.extend(task.goes_through)
    mode.regions.append(1)


@sum_buffers.on(_Recorder)
def _sum_buffers_recorder(mode, quantities, s, due):
    if due:
        kinds = {type(one) for one in s.nodes.fields}
        columns = columns_of(quantities, s.kin)
        mode.sums.extend(b - a for array, a, b in columns if type(array) is str or array in kinds)
        mode.regions.append(1)


def traffic(simulation: Simulation) -> tuple[float, float, int]:
    """Return bytes per particle-step without caches, bytes of the scene, and parallel regions.

    Point fields count in each sweep that reads or writes them, node fields in node loops, and
    buffers when they are written and when they are summed.
    """
    s, scheme = simulation.setup, simulation.hub.update.scheme
    recorder = _Recorder([], [], [], [])
    control = s.control
    before = control.values.copy(), control.clock.copy()
    step(StepKind(scheme, Fused(), recorder), s, simulation.hooks, True)
    control.values[:], control.clock[:] = before
    of_point = {name: size for name, _, size in point_fields(s.blocks[0])}
    of_node = {name: array.itemsize * array.shape[1] for name, array in node_fields(s)}
    active = nodes_in_use(s)
    buffered = sum(float(np.ptp(b.tiling.buffer[: b.tiling.count[0], :2])) for b in s.blocks)
    total = simulation.count * sum(of_point.get(name, 0) for name in recorder.points)
    total += active * sum(of_node.get(name, 0) for name in recorder.nodes)
    total += (active + 2 * buffered) * sum(recorder.sums) * s.nodes.sums.itemsize
    scene_bytes = simulation.count * sum(of_point.values()) + active * sum(of_node.values())
    return total / simulation.count, scene_bytes, sum(recorder.regions)


@shared_out
def _triad_parts(a, b, c, factor, parts, k):
    for i in range(a.size * k // parts, a.size * (k + 1) // parts):
        a[index(i)] = b[index(i)] + factor * c[index(i)]


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
    """Return the bandwidth in bytes/s of a[i] = b[i] + factor c[i], on arrays of `size` bytes."""
    n = max(1000, int(size / 24))
    a, b, c = np.zeros(n), np.ones(n), np.ones(n)
    team = new_team(threads)
    mode = Serial() if threads == 1 else Threaded(team.ctypes.data)
    calls, times = (5, 1) if size >= ARRAYS else (20, 100)
    return 24 * n * times / _fastest(calls, _triad, mode, a, b, c, 0.5, threads, times)


def start_of_threads() -> float:
    return _fastest(200, _triad, Threaded(), *np.ones((3, 64)), 0.5, config.NUMBA_NUM_THREADS, 1)
