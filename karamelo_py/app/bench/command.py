"""The subcommand karamelo-py bench: how fast this machine runs known scenes.

Speeds are of the fastest of several repetitions; they are meant for comparison within one run of
this command, since machines are shared and their clocks change.
"""

import re
import sys
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import Any

from karamelo_py.app.bench import apart, measure, record, scaling
from karamelo_py.app.bench.workloads import WORKLOADS
from karamelo_py.app.options import above_zero, add_variables, threads_option
from karamelo_py.app.studies.options import out_file
from karamelo_py.app.together import Outcome
from karamelo_py.script.errors import ScriptError, unknown

ELSEWHERE = "published, one core of another machine, a small AMD EPYC"


def add_parser(subparsers: Any) -> None:
    """Say what the subcommand takes, and what it can measure."""
    width = max(map(len, WORKLOADS))
    parser = subparsers.add_parser(
        "bench",
        description=f"""\
Measure the speed of this machine on known scenes, all or those that are named: particle-steps per
second of the fastest of five repetitions, bytes per particle, the time of each stage of a step, and
what limits it: memory, arithmetic, nodes or overhead. Each of several has a process of its own.

workloads:
{chr(10).join(f"  {name:<{width}}  {w.title}" for name, w in WORKLOADS.items())}""",
    )
    parser.set_defaults(act=measure_all)
    parser.add_argument("workloads", nargs="*", metavar="WORKLOAD")
    add_variables(parser, "set a variable of the scenes, such as N, their fineness")
    parser.add_argument(
        "--threads", type=threads_option, default=1, metavar="N",
        help="threads to use (default: 1)",
    )  # fmt: skip
    parser.add_argument(
        "--ranks", type=_counts, metavar="N,M,...",
        help="measure with so many processes instead, and with as many threads: on the scene as it "
        f"is, and on one as many times as large (default workloads: {', '.join(scaling.USUAL)})",
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=above_zero, default=2.0, metavar="S",
        help="how long each scene is measured (default: 2)",
    )  # fmt: skip
    parser.add_argument("-o", type=Path, metavar="FILE", help="write what is measured, as JSON")
    parser.add_argument(
        "--against", type=Path, metavar="FILE", help="compare with what -o has written before"
    )
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def measure_all(options: Namespace) -> int:
    """The subcommand."""
    for name in options.workloads:
        if name not in WORKLOADS:
            raise unknown(f"unknown workload '{name}'", name, WORKLOADS)
    chosen = options.workloads or (scaling.USUAL if options.ranks else list(WORKLOADS))
    known = {name: set(re.findall(r"\w+", WORKLOADS[name].script)) for name in chosen}
    for variable, _ in options.var:
        if not any(variable in words for words in known.values()):
            raise ScriptError(
                f"-var {variable}: no scene has a variable '{variable}'", expected="N or coarser"
            )
    out = out_file(options.o, ".json") if options.o else None
    earlier = record.read(options.against) if options.against else None
    from numba import config

    from karamelo_py.compiler.threads import set_threads

    available = config.NUMBA_NUM_THREADS
    threads = min(options.threads or available, available)
    set_threads(threads)
    triad = measure.bandwidth(threads)
    print(f"threads {threads}, triad bandwidth {triad / 1e9:.1f} GB/s (256 MiB arrays)")
    found = record.head(threads, triad, options.seconds)
    for name in chosen:
        workload = WORKLOADS[name]
        presets = {n: value for n, value in options.var if n in known[name]}
        if options.ranks:
            rows = []
            print(f"\n{name}: {workload.title}\n{scaling.HEADING}")
            for row in scaling.scaled(
                name, options.ranks, threads, presets, options.seconds, available
            ):
                rows.append(row)
                print(scaling.line(row, rows[0]), flush=True)
            found["workloads"][name] = record.scaled(rows, workload.title, presets)
        else:
            act = apart.measured_apart if len(chosen) > 1 else apart.measured
            one = act(
                apart.Measurement(name, threads, presets, options.seconds, triad, options.debug)
            )
            if isinstance(one, Outcome):
                sys.stdout.flush()
                print(one.text, file=sys.stderr, flush=True)
                return one.status
            _print(name, one, published=not presets)
            found["workloads"][name] = record.entry(one, workload.title, presets)
        if out:
            record.write(out, found)
    if earlier:
        print("\n" + "\n".join(record.comparison(found, earlier)))
    if out:
        print(f"\nwritten: {out}")
    return 0


def _counts(text: str) -> list[int]:
    words = text.split(",")
    if not all(word.isdigit() and int(word) for word in words):
        raise ArgumentTypeError(f"'{text}' is no list of numbers of processes, such as 1,2,4")
    return [int(word) for word in words]


def _print(name: str, one: measure.Measured, *, published: bool) -> None:
    workload, best = WORKLOADS[name], one.best
    print(f"\n{name}: {workload.title}; {one.points} points")
    print(f"  {'particle-steps/s':<34} {best / 1e6:8.2f} million (median {one.median / 1e6:.2f})")
    if workload.karamelo is not None and published:
        print(f"  {'of Karamelo in C++':<34} {workload.karamelo:8.2f} million ({ELSEWHERE})")
        print(f"  {'ratio of the two':<34} {best / 1e6 / workload.karamelo:8.1f}")
    print(f"  {'bytes per particle':<34} {one.bytes_per_particle:8d}")
    print(f"  {'bytes moved per particle-step':<34} {one.bytes_per_step:8.0f}")
    print(f"  {'share of the memory roofline':<34} {100 * one.roofline:8.1f} %")
    print(f"  {'share of that of its own size':<34} {100 * one.roofline_in_place:8.1f} %")
    stages = one.of_points | one.of_nodes if one.told_apart else {}
    for stage, per in stages.items():
        print(f"    {stage:<38} {1e9 * per / one.points:8.2f} ns")
    print(f"    {'together, in one compiled loop':<38} {1e9 / best:8.2f} ns")
    if not one.told_apart:
        print(f"  {'limited by':<34} {one.limit:>8} (sweeps are too short to be timed one by one)")
        return
    shares = f"nodes {100 * one.nodes:.0f} % of the sweeps, {100 * one.rest:.0f} % beside them"
    print(f"  {'limited by':<34} {one.limit:>8} ({shares})")
