"""Collapsing water column: its front against Martin & Moyce, and its density."""

from pathlib import Path

import numpy as np

from comparisons.row import Row

SOURCE = "Martin & Moyce 1952 (experiment)"
# Column that is twice as high as wide: width a in inches, time in sqrt(a/2g), front in a.
DATA = np.loadtxt(
    Path(__file__).parent / "data/dam_break_martin_moyce_1952.csv", delimiter=",", skiprows=2
)
SMALL = {"refine": 1 / 2, "T": 0.6}
G, RHO, WIDTH, HEIGHT, TANK = 9.81, 1000.0, 0.3, 0.6, 1.61


def compare(run, axes, full):
    """The times of the front, its speed, and the density of the points of all snapshots."""
    result = run(l0=WIDTH)
    log = result.log
    before = log.front < 0.98 * TANK  # the other wall
    time, front = log.Time[before] * np.sqrt(2 * G / WIDTH), log.front[before] / WIDTH
    start, end = (np.interp(place, front, time) for place in (2, 4))
    found = np.array([[np.interp(place, Z, T) for place in (2, 4)] for T, Z in columns()])
    # Early by a fifth of the unit, 0.012 s of the larger column, from the first readings on: the
    # gate of the experiment takes time to open.
    yield Row("time of the front at 4 a", band(found[:, 1]), end, 0.08, SOURCE)
    yield Row("time from 2 a to 4 a", band(np.diff(found)), end - start, 0.05, SOURCE)
    speeds = [np.polyfit(T[Z < 5], Z[Z < 5], 1)[0] for T, Z in columns(2)]
    late = front > 2
    speed = np.polyfit(time[late], front[late], 1)[0]
    yield Row("speed of the front beyond 2 a", band(speeds), speed, 0.05, SOURCE)
    # Twice the speed of a long wave, where all of the head has become velocity (Ritter 1892).
    steps = np.diff(log.front) / np.diff(log.Time) / np.sqrt(G * HEIGHT)
    yield Row("highest speed in sqrt(g h0)", (0.0, 2.0), steps.max(), 0.0, "Ritter 1892 (bound)")
    yield density(result, "a column of double height")
    if full:
        yield density(run(), "the square column")
    axes.plot(time, front, label="computed")
    for (T, Z), mark, width in zip(columns(), ("o", "s"), (1.125, 2.25), strict=True):
        axes.plot(T[Z < 6], Z[Z < 6], "k" + mark, mfc="none", label=f"experiment, a = {width} in")
    axes.set(xlabel="time / sqrt(a/2g)", ylabel="front / width a")


def columns(above=0.0):
    """Times and places of the front for each of the columns."""
    sizes = (DATA[DATA[:, 0] == a] for a in (1.125, 2.25))
    return [(rows[:, 1], rows[:, 2]) for rows in (s[s[:, 2] > above] for s in sizes)]


def band(numbers):
    """From the smallest to the largest."""
    return float(np.min(numbers)), float(np.max(numbers))


def density(result, name):
    """What 99 of 100 points do not exceed, in all snapshots."""
    snapshots = result.snapshots("dam_break")
    off = [np.quantile(abs(s.mass / s.volume / RHO - 1), 0.99) for s in snapshots]
    return Row(
        f"99th percentile of the density change, {name}", 0.0, max(off), 0.03, "incompressible"
    )
