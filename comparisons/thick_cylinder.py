"""Thick cylinder expanded until its whole wall yields: pressure, and stress across the wall."""

from math import log, sqrt

import numpy as np

from comparisons.row import Row

SMALL = {}  # three seconds
A, B, E, NU, Y = 1.0, 2.0, 1e3, 0.3, 1.0
BEARS = 2 / sqrt(3) * Y * log(B / A)


def compare(run, axes, full):
    """16 cells across the wall, and 4 to 32 where there is time."""
    source = "Hill 1950 (exact, nothing hardens)"
    for refine in (0.25, 0.5, 1, 2) if full else (1,):
        result = run(refine=refine)
        pressure, cells = result.log.pressure, int(16 * refine)
        name = f"limit pressure of the wall / yield stress, {cells} cells"
        yield Row(name, BEARS, pressure[-1], 0.01 / refine, source)
        axes.plot(result.log.Time / 30 * 4, pressure, label=f"{cells} cells")
        if refine == 1:
            share = pressure[1] / (E / (1 + NU) * 4 / 30 / E / ((1 - 2 * NU) + 4) * 3)
            yield Row(
                "pressure after the first step / elastic solution", 1.0, share, 0.002, "Lame 1852"
            )
            last = result.snapshots("cylinder")[-1]
            # Sums over the points of a cell: inside one the strain of linear functions is constant.
            order = np.argsort(last.x)
            r, radial = (column[order].reshape(-1, 4).mean(1) for column in (last.x, last.s11))
            off = np.abs(radial + 2 / sqrt(3) * Y * np.log(B / r)).max()
            yield Row("largest error of the radial stress / yield stress", 0.0, off, 0.01,
                      source)  # fmt: skip
    axes.axhline(BEARS, color="k", lw=0.7, label="2/sqrt(3) Y ln(b/a)")
    axes.set(xlabel="displacement inside / (a Y/E)", ylabel="pressure / Y")
