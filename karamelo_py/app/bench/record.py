"""Files of karamelo-py bench, and the comparison of two of them."""

import json
import subprocess
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import karamelo_py
from karamelo_py.app.bench.measure import Measured
from karamelo_py.app.bench.scaling import Scaled
from karamelo_py.app.studies.records import surroundings
from karamelo_py.output.files import write_whole
from karamelo_py.script.errors import ScriptError

KIND = "karamelo-py bench"
# Of what differs here, ratios say something about the surroundings, too.
ABOUT = {"processor": "processor", "cores": "cores", "system": "system", "commit": "commit"}
SAME = {"points": "points", "precision": "precision", "variables": "variables"}


def entry(one: Measured, title: str, presets: Mapping[str, str]) -> dict[str, Any]:
    """Return the record of a workload; speeds in particle-steps/s, times in seconds."""
    return {
        "title": title,
        "variables": dict(presets),
        "points": one.points,
        "precision": one.precision,
        "best": one.best,
        "median": one.median,
        "speeds": one.speeds,
        "bytes_per_particle": one.bytes_per_particle,
        "bytes_per_particle_step": one.bytes_per_step,
        "roofline": one.roofline,
        "roofline_in_place": one.roofline_in_place,
        "limited_by": one.limit,
        "share_of_nodes": one.nodes,
        "share_of_rest": one.rest,
        "sweeps_of_points": one.of_points,
        "sweeps_of_nodes": one.of_nodes,
    }


def scaled(rows: Sequence[Scaled], title: str, presets: Mapping[str, str]) -> dict[str, Any]:
    """Return the record of a workload that several processes ran; the speed of one comes first."""
    return {
        "title": title,
        "variables": dict(presets),
        "points": rows[0].points,
        "best": rows[0].best,
        "scaling": [row._asdict() for row in rows],
    }


def head(threads: int, triad: float, seconds: float) -> dict[str, Any]:
    """Return the head of a file of records: machine, versions, threads, bandwidth (bytes/s)."""
    return {
        "kind": KIND,
        **surroundings(),
        "commit": commit(),
        "threads": threads,
        "triad": triad,
        "seconds": seconds,
        "workloads": {},
    }


def commit() -> str | None:
    """The commit of the program where it runs from its repository, else None."""
    folder = Path(karamelo_py.__file__).parent

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True,
            timeout=10,
        ).stdout.strip()  # fmt: skip

    try:
        git("ls-files", "--error-unmatch", "__init__.py")  # not a folder in another repository
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None


def write(path: Path, found: Mapping[str, Any]) -> None:
    """Write a bench in one piece."""
    write_whole(path, json.dumps(found, indent=1) + "\n")


def read(path: Path) -> dict[str, Any]:
    """A bench that was written before."""
    expected = "a file that karamelo-py bench -o has written"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScriptError(
            f"cannot read {path}: {error.strerror or error}", expected=expected
        ) from None
    except ValueError:
        found = None
    if not _is_bench(found):
        raise ScriptError(f"{path} is not the output of a bench", expected=expected)
    return found


def _is_bench(found: Any) -> bool:
    if not isinstance(found, dict) or found.get("kind") != KIND:
        return False
    workloads = found.get("workloads")
    return isinstance(workloads, dict) and all(
        isinstance(one, dict)
        and isinstance(one.get("best"), (int, float))
        and isfinite(one["best"])
        and one["best"] > 0
        for one in workloads.values()
    )


def comparison(now: Mapping[str, Any], then: Mapping[str, Any]) -> list[str]:
    """Lines that compare a bench with an earlier one: what differs around, and ratios of speeds."""
    lines = [f"{'workload':<24} {'then':>10} {'now':>10} {'ratio':>7}   (best, million/s)"]
    ours, theirs = now["workloads"], then["workloads"]
    for name in dict.fromkeys((*ours, *theirs)):
        if name not in theirs:
            lines.append(f"{name:<24} {'-':>10} {ours[name]['best'] / 1e6:10.2f} {'-':>7}   new")
            continue
        best = theirs[name]["best"]
        if name not in ours:
            lines.append(f"{name:<24} {best / 1e6:10.2f} {'-':>10} {'-':>7}   not measured now")
            continue
        one, other = ours[name], theirs[name]
        unlike = [f"other {word}" for key, word in SAME.items() if one.get(key) != other.get(key)]
        ratio = "-" if unlike else f"{one['best'] / best:.2f}"
        lines.append(
            f"{name:<24} {best / 1e6:10.2f} {one['best'] / 1e6:10.2f} {ratio:>7}   "
            + ", ".join(unlike)
        )
    return [line.rstrip() for line in [*lines, *differences(now, then)]]


def differences(now: Mapping[str, Any], then: Mapping[str, Any]) -> list[str]:
    """List other differences between two benches, a line each: machine, threads, versions."""
    pairs = [(word, now.get(key), then.get(key)) for key, word in ABOUT.items()]
    pairs.append(("threads", now.get("threads"), then.get("threads")))
    ours, theirs = now.get("versions") or {}, then.get("versions") or {}
    pairs += [
        (f"version of {name}", ours.get(name), theirs.get(name))
        for name in dict.fromkeys((*ours, *theirs))
    ]
    return [
        f"another {word}: {b or 'unknown'} then, {a or 'unknown'} now"
        for word, a, b in pairs
        if a != b
    ]
