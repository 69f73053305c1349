"""Copper bar against a wall, 190 m/s, axisymmetric: final shape against the experiment."""

import numpy as np

from comparisons.pictures import body
from comparisons.row import Row

SOURCE = "Johnson & Holmquist 1988 (experiment)"
LENGTH, DIAMETER, MIDDLE = 16.2, 13.5, 10.1  # mm
HEIGHT = 25.4 / 5  # of the middle
SMALL = {"refine": 1 / 3}


def compare(run, axes, full):
    """Final shape by ulmpm; in full by tlmpm, too, with F-bar and without."""
    found = []
    ways = {"ulmpm": {} if full else {"ppc": 3}}
    if full:
        ways["tlmpm"] = {"kind": "tlmpm", "average": "true"}
    for kind, words in ways.items():
        result = run(**words)
        log = result.log
        yield Row(f"length, {kind} (mm)", LENGTH, log.length[-1], 0.05, SOURCE)
        yield Row(f"diameter of the foot, {kind} (mm)", DIAMETER, log.diameter[-1], 0.05, SOURCE)
        last = result.snapshots("taylor_bar_axisymmetric")[-1]
        height = np.abs(1e3 * last.y - HEIGHT) < 0.25
        # A point stands half its width within the surface, as at the foot.
        middle = 2e3 * last.x[height].max() + log.diameter[-1] - 2e3 * last.x.max()
        yield Row(f"diameter at 0.2 of the length, {kind} (mm)", MIDDLE, middle, 0.05, SOURCE)
        # What is not dissipated is stored in elastic strain, or lost by the transfer (FLIP 0.99),
        # and at the wall by nodes that come to rest there.
        spent, left = log.lost[-1] / log.Ek[0], log.Ek[-1] / log.Ek[0]
        yield Row(f"energy spent on plastic flow, {kind}", (0.88, 1), spent, 0.0, "at rest")
        yield Row(f"remaining kinetic energy, {kind}", 0.0, left, 0.01, "at rest")
        found.append((log.length[-1], log.diameter[-1]))
        side = -1 if found[1:] else 1  # one method beside the other
        body(axes, side * 1e3 * last.x, 1e3 * last.y, kind)
    if full:
        free = run(mu=0).log
        name = "diameter of the foot without friction (mm)"
        yield Row(name, DIAMETER, free.diameter[-1], 0.12, SOURCE)
        for what, a, b in zip(("length", "foot"), *found, strict=True):
            yield Row(f"{what}, ulmpm / tlmpm", 1.0, a / b, 0.02, "two methods")
        # Full integration locks in plastic flow, on coarse grids most.
        free, locked = (
            run(kind="tlmpm", refine=1 / 3, average=average).log.diameter[-1]
            for average in ("true", "false")
        )
        name = "diameter of the foot with 5 cells, without / with F-bar"
        yield Row(name, (0.5, 0.9), locked / free, 0.0, "locking")
    axes.plot([DIAMETER / 2, 0], [0, LENGTH], "k+", ms=12, label="experiment")
    axes.set(xlabel="radius (mm)", ylabel="height (mm)", aspect="equal", xlim=(-9, 9))
