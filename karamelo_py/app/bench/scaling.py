"""Speeds with several processes, and with as many threads: karamelo-py bench --ranks 1,2,4.

Each is measured by processes of its own, started as those of a run. This module is their program,
too: ``python -m karamelo_py.app.bench.scaling`` with a `ScalingRun` in JSON.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.bench.measure import REPETITIONS, step_count, timed_steps
from karamelo_py.app.bench.workloads import WORKLOADS
from karamelo_py.app.cli import outcome_of
from karamelo_py.app.launch import launch
from karamelo_py.app.together import keep_to_oneself, share, together
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.mpi.comm import MpiComm
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

MODULE = "karamelo_py.app.bench.scaling"
# What is measured unless workloads are named: those whose scaling has an aim.
USUAL = ("disks-320", "block-3d-mls", "bar-3d-ul", "dam-break")


HEADING = (
    f"  {'processes x threads':<22}{'points':>9} {'million/s':>10} {'times one':>10} "
    f"{'exchange':>9} {'imbalance':>10}"
)


class ScalingRun(NamedTuple):
    """Arguments of one measurement, and the file for its result."""

    workload: str
    ranks: int
    threads: int
    presets: dict[str, str]
    seconds: float
    file: str = ""


class Scaled(NamedTuple):
    """Measured speed with some processes of some threads each.

    Attributes
    ----------
    points
        How many.
    best
        Particle-steps per second of the fastest repetition.
    exchange
        The share of its time that the process which waits least waits for what others send, or
        until it is sent.
    imbalance
        The share that the others wait longer than that one, their mean.
    """

    ranks: int
    threads: int
    weak: bool
    points: int
    best: float
    exchange: float
    imbalance: float


def scaled(
    name: str, ranks: Sequence[int], threads: int, presets: Mapping[str, str], seconds: float,
    available: int,
) -> Iterator[Scaled]:  # fmt: skip
    """Measure a workload with one process, then with several, or as many threads; then grown."""
    counts = sorted({1, *ranks})
    for n in counts:
        yield _measured(ScalingRun(name, n, threads, dict(presets), seconds))
        if n > 1 and n * threads <= available:
            yield _measured(ScalingRun(name, 1, n * threads, dict(presets), seconds))
    for n in counts[1:]:
        larger = dict(presets) | grown(WORKLOADS[name].script, presets, n)
        yield _measured(ScalingRun(name, n, threads, larger, seconds), weak=True)


def grown(script: str, presets: Mapping[str, str], times: int) -> dict[str, str]:
    """The variable for the size of a scene with so many times the points."""
    d = int(re.search(r"dimension\((\d)", script)[1])
    name, value = re.search(r"^(N|coarser) = (\S+)$", script, re.M).groups()
    value = float(presets.get(name, value))
    if name == "N":
        return {name: str(round(value * times ** (1 / d)))}
    return {name: repr(value / times ** (1 / d))}


def _waits(simulation: Any) -> np.ndarray:
    """Seconds that each process has waited for others in steps so far."""
    return np.array(simulation.comm.allgather(simulation.comm.waited))


def _measured(part: ScalingRun, *, weak: bool = False) -> Scaled:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "found.json"
        words = [json.dumps(part._replace(file=str(file)))]
        if part.ranks > 1:
            status = launch(part.ranks, words, module=MODULE)
        else:
            status = subprocess.run([sys.executable, "-m", MODULE, *words], check=False).returncode
        if status or not file.exists():
            why = f"ended by signal {abs(status) % 128}" if not 0 <= status < 128 else "see above"
            raise ScriptError(
                f"{part.workload} could not be measured with {part.ranks} x {part.threads}: {why}"
            )
        found = json.loads(file.read_text(encoding="utf-8"))
    return Scaled(part.ranks, part.threads, weak, **found)


def measure(part: ScalingRun, comm: MpiComm | None = None) -> int:
    """Measure as one of the processes; the first writes what is found."""
    hub = Hub(Console(quiet=True))
    hub.settings.threads = part.threads
    if comm is not None:
        share(hub, comm)
    hub.interpreter = Interpreter(hub, presets=part.presets)
    workload = WORKLOADS[part.workload]
    hub.interpreter.run_text(workload.script, "bench")
    simulation = hub.simulation
    hub.running = SimpleNamespace(rollback=None)
    simulation.begin(inf)
    simulation.compile()
    timed_steps(simulation, workload.lead)
    start = simulation.snapshot()
    count = simulation.comm.bcast(step_count(timed_steps(simulation, 5) / 5, part.seconds))
    found = []
    for _ in range(REPETITIONS):
        simulation.restore(start)
        before, begun = _waits(simulation), time.perf_counter()
        timed_steps(simulation, count)
        after = _waits(simulation)  # all have finished then
        taken = time.perf_counter() - begun
        found.append((taken, (after - before) / taken))
    taken, waits = min(found, key=lambda one: one[0])
    if simulation.comm.leads:
        least = float(np.min(waits))
        file = {
            "points": simulation.count,
            "best": simulation.count * count / taken,
            "exchange": least,
            "imbalance": float(np.mean(waits)) - least,
        }
        Path(part.file).write_text(json.dumps(file), encoding="utf-8")
    return 0


def line(row: Scaled, one: Scaled) -> str:
    """A line of the table: speeds, and their ratios to that of one process."""
    who = f"{row.ranks} x {row.threads}" + (" (larger)" if row.weak else "")
    shares = f"{'-':>9} {'-':>10}"
    if row.ranks > 1:
        shares = f"{100 * row.exchange:>7.1f} % {100 * row.imbalance:>8.1f} %"
    speed = f"{row.best / 1e6:>10.2f} {row.best / one.best:>10.2f}"
    return f"  {who:<22}{row.points:>9} {speed} {shares}"


def main() -> int:
    """Measure what the command line says, as one of several processes or alone."""
    part = ScalingRun(*json.loads(sys.argv[1]))
    keep_to_oneself()
    if part.ranks > 1:
        return together(part.ranks, lambda comm: measure(part, comm), outcome_of)
    return measure(part)


if __name__ == "__main__":
    sys.exit(main())
