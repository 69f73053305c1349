"""karamelo-py bench: how fast this machine runs known scenes, and how near that is to its limits.

Speeds are of the fastest of several repetitions; they are meant for comparison within one run of
this command, since machines are shared and their clocks change.
"""

from __future__ import annotations

import statistics
import time
from argparse import ArgumentTypeError
from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from karamelo_py.cli import CommandLine, threads_option
from karamelo_py.compile import kernel
from karamelo_py.console import Console
from karamelo_py.hub import Hub
from karamelo_py.kernels.step import DONE, Fused, begin, finish, step
from karamelo_py.kernels.sweep import sweep_nodes, sweep_tiles
from karamelo_py.report import point_fields
from karamelo_py.script.errors import ScriptError, nearest
from karamelo_py.script.interpreter import Interpreter
from karamelo_py.simulation import Simulation

DISKS = """
h = 1/N
method(kind, transfer, basis, option)
scheme(style)
dimension(2, -0.5, 0.5, -0.5, 0.5, h)
region(lower, cylinder, -0.3, -0.3, 0.2)
region(upper, cylinder, 0.3, 0.3, 0.2)
material(rubber, law, 1000, 1000, 0.3)
solid(disk1, region, lower, 2, rubber, h, 0)
solid(disk2, region, upper, 2, rubber, h, 0)
group(disk1, particles, region, lower, solid, disk1)
group(disk2, particles, region, upper, solid, disk2)
fix(v1, initial_velocity_particles, disk1, 0.1, 0.1)
fix(v2, initial_velocity_particles, disk2, -0.1, -0.1)
set_dt(0.02*h)
"""

FORMULA = """
fix(load, body_force, all, 1e-3*sin(x0)*cos(time), 1e-3*y0*time)
"""

BLOCK = """
h = 1/N
method(kind, transfer, basis, option)
scheme(style)
dimension(3, 0, 2, 0, 2, 0, 2, h)
region(cube, block, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5)
material(rubber, law, 1000, 1000, 0.3)
solid(cube, region, cube, 2, rubber, h, 0)
fix(v, initial_velocity_particles, all, 0.1*y0, 0.1*z0, 0.1*x0)
set_dt(0.02*h)
"""
# The bar of Taylor's test (radius 3.8, length 25.4, cells of 0.25, one point a cell).
BAR = """
method(kind, transfer, basis, option)
scheme(style)
dimension(3, -10, 10, -10, 10, -1, 30, 0.25)
region(bar, cylinder, z, 0, 0, 3.8, 0, 25.4)
material(copper, law, 8.94e-6, 115, 0.31)
solid(bar, region, bar, 1, copper, 0.25, 0)
fix(v, initial_velocity_particles, all, 0, 0, -0.19*z0/25.4)
set_dt(1e-5)
"""
MOST_STEPS = 2500  # in these scenes nothing leaves the domain before


class Workload(NamedTuple):
    """A scene to be timed."""

    title: str
    script: str
    variables: dict[str, str]


# FLIP with linear functions and musl, unless a workload says otherwise.
USUAL = {
    "kind": "ulmpm", "transfer": "FLIP", "basis": "linear", "option": "1", "style": "musl",
    "law": "linear",
}  # fmt: skip
# The single pass of the fastest rivals.
SINGLE_PASS = {
    "transfer": "MLS", "basis": "quadratic-spline", "option": "mechanical", "style": "usl",
    "law": "neo-hookean",
}  # fmt: skip


def _workload(title: str, script: str, **variables: str) -> Workload:
    return Workload(title, script, {**USUAL, **variables})


