"""karamelo-py bench: speed of this machine.

Compare only speeds measured in the same run of bench, since clock rates change.
"""

import json
import re
import subprocess
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Mapping
from math import inf
from pathlib import Path

import karamelo_py
from karamelo_py.app.bench import apart, measure, on_card
from karamelo_py.app.bench.measure import WORKLOADS
from karamelo_py.app.options import above_zero, add_variables, threads_option
from karamelo_py.app.plot import read_text
from karamelo_py.app.studies.case import Record
from karamelo_py.app.studies.variables import out_file
from karamelo_py.compiler.gpu import NoCard, bandwidth, card
from karamelo_py.output.files import write_whole
from karamelo_py.output.record import surroundings
from karamelo_py.script.errors import ScriptError, unknown

ELSEWHERE = "published, one core of another machine, a small AMD EPYC"
KIND = "karamelo-py bench"
WIDTH = max(map(len, WORKLOADS))
DESCRIPTION = f"""\
Measure the speed of this machine on known scenes, all or those that are named: particle-steps per
second of the fastest of five repetitions, bytes per particle, the time of each stage of a step, and
its limit: memory, arithmetic, nodes or overhead. Several scenes run in separate processes.

workloads:
{chr(10).join(f"  {name:<{WIDTH}}  {w.title}" for name, w in WORKLOADS.items())}"""


def add_options(parser: ArgumentParser) -> None:
    parser.add_argument("workloads", nargs="*", metavar="WORKLOAD")
    add_variables(parser, "set a variable of the scenes, such as N, which refines them")
    parser.add_argument(
        "--threads", type=threads_option, default=1, metavar="N",
        help="threads to use (default: 1)",
    )  # fmt: skip
    parser.add_argument(
        "--ranks", type=_counts, metavar="N,M,...",
        help="measure with this number of processes, and with as many threads: on the scene as it "
        f"is, and on one as many times as large (default workloads: {', '.join(apart.USUAL)})",
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=above_zero, default=2.0, metavar="S",
        help="how long each scene is measured (default: 2)",
    )  # fmt: skip
    parser.add_argument(
        "--gpu", action="store_true",
        help="measure an NVIDIA GPU, with 1, 4 and 16 million points unless -var refines the scene "
        f"(default workloads: {', '.join(on_card.USUAL)})",
    )  # fmt: skip
    parser.add_argument("-o", type=Path, metavar="FILE", help="write the measurements as JSON")
    parser.add_argument(
        "--against", type=Path, metavar="FILE", help="compare with an earlier file of -o"
    )


def run(options: Namespace) -> int:
    for name in options.workloads:
        if name not in WORKLOADS:
            raise unknown(f"unknown workload '{name}'", name, WORKLOADS)
    usual = on_card.USUAL if options.gpu else apart.USUAL if options.ranks else list(WORKLOADS)
    chosen = options.workloads or usual
    words_of = {name: set(re.findall(r"\w+", WORKLOADS[name].script)) for name in chosen}
    for variable, _ in options.var:
        if not any(variable in words for words in words_of.values()):
            raise ScriptError(
                f"-var {variable}: no scene has a variable '{variable}'", expected="N or coarser"
            )
    workloads = {
        name: {n: value for n, value in options.var if n in words}
        for name, words in words_of.items()
    }
    out = out_file(options.o, ".json") if options.o else None
    earlier = read(options.against) if options.against else None
    if options.gpu:
        return _on_card(options, workloads, out, earlier)
    from numba import config

    available = config.NUMBA_NUM_THREADS
    threads = min(options.threads or available, available)
    triad = measure.bandwidth(threads)
    print(f"threads {threads}, triad bandwidth {triad / 1e9:.1f} GB/s (256 MiB arrays)")
    about = {"commit": commit(), "threads": threads, "triad": triad, "seconds": options.seconds}
    record: dict = {"kind": KIND, **surroundings(), **about, "workloads": {}}
    for name, presets in workloads.items():
        job = apart.Measurement(name, threads, presets, options.seconds, triad, options.debug)
        if options.ranks:
            one = _scaling(job, options.ranks, available)
        else:
            act = apart.measured_apart if len(chosen) > 1 else apart.measured
            measured = act(job)
            if isinstance(measured, int):
                return measured
            _print(name, measured, published=not presets)
            one = measured.record()
        record["workloads"][name] = {"title": WORKLOADS[name].title, "variables": presets, **one}
        if out:
            write_whole(out, json.dumps(record, indent=1) + "\n")
    return _ended(record, earlier, out)


def _ended(record: Record, earlier: Record | None, out: Path | None) -> int:
    if earlier:
        print("\n" + "\n".join(comparison(record, earlier)))
    if out:
        print(f"\nwritten: {out}")
    return 0


def _on_card(
    options: Namespace, workloads: Mapping[str, dict], out: Path | None, earlier: Record | None
) -> int:
    try:
        gpu = card()
    except NoCard as error:
        raise ScriptError(str(error), hint=error.hint) from None
    copied = bandwidth(gpu)
    print(f"{gpu.name}, copies of memory {copied / 1e9:.0f} GB/s, read and written")
    about = {"commit": commit(), "card": gpu.name, "bandwidth": copied, "seconds": options.seconds}
    record: dict = {"kind": KIND, **surroundings(), **about, "workloads": {}}
    for name, presets in workloads.items():
        for variables in on_card.sizes_of(name, presets):
            one = on_card.measured(name, variables, gpu, copied, options.seconds)
            on_card.say(name, one, variables)
            key = " ".join([name, *(f"{n}={value}" for n, value in variables.items())])
            record["workloads"][key] = {"variables": variables, **one.record()}
            if out:
                write_whole(out, json.dumps(record, indent=1) + "\n")
    return _ended(record, earlier, out)


