"""Slope that slides down under its weight: surface and slip surface against Huang et al. 2015."""

from pathlib import Path

import numpy as np

from comparisons.lines import distance, surface, unmoved
from comparisons.pictures import coloured
from comparisons.row import Row

SOURCE = "Huang et al. 2015 (material point method)"
DATA = Path(__file__).parent / "data"
SURFACE = np.loadtxt(DATA / "huang2015_surface.csv", delimiter=",")
FAILURE = np.loadtxt(DATA / "huang2015_failure_line.csv", delimiter=",")
RHO = 2100.0
AREA = 21840 / 9  # m2, by the number of points of Wyser et al. 2020
GROUND = 15.0  # height of the ground before the slope
# With the method of in.collapse, which nothing has to be compiled for any more.
SMALL = {
    "refine": 0.8,
    "CFL": 0.9,
    "ppc": 2,
    "kind": "ulmpm",
    "transfer": "TPIC",
    "basis": "ugimp",
    "alpha": "mechanical",
    "domains": "mechanical",
}


def compare(run, axes, full):
    """Toe, surface, slip surface, and whether that is round."""
    last = run().snapshots("slump")[-1]
    yield Row("area of the section (m2)", AREA, last.mass.sum() / RHO, 0.005, "Wyser et al. 2020")
    slid = last.y > GROUND + 0.6
    yield Row(
        "position of the toe (m)",
        SURFACE[:, 0][SURFACE[:, 1] > 16][-1],
        last.x[slid].max(),
        0.05,
        SOURCE,
    )
    # The digitised surface has some 60 m2 more below it than the slope had at first.
    top = surface(last, RHO, 1.0)
    hill = SURFACE[SURFACE[:, 1] > 16]
    yield Row("distance between the surfaces (m)", 0.0, distance(hill, top), 1.5, SOURCE)
    still = slip(last)
    yield Row("distance between the slip surfaces (m)", 0.0, distance(FAILURE, still), 2.5, SOURCE)
    # A slice that turns like a rigid body slips on a circle (Fellenius 1936).
    yield Row("distance from a circle / radius", 0.0, roundness(still), 0.01, "rotation")
    if full:
        # Nothing of this is published: softening widens the slide, and leaves it where it was.
        soft = run(c_residual=8e3).snapshots("slump")[-1]
        further = soft.x[soft.y > GROUND + 0.6].max() / last.x[slid].max()
        name = "toe with residual cohesion 8 kPa / toe without"
        yield Row(name, (1, 1.1), further, 0.0, "softer")
        line = slip(soft)
        name = "distance between the slip surfaces with softening (m)"
        yield Row(name, 0.0, distance(FAILURE, line), 2.5, SOURCE)
        axes.plot(*line.T, "C2", lw=0.8, label="the same, softening")
    coloured(axes, last.x, last.y, last.ep, "plastic strain", cmap="Greys", limits=(0, 1))
    axes.plot(*top.T, "C0", label="computed surface")
    axes.plot(*still.T, "C1", label="computed: moved by less than 2 m")
    axes.plot(*SURFACE.T, "k.", ms=4, label="Huang et al.: surface")
    axes.plot(*FAILURE.T, "k+", ms=4, label="Huang et al.: slip surface")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(0, 60))


def slip(points):
    """What has moved by less than 2 m, a sixth of the largest distance, below what has slid."""
    moved = np.hypot(points.x - points.x0, points.y - points.y0)
    slid = points.x0[moved > 3.5]
    line = unmoved(points, 2.0)
    return line[(line[:, 0] >= slid.min()) & (line[:, 0] <= slid.max())]


def roundness(line):
    """Mean distance from the circle that fits best (least squares, Kasa 1976), over its radius."""
    matrix = np.column_stack([2 * line, np.ones(len(line))])
    x, y, rest = np.linalg.lstsq(matrix, (line**2).sum(1), rcond=None)[0]
    radius = np.sqrt(rest + x**2 + y**2)
    return abs(np.hypot(line[:, 0] - x, line[:, 1] - y) - radius).mean() / radius