WORKLOADS = {
    "disks-20": _workload("two disks, 20 cells a side", DISKS, N="20"),
    "disks-80": _workload("two disks, 80 cells a side", DISKS, N="80"),
    "disks-320": _workload("two disks, 320 cells a side", DISKS, N="320"),
    "disks-320-usl": _workload("the same with usl", DISKS, N="320", style="usl"),
    "disks-320-quadratic": _workload(
        "the same with quadratic splines", DISKS, N="320", basis="quadratic-spline"
    ),
    "disks-320-cubic": _workload(
        "the same with cubic splines", DISKS, N="320", basis="cubic-spline"
    ),
    "disks-320-q4": _workload(
        "the same with CPDI-Q4", DISKS, N="320", kind="ulcpdi", transfer="PIC", option="Q4"
    ),
    "disks-320-mls": _workload("the same with MLS, single pass", DISKS, N="320", **SINGLE_PASS),
    "disks-320-mls-single": _workload(
        "the same in single precision", "precision(single)\n" + DISKS, N="320", **SINGLE_PASS
    ),
    "disks-80-formula": _workload(
        "two disks with a body force by formula", DISKS + FORMULA, N="80"
    ),
    "block-3d": _workload("cube in 3D, 23 cells a side", BLOCK, N="23"),
    "block-3d-quadratic": _workload(
        "the same with quadratic splines", BLOCK, N="23", basis="quadratic-spline"
    ),
    "block-3d-mls": _workload("the same with MLS, single pass", BLOCK, N="23", **SINGLE_PASS),
    "block-3d-mls-single": _workload(
        "the same in single precision", "precision(single)\n" + BLOCK, N="23", **SINGLE_PASS
    ),
    "bar-3d-tl": _workload("Taylor's bar, total Lagrangian", BAR, kind="tlmpm"),
}


class Timed(NamedTuple):
    """A way of sweeping that notes how long each sweep took, then does as `mode` does."""

    mode: Any
    seconds: dict[str, float]


def _name(*tags: Any) -> str:
    return " + ".join(type(tag).__name__ for tag in tags if type(tag).__name__ != "Nothing")


@sweep_tiles.on(Timed)
def _(mode, gather, scatter, s, block, places, dt):
    begun = time.perf_counter()
    sweep_tiles(mode.mode, gather, scatter, s, block, places, dt)
    _note(mode, _name(gather, scatter), begun)


@sweep_nodes.on(Timed)
def _(mode, task, kin, nodes, spans, dt):
    begun = time.perf_counter()
    sweep_nodes(mode.mode, task, kin, nodes, spans, dt)
    _note(mode, _name(task), begun)


def _note(mode: Timed, name: str, begun: float) -> None:
    mode.seconds[name] = mode.seconds.get(name, 0.0) + time.perf_counter() - begun


def build(workload: Workload, threads: int | None) -> Simulation:
    """The simulation of a workload, ready to step."""
    hub = Hub(Console(quiet=True))
    hub.settings.threads = threads
    hub.interpreter = Interpreter(hub, presets=workload.variables)
    hub.interpreter.run_text(workload.script, "bench")
    simulation = hub.simulation
    simulation.begin(inf)
    return simulation


def speed(simulation: Simulation, seconds: float, repetitions: int = 5) -> tuple[float, float]:
    """Particle-steps per second: of the fastest repetition, and their median.

    Every repetition starts from the same state.
    """
    _advance(simulation, 3)
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

    traffic: list


@sweep_tiles.on(_Recorder)
def _(mode, gather, scatter, s, block, places, dt):
    mode.traffic.append(("points", set(gather.reads) | set(scatter.reads), set(gather.writes)))


@sweep_nodes.on(_Recorder)
def _(mode, task, kin, nodes, spans, dt):
    mode.traffic.append(("nodes", type(task).__name__, None))


# Node arrays that a task goes through, read and written once each.
NODE_TRAFFIC = {
    "ClearSums": (("sums", 1),),
    "ClearVelocity": (("velocity", 1),),
    "Update": (("sums", 1), ("update", 1)),
    "MomentumToVelocity": (("velocity", 2),),
    "SumsToVelocity": (("sums", 1), ("velocity", 1)),
    "UpdateToVelocity": (("update", 1), ("velocity", 1)),
    "ClearGrowth": (("growth", 1),),
    "AverageGrowth": (("growth", 2),),
    "StartSeries": (("sums", 1), ("series", 1), ("update", 2)),
    "ExtendSeries": (("sums", 1), ("series", 2), ("update", 2)),
}


