"""Elastic disk on a rigid plane: stress below the contact against Hertz."""

from __future__ import annotations

import numpy as np

from comparisons.exact import hertz_stress
from comparisons.row import Row

SMALL = None
R, SURFACE, MODULUS = 1.0, 0.27, 1e6 / (1 - 0.3**2)


def compare(run, axes, full):
    """Mean stress of layers below the contact; in full on finer grids, too: the order is shown."""
    # The first layers of points are those of a disk cut out of squares.
    for refine, within in ((1, 0.2), (2, 0.1)):
        result = run(refine=refine)
        last = result.snapshots("hertz")[-1]
        force = result.log.force[result.log.Time > 0.45].mean()
        half = np.sqrt(4 * force * R / (np.pi * MODULUS))
        disk = (last.y0 > 0.25) & (last.x < 0.7 * half)
        for lower, upper in ((0, 0.5), (0.5, 1)):
            depth = last.y - SURFACE
            found = (
                disk & (depth >= lower * half - (1 if lower == 0 else 0)) & (depth < upper * half)
            )
            exact = hertz_stress(last.x[found], depth[found], force, half)
            ratio = last.s22[found].mean() / exact.mean()
            name = f"stress to Hertz's, {lower:g} to {upper:g} of the half width deep"
            yield Row(f"{name}, {32 * refine:g} cells", 1.0, ratio, within, "Hertz 1882 (exact)")
        near = (last.y0 > 0.25) & (last.x < 1.5 * half) & (last.y - SURFACE < 0.3 * half)
        largest = 2 * force / (np.pi * half)
        axes.plot(
            last.x[near] / half, -last.s22[near] / largest, ".", ms=2, label=f"{32 * refine:g}"
        )
    x = np.linspace(0, 1, 100)
    axes.plot(x, np.sqrt(1 - x**2), "k--", lw=0.8, label="Hertz, at the surface")
    axes.set(xlabel="x / half width", ylabel="stress / largest pressure")
