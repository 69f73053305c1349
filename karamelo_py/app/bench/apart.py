"""One of several workloads measured by a process of its own: karamelo-py bench.

What workloads before it leave in memory has no part in its speed then. This module is the program
of that process, too: ``python -m karamelo_py.app.bench.apart``, which takes a `Measurement` from
its input and gives what it finds to its output, in JSON. It ends with the process that has started
it.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any, NamedTuple

from karamelo_py.app.bench import measure
from karamelo_py.app.bench.measure import Measured
from karamelo_py.app.bench.workloads import WORKLOADS
from karamelo_py.app.cli import outcome_of
from karamelo_py.app.together import Outcome
from karamelo_py.script.errors import ScriptError

_SIGNALS = {one.value: one.name for one in signal.Signals}
COMMAND = (sys.executable, "-m", "karamelo_py.app.bench.apart")


class Measurement(NamedTuple):
    """Arguments of one measurement; `triad` is the bandwidth of the memory (bytes/s)."""

    workload: str
    threads: int
    presets: dict[str, str]
    seconds: float
    triad: float
    debug: bool


def measured(part: Measurement) -> Measured:
    """Measure a workload in this process."""
    workload = WORKLOADS[part.workload]
    simulation = measure.build(workload, part.threads, part.presets)
    return measure.measured(simulation, part.seconds, part.triad, workload.lead)


def measured_apart(part: Measurement) -> Measured | Outcome:
    """Measure a workload in a process of its own; how that has ended where it went wrong."""
    # A session of its own: Ctrl-C comes to this process alone.
    process = subprocess.Popen(
        COMMAND, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    try:
        with suppress(BrokenPipeError):  # of one that has ended before it was told what to do
            process.stdin.write(json.dumps(part).encode() + b"\n")
        answer = process.stdout.read()
    except BaseException:
        process.kill()
        raise
    finally:
        process.stdin.close()
        process.stdout.close()
        status = process.wait()
    if not answer:
        by = f"with the status {status}" if status >= 0 else f"by {_SIGNALS.get(-status, -status)}"
        raise ScriptError(f"{part.workload} could not be measured: its process was ended {by}")
    found = json.loads(answer)
    return Measured(**found["measured"]) if "measured" in found else Outcome(**found)


def main() -> None:
    """Measure what the input says, and give what is found to the output."""
    answers, sys.stdout = sys.stdout, sys.stderr
    part = Measurement(*json.loads(sys.stdin.readline()))
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    found: dict[str, Any] = {}

    def act() -> int:
        from karamelo_py.compiler.threads import set_threads

        set_threads(part.threads)
        found["measured"] = measured(part)._asdict()
        return 0

    outcome = outcome_of(act, debugging=part.debug)
    print(json.dumps(found or outcome._asdict()), file=answers, flush=True)


def _end_with_the_other() -> None:
    """End where nobody waits for what is found any more: the input is closed then."""
    os.read(0, 1)
    os._exit(0)


if __name__ == "__main__":
    main()