def traffic(simulation: Simulation) -> float:
    """Bytes per particle-step that have to move if nothing stays in a cache.

    Fields of the points count once for each sweep that reads and once for each that writes them;
    of node fields, those that loops over nodes go through.
    """
    s, scheme = simulation.setup, simulation.hub.update.scheme
    recorder = _Recorder([])
    control = s.control
    kept = control.values.copy(), control.real.copy(), control.whole.copy()
    step(scheme, Fused(), recorder, s, simulation.hooks, True)
    control.values[:], control.real[:], control.whole[:] = kept
    sizes = {name: size for name, _, size in point_fields(s.blocks[0])}
    active = float(np.sum(s.spans[1 : 1 + s.spans[0, 0], 1] - s.spans[1 : 1 + s.spans[0, 0], 0]))
    total = 0.0
    for kind, first, second in recorder.traffic:
        if kind == "points":
            total += simulation.count * sum(sizes.get(n, 0) for n in (*first, *second))
        else:
            for field, times in NODE_TRAFFIC[first]:
                array = getattr(s.nodes, field)
                total += times * active * array.itemsize * array.shape[1]
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


def explanation() -> str:
    """How the subcommand is called, and what it can measure."""
    width = max(map(len, WORKLOADS))
    workloads = "".join(f"  {name:<{width}}  {w.title}\n" for name, w in WORKLOADS.items())
    return f"""\
karamelo-py bench [WORKLOAD ...] [--threads N] [--seconds S]

Measures the speed of this machine on known scenes, all or those that are named: particle-steps per
second of the fastest of five repetitions, bytes per particle, and the time of each stage of a step.

workloads:
{workloads}
options:
  --threads N        threads to use (default: 1)
  --seconds S        how long each scene is measured (default: 2)
"""


def main(arguments: list[str]) -> int:
    """The subcommand."""
    parser = CommandLine(prog="karamelo-py bench", add_help=False, allow_abbrev=False)
    parser.add_argument("workloads", nargs="*")
    parser.add_argument("--threads", type=threads_option, default=1)
    parser.add_argument("--seconds", type=_positive, default=2.0)
    parser.add_argument("--debug", action="store_true")
    options = parser.parse_args(arguments)
    for name in options.workloads:
        if name not in WORKLOADS:
            close = nearest(name, WORKLOADS)
            raise ScriptError(
                f"unknown workload '{name}'",
                expected="one of " + ", ".join(WORKLOADS),
                hint=f"did you mean '{close}'?" if close else None,
            )
    import numba

    available = numba.config.NUMBA_NUM_THREADS
    threads = min(options.threads or available, available)
    numba.set_num_threads(threads)
    triad = bandwidth(threads)
    print(f"threads {threads}, triad bandwidth {triad / 1e9:.1f} GB/s (256 MiB arrays)")
    for name in options.workloads or WORKLOADS:
        _print(name, WORKLOADS[name], threads, options.seconds, triad)
    return 0


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < inf:
        raise ArgumentTypeError(f"'{text}' is not a number of seconds above 0")
    return value


def _print(name: str, workload: Workload, threads: int, seconds: float, triad: float) -> None:
    simulation = build(workload, threads)
    best, median = speed(simulation, seconds)
    per_step = traffic(simulation)
    per_point = sum(size for _, _, size in point_fields(simulation.setup.blocks[0]))
    roof = triad / per_step
    print(f"\n{name}: {workload.title}; {simulation.count} points")
    print(f"  {'particle-steps/s':<34} {best / 1e6:8.2f} million (median {median / 1e6:.2f})")
    print(f"  {'bytes per particle':<34} {per_point:8d}")
    print(f"  {'bytes moved per particle-step':<34} {per_step:8.0f}")
    print(f"  {'share of the memory roofline':<34} {100 * best / roof:8.1f} %")
    total = 1e9 / best
    parts = stages(simulation, seconds / 4)
    for stage, per in parts.items():
        print(f"    {stage:<32} {1e9 * per / simulation.count:8.2f} ns")
    print(f"    {'together, in one compiled loop':<32} {total:8.2f} ns")
    if simulation.count < 10_000:
        print("    (one by one, each stage costs some microseconds to call from Python)")
