"""Collapse of a sand column on a rough floor: run-out against aspect ratio."""

from comparisons.exact import granular_runout
from comparisons.lines import surface
from comparisons.row import Row

SMALL = None
WIDTH, CELL = 0.1, 0.1 / 20
RHO = 1600


def compare(run, axes, full):
    """Run-out to where the heap is half a cell high."""
    source = "Lube et al. 2005 (experiments)"
    for a in (1, 2, 4):
        result = run(a=a)
        last = result.snapshots("granular_column")[-1]
        x, height = surface(last, RHO, CELL).T
        runout = min(x[height < CELL / 2][0] - CELL / 2, last.x.max()) / WIDTH - 1
        yield Row(f"run-out, aspect {a}", granular_runout(a), runout, 0.15, source)
        bulk = (last.volume / last.mass * RHO).mean()
        yield Row(f"volume after / before, aspect {a}", 1.0, bulk, 0.05, "no dilatancy")
        # Over four cells: those of one have now more, now fewer points of a sheared heap.
        (line,) = axes.plot(*surface(last, RHO, 4 * CELL).T / WIDTH, lw=1, label=f"aspect {a}")
        axes.plot(
            1 + granular_runout(a), 0, "v", color=line.get_color(), ms=8, clip_on=False,
            label=f"run-out of {a}, experiments",
        )  # fmt: skip
    axes.set(xlabel="x / first width", ylabel="height / first width", ylim=(0, None))
