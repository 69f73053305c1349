"""Error over cost: implicit runs beside explicit ones."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from comparisons.results import Result


def processor_seconds(result: Result) -> float:
    """Processor seconds in the steps of a run, of all threads, as it said at its end."""
    (seconds,) = re.findall(r"processor time +([\d.,]+) s in steps", result.out)
    return float(seconds.replace(",", ""))


def chart(
    axes: Any, runs: Mapping[str, Iterable[Result]], error: Callable[[Result], float]
) -> dict[str, list[tuple[float, float]]]:
    """Draw the error over the cost, a line for each kind of run; return cost and error of each."""
    found = {}
    for name, results in runs.items():
        found[name] = [(processor_seconds(result), error(result)) for result in results]
        axes.loglog(*zip(*found[name], strict=True), "o-", label=name)
    axes.set(xlabel="processor time of the steps (s)", ylabel="relative error (1)")
    return found
