"""Column under its own weight in load steps: error and cost, against explicit runs."""

from comparisons.cost import chart
from comparisons.row import Row

SMALL = None  # a chart; tests/test_implicit.py has the errors
TWIN = {"H": 10, "E": 1e4, "g": 9.81, "law": "linear", "kind": "ulcpdi", "basis": "linear",
        "domains": "Q4"}  # fmt: skip
CELLS = 16, 32, 64, 128, 256, 512


def compare(run, axes, full):
    """The column of Wyser et al. 2020 by in.column and in load steps."""
    explicit = {"scene": "column", "kind": "ulcpdi", "domains": "Q4"}
    runs = {
        # The end of the column sinks by a fifth: by half a cell in each of so many steps, at most.
        "implicit, steps of half a cell": [run(**TWIN, N=n, steps=max(40, n // 2)) for n in CELLS],
        "explicit, 40 transits": [run(**explicit, refine=n / 16) for n in CELLS],
    }
    found = chart(axes, runs, lambda result: result.log.share[-1])
    axes.set(ylabel="mean error of the stress / (rho g H)")
    source = "equilibrium (exact)"
    for name, within in (("implicit, steps of half a cell", 6e-6), ("explicit, 40 transits", 2e-5)):
        yield Row(f"error with 512 cells, {name}", 0.0, found[name][-1][1], within, source)
