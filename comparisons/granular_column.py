"""Collapse of a column of sand on a rough floor: how far it runs out, by its aspect ratio."""

import numpy as np

from comparisons.exact import granular_runout
from comparisons.row import Row

SMALL = None
WIDTH, CELL = 0.1, 0.1 / 20


def surface(points):
    """Left ends of columns one cell wide, and how high the sand stands in them."""
    edges = np.arange(0, points.x.max() + CELL, CELL)
    volume, _ = np.histogram(points.x, edges, weights=points.mass / 1600)
    return edges[:-1], volume / CELL


def compare(run, axes, full):
    """Run-out to where the heap is half a cell high."""
    source = "Lube et al. 2005 (experiments)"
    for a in (1, 2, 4):
        result = run(a=a)
        last = result.snapshots("granular_column")[-1]
        x, height = surface(last)
        end = x[height < CELL / 2]
        runout = (end[0] if len(end) else last.x.max()) / WIDTH - 1
        yield Row(f"run-out, aspect {a}", granular_runout(a), runout, 0.15, source)
        bulk = (last.volume / last.mass * 1600).mean()
        yield Row(f"volume after / before, aspect {a}", 1.0, bulk, 0.05, "no dilatancy")
        axes.plot(x / WIDTH, height / WIDTH, lw=1, label=f"aspect {a}")
    axes.set(xlabel="x / l0 (1)", ylabel="height / l0 (1)")
