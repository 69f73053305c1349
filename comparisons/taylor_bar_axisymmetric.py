"""Copper bar against a wall, 190 m/s, axisymmetric: final shape against the experiment."""

from __future__ import annotations

from comparisons.row import Row

SOURCE = "Johnson & Holmquist 1988 (experiment)"
LENGTH, DIAMETER = 16.2, 13.5  # mm
SMALL = {"refine": 1 / 3}


def compare(run, axes, full):
    """Length and foot by ulmpm and by tlmpm with averaged volumes."""
    found = []
    for kind, words in {
        "ulmpm": {} if full else {"ppc": 3},
        "tlmpm": {"kind": "tlmpm", "average": "true"},
    }.items():
        result = run(**words)
        log = result.log
        yield Row(f"length, {kind} (mm)", LENGTH, log.length[-1], 0.05, SOURCE)
        # The foot is 8 % too wide on the finer grid: the wall has no friction.
        yield Row(f"diameter of the foot, {kind} (mm)", DIAMETER, log.diameter[-1], 0.1, SOURCE)
        found.append((log.length[-1], log.diameter[-1]))
        last = result.snapshots("taylor_bar_axisymmetric")[-1]
        axes.plot(1e3 * last.x, 1e3 * last.y, ".", ms=1, label=kind)
    for what, a, b in zip(("length", "foot"), *found, strict=True):
        yield Row(f"{what}, ulmpm / tlmpm", 1.0, a / b, 0.02, "two methods")
    axes.plot([DIAMETER / 2, 0], [0, LENGTH], "k+", ms=12, label="experiment")
    axes.set(xlabel="radius (mm)", ylabel="height (mm)", aspect="equal")
