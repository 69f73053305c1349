"""A run of a study, and the facts in its run.json."""

import hashlib
import json
import os
import re
import select
import shlex
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import karamelo_py
from karamelo_py.app.leaving import STUDY
from karamelo_py.app.studies.warm import WarmProcesses
from karamelo_py.output.files import read_json, reported, write_whole
from karamelo_py.output.record import NAME
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.terms import number_of

Row = Mapping[str, Any]
Record = Mapping[str, Any]
KEPT = "case.json"
WAIT4 = hasattr(os, "wait4")
PROGRAM = [sys.executable, "-m", "karamelo_py.app.cli"]
# Codes of errors before the first step that are not due to the script. Errors of the program, and
# of another run in the folder, have none.
_NOT_OF_SCRIPT = ("memory", "step-above-limit")
_NOT_OF_RUN = ("internal", "busy")


@dataclass
class CaseOutcome:
    """Status: ``done``, ``failed``, ``refused`` (before any step), ``too long`` or ``killed``."""

    status: str
    reason: str = ""  # why the run is not done
    facts: dict[str, float] = field(default_factory=dict)
    folder: Path = Path()
    code: str = ""  # code of the error that ended the run
    machine: str = ""

    @property
    def complaint(self) -> str:
        return said_in(self.folder / "err.txt")


# Columns measured for every run, with titles of axes.
COLUMNS = {
    "seconds": "time of the stepping loop (s)",  # without compilation and output
    "cpu_seconds": "processor time of the stepping loop (s)",  # sum over all threads
    "seconds_spread": "spread of that time over repetitions (s)",  # largest minus smallest time
    "particle_steps_per_s": "particle-steps per second",
    "particle_steps": "steps times points",
    "node_visits": "steps times points times nodes of a point",
    "steps": "steps",  # sum over all runs of the script
    "points": "points",  # number at the beginning
    "dt": "first step (time of the script)",
    "stable_dt": "stable step (time of the script)",  # step at the beginning
    "own_dt": "the program's own step (time of the script)",
    "path": "path of the fastest points (cells)",  # upper bound of the path
    "bytes_per_particle": "bytes per particle",  # all fields, mean over points
    "peak_memory_mib": "peak memory (MiB)",
    "wall_s": "time of the process (s)",
}


def worded(case: Row) -> str:
    return ", ".join(f"{name} = {value}" for name, value in case.items())


