"""Elastic disk that slides or rolls down an incline."""

from math import radians

import numpy as np

from comparisons.exact import incline_acceleration
from comparisons.row import Row

SMALL = {}
G = 10.0


def compare(run, axes, full):
    """Acceleration down the incline, from 0.2 s on."""
    cases = {
        "slides": ({"angle": 45, "mu": 0.1}, 0.001),
        "slides without friction": ({"angle": 30, "mu": 0}, 0.001),
    }
    if full:
        rolls = {"angle": 30, "mu": 0.5}
        cases["rolls, 12 cells across"] = rolls, 0.05
        cases["rolls, 24 cells across"] = rolls | {"refine": 2}, 0.05
        # Rigid, the base acts through all nodes that its points see.
        for basis in ("quadratic", "cubic"):
            words = {"angle": 45, "mu": 0.1, "basis": f"{basis}-spline"}
            cases[f"slides, {basis} splines"] = words, 0.005
    exact = set()
    for name, (words, within) in cases.items():
        expected = incline_acceleration(radians(words["angle"]), words["mu"], G)
        log = run(**words).log
        late = log.Time > 0.2
        found = np.polyfit(log.Time[late], log.v_x[late], 1)[0]
        yield Row(
            f"acceleration of a disk that {name} (m/s2)",
            expected,
            found,
            within,
            "rigid disk (exact)",
        )
        if "splines" not in name:  # their lines would lie on those of the linear basis
            axes.plot(log.Time, log.v_x, lw=1.2, label=name)
        exact.add(expected)
    for index, slope in enumerate(sorted(exact)):
        label = None if index else "rigid disk (exact)"
        axes.plot([0, 1], [0, slope], "-", color="0.75", lw=4, zorder=1, label=label)
    axes.set(xlabel="time (s)", ylabel="velocity (m/s)")
