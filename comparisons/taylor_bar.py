"""Copper bar against a wall, 190 m/s, in three dimensions: final shape against the experiment."""

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

SOURCE = "Johnson & Holmquist 1988 (experiment)"
LENGTH, DIAMETER, WAIST = 16.2, 13.5, 10.1  # mm; the waist is a fifth of L0 above the wall
L0, R0 = 25.4, 3.8  # mm
SMALL = {"refine": 1 / 4}


def shape(snapshots):
    """Height of the points at the end, and the diameter at the waist, in mm."""
    first, last = snapshots[0], snapshots[-1]
    radius, height = 1e3 * np.hypot(last.x, last.y), 1e3 * last.z
    # The outermost points are as far inside the surface as at the start.
    margin = R0 - 1e3 * np.hypot(first.x, first.y).max()
    waist = radius[np.abs(height - 0.2 * L0) < 0.02 * L0].max() + margin
    return height, 2 * waist


def compare(run, axes, full):
    """Length, foot and waist by tlmpm with one point per cell; in full by ulmpm with eight, too."""
    ways = {"tlmpm": {}}
    if full:
        ways["ulmpm"] = {"kind": "ulmpm", "ppc": 2, "refine": 1 / 2}
    found, drawn = {}, []
    for kind, words in ways.items():
        result = run(**words)
        log = result.log
        height, waist = shape(result.snapshots("taylor_bar"))
        found[kind] = length, foot = log.length[-1], log.diameter[-1]
        yield Row(f"length, {kind} (mm)", LENGTH, length, 0.05, SOURCE)
        # The wall has no friction; one that holds the foot fast leaves it 9.7 mm wide.
        yield Row(f"diameter of the foot, {kind} (mm)", DIAMETER, foot, 0.1, SOURCE)
        yield Row(f"diameter at 0.2 L0, {kind} (mm)", WAIST, waist, 0.1, SOURCE)
        side = 1 if kind == "tlmpm" else -1
        first, *_, last = result.snapshots("taylor_bar")
        cut = np.abs(first.y) < 1.5 * np.abs(first.y).min()  # two layers of points beside the axis
        drawn.append([side * np.abs(1e3 * last.x[cut]), height[cut], last.ep[cut]])
        axes.text(side * 6, 13, kind, ha="center", fontsize=8)
    if full:
        for what, a, b in zip(("length", "foot"), found["tlmpm"], found["ulmpm"], strict=True):
            yield Row(f"{what}, tlmpm / ulmpm", 1.0, a / b, 0.02, "two methods")
    coloured(axes, *np.hstack(drawn), "plastic strain", bar=0.08, limits=(0, 2))
    radii, heights = [DIAMETER / 2, WAIST / 2, 0], [0, 0.2 * L0, LENGTH]
    axes.plot(radii, heights, "+", color="#d55e00", ms=9, mew=2, label="experiment")
    axes.set(xlabel="radius (mm)", ylabel="height (mm)", aspect="equal", xlim=(-9, 9))
