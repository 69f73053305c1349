"""Heat that flows into a slab, against the error function."""

from math import erfc, pi, sqrt

import numpy as np

from comparisons.row import Row

SOURCE = "Carslaw & Jaeger 1959, 2.4 (exact)"
SMALL = {"refine": 1 / 4}
COLD, RISE = 300.0, 100.0
KAPPA, CAPACITY = 401.0, 8960.0 * 385.0


def compare(run, axes, full):
    """Temperatures at the end, and what flowed through the face."""
    result = run()
    points = result.snapshots("heat_slab")[-1]
    reach = 2 * sqrt(KAPPA / CAPACITY * points["TIME"])
    exact = COLD + RISE * np.array([erfc(x / reach) for x in points.x])
    axes.plot(1e3 * points.x, exact, "k-", lw=1, label="exact")
    axes.plot(1e3 * points.x, points["T"], "o", ms=4, mfc="none", markevery=0.04, label="computed")
    axes.set(xlabel="depth (mm)", ylabel="temperature (K)")
    error = sqrt(np.mean((points["T"] - exact) ** 2)) / RISE
    # Second order in the cell: 0.0016 with 20 cells.
    yield Row("rms error of the temperature / its rise", 0.0, error, 2e-4 if full else 3e-3, SOURCE)
    flux = KAPPA * RISE / sqrt(pi * KAPPA / CAPACITY * points["TIME"])
    yield Row("heat flux (W/m2)", flux, result.log.face_s[-1], 0.01, SOURCE)
    log = result.log
    yield Row("heat in the slab (J/m2)", log.exact[-1], log.heat[-1], 0.01, SOURCE)
