"""Measure workloads in separate processes, so that the memory of one does not affect another.

``python -m karamelo_py.app.bench.apart`` reads a `Measurement` in JSON from standard input, and
ends when the input is closed.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.bench import measure
from karamelo_py.app.bench.measure import WORKLOADS, Measured, Solved
from karamelo_py.app.launch import ERROR, keep_to_oneself, launch, outcome_of, together
from karamelo_py.output.files import read_json
from karamelo_py.run.mpi.comm import MpiComm
from karamelo_py.script.errors import ScriptError

_SIGNALS = {one.value: one.name for one in signal.Signals}
MODULE = "karamelo_py.app.bench.apart"
COMMAND = (sys.executable, "-m", MODULE)
USUAL = ("disks-320", "block-3d-mls", "bar-3d-ul", "dam-break")
HEADING = (
    f"  {'processes x threads':<22}{'points':>9} {'million/s':>10} {'times one':>10} "
    f"{'exchange':>9} {'imbalance':>10}"
)


class Measurement(NamedTuple):
    workload: str
    threads: int
    presets: dict[str, str]
    seconds: float
    triad: float = 0.0  # memory bandwidth, bytes/s
    debug: bool = False
    ranks: int = 1
    scaling: bool = False  # measure the scaling over processes (`Scaled`)
    file: str = ""


def measured(job: Measurement) -> Measured | Solved:
    workload = WORKLOADS[job.workload]
    simulation = measure.build(workload, job.threads, job.presets)
    return measure.measured(simulation, job.seconds, job.triad, workload.lead)


def measured_apart(job: Measurement) -> Measured | Solved | int:
    status, results = _found_apart(job)
    if results:
        return Solved(**results) if "stages" in results else Measured(**results)
    if status == ERROR:
        return status
    end = f"with the status {status}" if status >= 0 else f"by {_SIGNALS.get(-status, -status)}"
    raise ScriptError(f"{job.workload} could not be measured: its process was ended {end}")


def _found_apart(job: Measurement) -> tuple[int, dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "found.json"
        words = [json.dumps(job._replace(file=str(file)))]
        if job.ranks > 1:
            status = launch(job.ranks, words, module=MODULE)
        else:
            # Use a separate session, so that Ctrl-C is sent to this process only.
            with subprocess.Popen(
                [*COMMAND, *words], stdin=subprocess.PIPE, start_new_session=True
            ) as process:
                status = process.wait()
        return status, read_json(file)


class Scaled(NamedTuple):
    ranks: int
    threads: int
    weak: bool
    points: int
    best: float  # particle-steps per second
    exchange: float  # fraction of the time that the busiest process waits
    imbalance: float  # mean further fraction of the time that processes wait


def scaled(job: Measurement, ranks: Sequence[int], available: int) -> Iterator[Scaled]:
    counts = sorted({1, *ranks})
    for n in counts:
        yield measured_with_ranks(job._replace(ranks=n))
        if n > 1 and n * job.threads <= available:
            yield measured_with_ranks(job._replace(threads=n * job.threads))
    for n in counts[1:]:
        larger = job.presets | grown(WORKLOADS[job.workload].script, job.presets, n)
        yield measured_with_ranks(job._replace(ranks=n, presets=larger), weak=True)


def grown(script: str, presets: Mapping[str, str], times: int) -> dict[str, str]:
    d = int(re.search(r"dimension\((\d)", script)[1])
    name, value = re.search(r"^(N|coarser) = (\S+)$", script, re.M).groups()
    value = float(presets.get(name, value))
    if name == "N":
        return {name: str(round(value * times ** (1 / d)))}
    return {name: repr(value / times ** (1 / d))}


def measured_with_ranks(job: Measurement, *, weak: bool = False) -> Scaled:
    status, results = _found_apart(job._replace(scaling=True))
    if not results:
        why = f"ended by signal {abs(status) % 128}" if not 0 <= status < 128 else "see above"
        raise ScriptError(
            f"{job.workload} could not be measured with {job.ranks} x {job.threads}: {why}"
        )
    return Scaled(job.ranks, job.threads, weak, **results)


def _share(job: Measurement, comm: MpiComm | None = None) -> dict[str, Any]:
    workload = WORKLOADS[job.workload]
    simulation = measure.build(workload, job.threads, job.presets, comm)
    simulation.compile()
    count, times = measure.repeated(simulation, job.seconds, workload.lead)
    taken, waits = min(times, key=lambda one: one[0])
    least = float(np.min(waits))
    return {
        "points": simulation.count,
        "best": simulation.count * count / taken,
        "exchange": least / taken,
        "imbalance": (float(np.mean(waits)) - least) / taken,
    }


def line(row: Scaled, one: Scaled) -> str:
    who = f"{row.ranks} x {row.threads}" + (" (larger)" if row.weak else "")
    waits = f"{'-':>9} {'-':>10}"
    if row.ranks > 1:
        waits = f"{100 * row.exchange:>7.1f} % {100 * row.imbalance:>8.1f} %"
    speed = f"{row.best / 1e6:>10.2f} {row.best / one.best:>10.2f}"
    return f"  {who:<22}{row.points:>9} {speed} {waits}"


def main() -> int:
    job = Measurement(*json.loads(sys.argv[1]))
    keep_to_oneself()
    if job.ranks > 1:
        return together(job.ranks, lambda comm: _measure(job, comm))
    threading.Thread(target=lambda: (os.read(0, 1), os._exit(0)), daemon=True).start()
    status, text = outcome_of(lambda: _measure(job), debugging=job.debug)
    if text:
        print(text, file=sys.stderr, flush=True)
    return status


def _measure(job: Measurement, comm: MpiComm | None = None) -> int:
    results = _share(job, comm) if job.scaling else measured(job)._asdict()
    if comm is None or comm.leads:
        Path(job.file).write_text(json.dumps(results), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
