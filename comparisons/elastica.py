"""Beam that bends by 80 % of its length in load steps: error and cost, against explicit runs."""

from comparisons.cost import chart
from comparisons.exact import elastica
from comparisons.row import Row

SMALL = None  # a chart; tests/test_implicit.py has the tip
TOTAL = {"kind": "tlmpm", "domains": "mechanical", "ppc": 2}


def compare(run, axes, full):
    """Tip of the beam: 2 and 4 cells to the height in load steps; 2 in time, in 2 and 5 periods."""
    down, _ = elastica(10)
    explicit = {**TOTAL, "update": "musl", "refine": 0.5}
    runs = {
        f"implicit, {steps} load steps": [run(**TOTAL, refine=n, steps=steps) for n in (0.5, 1)]
        for steps in (50, 10)
    }
    runs["explicit, load within 2 and 5 periods"] = [run(**explicit, periods=n) for n in (2, 5)]
    found = chart(axes, runs, lambda result: abs(result.log.down[-1] / down - 1))
    axes.set(ylabel="relative error of the tip displacement")
    for name, points in found.items():
        source = "Bisshopp & Drucker 1945"
        yield Row(
            f"error of the tip displacement in the costlier run, {name}",
            0.0,
            points[-1][1],
            0.015,
            source,
        )
