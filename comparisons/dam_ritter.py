"""Long reservoir whose dam is removed instantly: depths against the solution of Ritter."""

import numpy as np

from comparisons.lines import surface
from comparisons.row import Row

SOURCE = "exact for shallow water (Ritter 1892)"
G, RHO, DEPTH = 9.81, 1000.0, 1.0
C = np.sqrt(G * DEPTH)  # speed of long waves
SMALL = {"refine": 1 / 2, "CFL": 0.8}


def compare(run, axes, full):
    """Ten times the time in which a wave goes as far as the water is deep."""
    last = run().snapshots("dam_ritter")[-1]
    x, h = surface(last, RHO, DEPTH / 2).T
    s = x / last.TIME
    exact = np.select([s < -C, s < 2 * C], [DEPTH, (2 * C - s) ** 2 / (9 * G)], 0.0)
    fan = (s > -C) & (s < 2 * C)
    # Six cells of depth are few: the small run is allowed twice as much.
    coarse = 1 if full else 2
    yield Row("depth at the dam in h0", 4 / 9, np.interp(0, x, h) / DEPTH, 0.03 * coarse, SOURCE)
    # Water falls before it flows: this leaves ripples of a few hundredths at the back of the fan.
    off = abs(h - exact)[fan].mean() / DEPTH
    yield Row("mean difference of the depths in h0", 0.0, off, 0.015 * coarse, SOURCE)
    # The front starts from rest, and so is late by a constant time.
    front = last.x.max() / (C * last.TIME)
    yield Row("position of the front in t sqrt(g h0)", 2.0, front, 0.04 * coarse, SOURCE)
    axes.plot(*surface(last, RHO, 2 * DEPTH).T, "C0", label="computed")
    axes.plot(x, exact, "k-", lw=0.7, label="Ritter")
    axes.set(xlabel="x (m)", ylabel="depth (m)")
