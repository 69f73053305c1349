"""Error against cost: implicit and explicit runs."""

import re
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from typing import Any

from comparisons.results import Result


def processor_seconds(result: Result) -> float:
    """Processor seconds in the steps of a run, of all threads, as it said at its end."""
    (seconds,) = re.findall(r"processor time +([\d.,]+) s in steps", result.out)
    return float(seconds.replace(",", ""))


def chart(
    axes: Any, runs: Mapping[str, Iterable[Result]], error: Callable[[Result], float]
) -> dict[str, list[tuple[float, float]]]:
    """Draw error against cost, with an arrow to the finer run; return cost and error of each."""
    measured = {}
    for name, results in runs.items():
        measured[name] = [(processor_seconds(result), error(result)) for result in results]
        (line,) = axes.loglog(*zip(*measured[name], strict=True), "o", ls="", ms=6, label=name)
        for coarse, fine in pairwise(measured[name]):
            arrow = {"arrowstyle": "->", "color": line.get_color(), "shrinkA": 5, "shrinkB": 5}
            axes.annotate("", xy=fine, xytext=coarse, arrowprops=arrow)
    axes.set_title("arrows lead to the finer or slower run")
    axes.set(xlabel="processor time of the steps (s)")
    axes.set(ylabel="relative error")
    return measured
