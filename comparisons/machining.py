"""Steel cut at 50 m/s: cutting force against Merchant's formula, energy, chip."""

from math import atan, cos, pi, sin, sqrt

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

YIELD = 0.98  # GPa, at first
HARD = 0.98 + 2.0 * 0.85**0.83  # at the strain at which it breaks in shear, 0.05 + 0.8
TIME = 5e-6  # s, in which the tool goes 0.25 mm
SMALL = None  # tests/test_paper_scenes.py runs it


def merchant(stress, rake):
    """Force over the area of the cut without friction, `stress` von Mises' (Merchant 1945).

    tau cos(rake) / (sin(phi) cos(phi - rake)), on the plane phi = 45 degrees + rake/2 least.
    """
    angle = atan(rake)
    phi = pi / 4 + angle / 2
    return stress / sqrt(3) * cos(angle) / (sin(phi) * cos(phi - angle))


def compare(run, axes, full):
    """The published grid takes hours: a quarter of it, and in full that of the scene, too."""
    for refine in (1 / 4, 2 / 5) if full else (1 / 4,):
        result = run(refine=refine, T=TIME)
        log = result.log
        cells = f", {320 * refine:.0f} cells"
        cutting = log.Time > 1e-6
        force = -log.force[cutting].mean()
        ends = merchant(YIELD, 0.1), merchant(HARD, 0.1)
        yield Row(f"cutting force (GPa){cells}", ends, force, 0.1, "Merchant 1945")
        work = np.trapezoid(-log.force * 1e9 * 0.15e-3 * 50, log.Time)
        spent = (log.Ek[-1] + log.Es[-1] + log.lost[-1]) / work
        yield Row(f"energy / work of the tool{cells}", (0.7, 1.0), spent, 0.05, "balance")
        last = result.snapshots("machining")[-1]
        cut = (last.y0 > 0.1e-3) & (last.x0 > 1e-3 - 50 * TIME)
        broken = np.average(last.damage[cut] > 0.99, weights=last.mass[cut])
        yield Row(f"broken fraction of the chip{cells}", (0.02, 1), broken, 0.0, "chips come off")
        below = last.y0 < 0.05e-3
        deep = np.average(last.damage[below] > 0.99, weights=last.mass[below])
        yield Row(f"broken fraction deep below the cut{cells}", 0.0, deep, 0.01, "the piece holds")
    coloured(axes, 1e3 * last.x, 1e3 * last.y, last.ep, "plastic strain", limits=(0, 2))
    axes.fill([0.75, 0.775, 1], [0.1, 0.35, 0.125], color="0.6", lw=0)
    axes.text(0.84, 0.2, "tool", ha="center", fontsize=8)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal", xlim=(0, 1.2), ylim=(0, 0.6))
