"""Rigid strip pressed into clay in load steps: error and cost, against explicit runs."""

from comparisons.cost import chart
from comparisons.exact import prandtl_load
from comparisons.row import Row

SMALL = {"steps": 20}


def error(result):
    """Relative error of the load; of runs in time that late in the run, as in.footing has it."""
    log = result.log
    load = log.load[(log.Time > 0.7) & (log.Time < 0.99)].mean() if "dt" in log else log.load.max()
    return abs(load / prandtl_load(1) - 1)


def compare(run, axes, full):
    """Splines and F-bar in load steps; the same in time."""
    refine = (0.5, 1) if full else (1,)
    averaged = {"basis": "linear", "bar": "true", "v": 0.04}
    runs = {
        "implicit, quadratic-spline": [run(refine=n) for n in refine],
        "implicit, F-bar": [run(refine=n, **averaged) for n in refine],
    }
    if full:
        splines = {"basis": "quadratic-spline", "bar": "false"}
        runs["explicit, quadratic-spline"] = [run("footing", refine=n, **splines) for n in refine]
        runs["explicit, F-bar"] = [run("footing", refine=n) for n in refine]
    found = chart(axes, runs, error)
    axes.set(ylabel="relative error of the load")
    for name, points in found.items():
        yield Row(
            f"error of the limit load on 20 x 20 cells, {name}",
            0.0,
            points[-1][1],
            0.05,
            "Prandtl 1920 (exact)",
        )
