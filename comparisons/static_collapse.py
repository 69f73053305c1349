"""Blocks of clay and of sand that flow under their weight: load steps against explicit ones."""

from comparisons.lines import surface
from comparisons.pictures import coloured
from comparisons.row import Row

SMALL = None  # twins of some ten seconds; tests/test_implicit.py has one
IN_TIME = {"update": "musl", "alpha": 0.99}
RHO, H, L = 1000.0, 8.0, 16.0


def compare(run, axes, full):
    """How far the centre of gravity sinks, and where the front comes to."""
    source = "explicit steps"
    for soil, refine, within in (("clay", 1, 0.05), ("clay", 2, 0.02), ("sand", 1, 0.09)):
        here, twin = (run(soil=soil, refine=refine, **how) for how in ({}, IN_TIME))
        for name, column in (("settlement of the centre of gravity / height", "sunk"),
                             ("position of the front / initial position", "front")):  # fmt: skip
            value, other = (result.log[column][-1] for result in (here, twin))
            yield Row(f"{soil}, {8 * refine} cells: {name}", other, value, within, source)
        if refine == 2:
            last, late = (r.snapshots("static_collapse")[-1] for r in (here, twin))
            coloured(axes, last.x, last.y, last.ep, "plastic strain", cmap="Greys", limits=(0, 1))
            for points, colour, name in ((last, "C0", "40 load steps"), (late, "C1", "in time")):
                axes.plot(*surface(points, RHO, H / 8).T, colour, label=f"clay, {name}")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(0, 1.5 * H))