def _counts(text: str) -> list[int]:
    words = text.split(",")
    if not all(word.isdigit() and int(word) for word in words):
        raise ArgumentTypeError(f"'{text}' is not a list of process counts, such as 1,2,4")
    return [int(word) for word in words]


def _scaling(job: apart.Measurement, ranks: list[int], available: int) -> dict:
    rows: list[apart.Scaled] = []
    print(f"\n{job.workload}: {WORKLOADS[job.workload].title}\n{apart.HEADING}")
    for row in apart.scaled(job, ranks, available):
        rows.append(row)
        print(apart.line(row, rows[0]), flush=True)
    first, *_ = scaling = [row._asdict() for row in rows]
    return {"points": first["points"], "best": first["best"], "scaling": scaling}


def _print(name: str, one: measure.Measured | measure.Solved, *, published: bool) -> None:
    workload, best = WORKLOADS[name], one.best
    print(f"\n{name}: {workload.title}; {one.points} points")
    if isinstance(one, measure.Solved):
        _print_solved(one)
        return
    print(f"  {'particle-steps/s':<34} {best / 1e6:8.2f} million (median {one.median / 1e6:.2f})")
    if workload.karamelo is not None and published:
        print(f"  {'of Karamelo in C++':<34} {workload.karamelo:8.2f} million ({ELSEWHERE})")
        print(f"  {'ratio of the two':<34} {best / 1e6 / workload.karamelo:8.1f}")
    print(f"  {'bytes per particle':<34} {one.bytes_per_particle:8d}")
    print(f"  {'bytes moved per particle-step':<34} {one.bytes_per_particle_step:8.0f}")
    cached = " (above 100 %: caches hold a part)" if one.roofline > 1 else ""
    print(f"  {'fraction of the memory bandwidth':<34} {100 * one.roofline:8.1f} %{cached}")
    print(f"  {'the same, for arrays of its size':<34} {100 * one.roofline_in_place:8.1f} %")
    stages = one.sweeps_of_points | one.sweeps_of_nodes if one.distinguished else {}
    for stage, per in stages.items():
        print(f"    {stage:<38} {1e9 * per / one.points:8.2f} ns")
    print(f"    {'together, in one compiled loop':<38} {1e9 / best:8.2f} ns")
    fractions = "sweeps are too short to be timed one by one"
    if one.distinguished:
        fractions = f"nodes {100 * one.nodes:.0f} % of the sweeps, {100 * one.rest:.0f} % outside"
    print(f"  {'limited by':<34} {one.limit:>8} ({fractions})")


def _print_solved(one: measure.Solved) -> None:
    print(f"  {'unknowns':<34} {one.unknowns:8d}")
    print(f"  {'seconds per load step':<34} {one.points / one.best:8.3f} (median "
          f"{one.points / one.median:.3f})")  # fmt: skip
    print(f"  {'corrections per load step':<34} {one.corrections:8.1f}")
    for stage, fraction in one.stages.items():
        print(f"    {stage:<38} {100 * fraction:6.1f} %")


def commit() -> str | None:
    folder = Path(karamelo_py.__file__).parent

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True,
            timeout=10,
        ).stdout.strip()  # fmt: skip

    try:
        git("ls-files", "--error-unmatch", "__init__.py")  # fails in other repositories
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None


def read(path: Path) -> dict:
    expected = "a file that karamelo-py bench -o has written"
    text = read_text(path, expected)
    try:
        record = json.loads(text)
        speeds = [one["best"] for one in record["workloads"].values()]
        good = record["kind"] == KIND and all(0 < best < inf for best in speeds)
    except (ValueError, LookupError, TypeError, AttributeError):
        good = False
    if not good:
        raise ScriptError(f"{path} is not the output of a bench", expected=expected)
    return record


def comparison(now: Record, then: Record) -> list[str]:
    lines = [f"{'workload':<24} {'then':>10} {'now':>10} {'ratio':>7}   (best, million/s)"]
    ours, theirs = now["workloads"], then["workloads"]
    for name in dict.fromkeys((*ours, *theirs)):
        one, other = ours.get(name), theirs.get(name)
        before, after = (f"{each['best'] / 1e6:.2f}" if each else "-" for each in (other, one))
        ratio, said = "-", "new" if other is None else "not measured now"
        if one and other:
            about = ("points", "precision", "variables")
            said = ", ".join(f"other {key}" for key in about if one.get(key) != other.get(key))
            ratio = "-" if said else f"{one['best'] / other['best']:.2f}"
        lines.append(f"{name:<24} {before:>10} {after:>10} {ratio:>7}   {said}")
    return [line.rstrip() for line in [*lines, *_differences(now, then)]]


def _differences(now: Record, then: Record) -> list[str]:
    def about(record: Record) -> dict:
        keys = ("processor", "cores", "system", "commit", "threads")
        versions = record.get("versions") or {}
        return {key: record.get(key) for key in keys} | {
            f"version of {name}": version for name, version in versions.items()
        }

    ours, theirs = about(now), about(then)
    return [
        f"another {word}: {theirs.get(word) or 'unknown'} then, {ours.get(word) or 'unknown'} now"
        for word in ours | theirs
        if ours.get(word) != theirs.get(word)
    ]
