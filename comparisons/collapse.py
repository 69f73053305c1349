"""Heap of aluminium bars released on one side: final shape, against Bui et al. (experiment)."""

from math import atan, degrees
from pathlib import Path

import numpy as np

from comparisons.lines import distance, surface, unmoved
from comparisons.row import Row

SOURCE = "Bui et al. 2008 (experiment)"
DATA = Path(__file__).parent / "data"
SURFACE = np.loadtxt(DATA / "bui2008_surface.csv", delimiter=",")
FAILURE = np.loadtxt(DATA / "bui2008_failure_line.csv", delimiter=",")
RHO, HEIGHT, CELLS = 2650.0, 0.1, 40
BAR = 1.5e-3  # m, diameter of the bars: a deposit that is thinner is none
SMALL = {"refine": 3 / 8}


def compare(run, axes, full):
    """Distances between the lines, run-out, and angle of repose."""
    last = run().snapshots("collapse")[-1]
    cell = HEIGHT / (CELLS * (1 if full else SMALL["refine"]))
    top = surface(last, RHO, cell)
    still = unmoved(last, 5e-4)
    x, depth = top.T
    toe = x[np.flatnonzero(depth < BAR)[0]]
    # The toe is as thin as a cell: coarse grids lose the end of it.
    yield Row("run-out (m)", SURFACE[-1, 0], toe, 0.03 if full else 0.1, SOURCE)
    off = 1e3 * distance(SURFACE, top)
    yield Row("distance between the surfaces (mm)", 0.0, off, 3, SOURCE)
    # At the foot the floor, which lets nothing slip, holds 10 mm more of the heap.
    off = 1e3 * distance(FAILURE, still)
    yield Row("distance between the failure lines (mm)", 0.0, off, 4 if full else 6, SOURCE)
    # Published are 14 degrees (experiment) and 13 (Wyser et al. 2020).
    angle = repose(x, depth)
    yield Row("angle of repose (degrees)", (13, 14), angle, 0.05, f"{SOURCE}; Wyser et al. 2020")
    # Over four cells: those of one have now more, now fewer points of a sheared heap.
    smooth = surface(last, RHO, 4 * cell)
    axes.fill_between(*smooth.T, color="0.93", lw=0)
    axes.plot(*smooth.T, "C0", label="computed surface")
    axes.plot(*still.T, "C1", label="computed: moved by less than half a millimetre")
    axes.plot(*SURFACE.T, "k.", label="experiment")
    axes.plot(*FAILURE.T, "k+", label="experiment: did not move")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(0, 0.55))


def repose(x, y):
    """Inclination of the straight part of a surface, in degrees."""
    straight = (x > 0.1) & (x < 0.4)
    return degrees(-atan(np.polyfit(x[straight], y[straight], 1)[0]))