def said_in(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


class Refused(ScriptError):
    def __init__(self, case: Mapping[str, str], outcome: CaseOutcome):
        super().__init__(outcome.reason)
        message = error_of(record_of(outcome.folder)).get("rendered", outcome.complaint.rstrip())
        self._whole = f"{message}\nthis is the script with {worded(case)}"

    def render(self) -> str:
        return self._whole


class Stop(Exception):
    """Raised to end the study and its runs."""


@dataclass
class Launch:
    script: Path
    threads: int = 1  # threads of each run
    repeat: int = 1  # runs of each case; the time is their median
    limit: float | None = None  # seconds after which a case is killed
    texts: tuple[str, ...] = ()  # contents of the script and its includes
    stop: threading.Event = field(default_factory=threading.Event)
    warm: WarmProcesses = field(default_factory=lambda: WarmProcesses(environment()))

    def key(self, case: Mapping[str, str]) -> str:
        parts = [karamelo_py.__version__, *self.texts, str(self.threads), str(self.repeat)]
        parts += [f"{name}={value}" for name, value in case.items()]
        parts.append(os.environ.get("NUMBA_DISABLE_JIT", "0"))
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()

    def kept(self, case: Mapping[str, str], folder: Path) -> CaseOutcome | None:
        """Return the stored outcome, or None if the case must run again."""
        stored = read_json(folder / KEPT)
        if stored.get("key") != self.key(case):
            return None
        if stored["status"] in ("killed", "refused") or stored.get("code") in _NOT_OF_RUN:
            return None
        if stored["status"] == "too long" and (self.limit or 1e300) > stored["facts"]["wall_s"]:
            return None
        fields = ("status", "reason", "facts", "code", "machine")
        return CaseOutcome(folder=folder, **{name: stored.get(name, "") for name in fields})

    def run(self, case: Mapping[str, str], folder: Path) -> CaseOutcome:
        with reported(folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / KEPT).unlink(missing_ok=True)
        outcomes = []
        for _ in range(self.repeat):
            outcomes.append(self._once(case, folder))
            if outcomes[-1].status != "done":
                break
        outcome = outcomes[-1]
        outcome.machine = socket.gethostname()
        facts = outcome.facts
        for name in ("cpu_seconds", "seconds"):
            seconds = [o.facts[name] for o in outcomes if name in o.facts]
            if self.repeat > 1 and seconds:
                facts[name] = statistics.median(seconds)
                facts["seconds_spread"] = max(seconds) - min(seconds)
        if "particle_steps" in facts and facts["seconds"] > 0:
            facts["particle_steps_per_s"] = facts["particle_steps"] / facts["seconds"]
        end = {name: vars(outcome)[name] for name in ("status", "reason", "code", "machine")}
        record = {"key": self.key(case), "variables": dict(case), **end, "facts": facts}
        write_whole(folder / KEPT, json.dumps(record, indent=1))
        return outcome

    def _once(self, case: Mapping[str, str], folder: Path) -> CaseOutcome:
        words = [str(self.script.resolve()), *options_of(case), "--threads", str(self.threads)]
        words += ["-record", NAME]
        for name in ("log.mpm", NAME):
            (folder / name).unlink(missing_ok=True)
        begun = time.perf_counter()
        with (folder / "out.txt").open("wb") as out, (folder / "err.txt").open("wb") as err:
            pid = self.warm.start(kind_of(case.values()), words, folder, (out, err))
            process: Any = SimpleNamespace(pid=pid, returncode=None)
            if process.pid is None:
                process = subprocess.Popen(
                    [*PROGRAM, *words], cwd=folder, stdin=subprocess.DEVNULL, stdout=out,
                    stderr=err, env=environment(), start_new_session=os.name == "posix",
                )  # fmt: skip
            memory, overdue = self._wait(process, begun)
        record = record_of(folder)
        facts = facts_of(record)
        facts["wall_s"] = time.perf_counter() - begun
        if memory:
            facts["peak_memory_mib"] = memory
        if overdue:
            return CaseOutcome("too long", f"given up after {self.limit:g} s", facts, folder)
        if process.returncode < 0:
            return CaseOutcome("killed", f"ended by signal {-process.returncode}", facts, folder)
        outcome = CaseOutcome("done", "", facts, folder)
        if not process.returncode and record.get("status") != "finished":
            raise ScriptError(f"{folder / NAME} is not complete: is the disk full?")
        if process.returncode:
            error = error_of(record)
            last = outcome.complaint.rstrip().splitlines()[-1:]
            outcome.status, outcome.code = "failed", error.get("code", "")
            outcome.reason = error.get("text") or [*last, "ended without a message"][0].strip()
            if "cause" in error:
                outcome.reason += f"; likely cause: {error['cause']}"
            if "points" not in facts and outcome.code not in _NOT_OF_RUN + _NOT_OF_SCRIPT:
                outcome.status = "refused"
                outcome.reason += f"; {error['hint']}" if "hint" in error else ""
        return outcome

    def _wait(self, process: Any, begun: float) -> tuple[float | None, bool]:
        memory = None
        while process.returncode is None:
            if self.stop.is_set() or (self.limit and time.perf_counter() - begun > self.limit):
                if WAIT4:
                    os.kill(process.pid, signal.SIGKILL)  # Popen.kill might reap it before wait4
                else:
                    process.kill()
            if not WAIT4:
                process.poll()
            elif (ended := os.wait4(process.pid, os.WNOHANG))[0]:
                process.returncode = os.waitstatus_to_exitcode(ended[1])
                # Linux counts kibibytes, macOS bytes.
                memory = ended[2].ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
            if process.returncode is None:
                await_end(process.pid)
        if self.stop.is_set():
            raise Stop
        late = bool(self.limit) and time.perf_counter() - begun > self.limit
        return memory, late and process.returncode != 0


def await_end(pid: int) -> None:
    """Wait until a process ends, but at most 0.1 s."""
    try:
        handle = os.pidfd_open(pid)
    except (AttributeError, OSError):  # other systems than Linux
        time.sleep(0.02)
        return
    select.select([handle], [], [], 0.1)
    os.close(handle)


def kind_of(values: Iterable[str]) -> tuple[str, ...]:
    return tuple(value for value in values if number_of(value) is None)


def options_of(case: Mapping[str, str]) -> list[str]:
    return [word for name, value in case.items() for word in ("-var", name, value)]


def command_of(script: str | Path, case: Mapping[str, str]) -> str:
    return shlex.join(["karamelo-py", str(script), *options_of(case)])


OF_MPI = ("OMPI_", "PMI", "MPI_", "SLURM_NTASKS", "SLURM_PROCID")  # variables in MPI pools


def environment() -> dict[str, str]:
    """Return environment variables for which runs import the same program as the study."""
    paths = [str(Path(karamelo_py.__file__).parent.parent), os.environ.get("PYTHONPATH")]
    path = os.pathsep.join(filter(None, paths))
    inherited = {name: text for name, text in os.environ.items() if not name.startswith(OF_MPI)}
    return {**inherited, STUDY: str(os.getpid()), "PYTHONPATH": path}


def record_of(folder: Path) -> Record:
    return read_json(folder / NAME)


def facts_of(record: Record) -> dict[str, float]:
    runs = record.get("runs", [])
    first = runs[0] if runs else {}
    names = ("points", "nodes", "nodes_per_point", "bytes_per_point", "dt", "stable_dt", "own_dt")
    facts = {name: float(first[name]) for name in names if first.get(name) is not None}
    if "bytes_per_point" in facts:
        facts["bytes_per_particle"] = facts.pop("bytes_per_point")
    ended = [run for run in runs if "steps" in run]
    if ended and ended[-1]["path_cells"] is not None:
        facts["path"] = ended[-1]["path_cells"]
    steps = float(sum(run["steps"] for run in ended))
    if steps:
        seconds = sum(run["seconds"]["steps"] for run in ended)
        facts.update(steps=steps, seconds=seconds)
        facts["cpu_seconds"] = sum(run["processor_s_in_steps"] for run in ended)
        facts["particle_steps"] = steps * facts["points"]
        facts["node_visits"] = facts["particle_steps"] * facts["nodes_per_point"]
        if seconds > 0:
            facts["particle_steps_per_s"] = facts["particle_steps"] / seconds
    return facts


def error_of(record: Record) -> Record:
    errors = [note for note in record.get("messages", []) if note["kind"] == "error"]
    return errors[-1] if errors else {}


def folder_name(case: Row) -> str:
    text = ",".join(f"{name}={value}" for name, value in case.items())
    plain = re.sub(r"[^\w.,=+-]", "_", text)
    if plain == text and len(plain) < 100:
        return plain
    return f"{plain[:80]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
