"""Slope whose weight grows until it fails: weight and slip surface, against limit analysis."""

from math import radians

import numpy as np

from comparisons.exact import spiral_slip
from comparisons.pictures import body, coloured
from comparisons.row import Row

SMALL = {}  # 10 cells of height: ten seconds
TOE, H, SUNK = np.array([48.75, 15.0]), 20.0, 0.004


def limit(log):
    """Weight times height over cohesion where the edge has sunk by 0.4 % of the height."""
    return np.interp(SUNK, log.sunk, log.N)


def compare(run, axes, full):
    """10 and 20 cells to the height."""
    N, line = spiral_slip(radians(45), radians(20))
    for refine, within in ((1, 0.09), (2, 0.03))[: 1 + full]:
        result = run(refine=refine)
        name = f"weight times height / cohesion, {10 * refine} cells to the height"
        yield Row(name, N, limit(result.log), within, "Chen 1975 (bound from above)")
    last = result.snapshots("static_slope")[-1]
    strain = "plastic strain (%)"
    body(axes, last.x, last.y, "slope at failure")
    coloured(axes, last.x, last.y, 100 * last.ep, strain, cmap="Greys", limits=(0, 1))
    axes.plot(*(TOE + H * line).T, "C1", label="spiral through the toe (Chen 1975)")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(0, 75), ylim=(0, 38))
