"""Thick cylinder widened from inside: pressure, displacement and stress against Lame's solution."""

import numpy as np

from comparisons.row import Row

SOURCE = "exact (Lame 1852)"
A, B, E, NU, U, PPC = 1.0, 2.0, 1e3, 0.3, 1e-4, 2
# Plane strain: u(a) = (1 + nu)/E p a ((1 - 2 nu) a^2 + b^2)/(b^2 - a^2).
PRESSURE = E / (1 + NU) * U / A * (B**2 - A**2) / ((1 - 2 * NU) * A**2 + B**2)
SMALL = {}  # two seconds


def compare(run, axes, full):
    """Pressure inside, displacement outside, and the largest errors over the wall."""
    result = run()
    last = result.snapshots("lame")[-1]
    # Sums over the points of a cell: inside one the strain of linear functions is constant.
    order = np.argsort(last.x0)
    r, moved, radial, axial, hoop = (
        column[order].reshape(-1, PPC**2).mean(1)
        for column in (last.x0, last.x - last.x0, last.s11, last.s22, last.s33)
    )
    share = PRESSURE * A**2 / (B**2 - A**2)
    u = (1 + NU) / E * share * ((1 - 2 * NU) * r + B**2 / r)
    stresses = {
        "radial stress": (radial, share * (1 - B**2 / r**2)),
        "hoop stress": (hoop, share * (1 + B**2 / r**2)),
        "axial stress": (axial, np.full_like(r, 2 * NU * share)),
    }
    yield Row("pressure inside", PRESSURE, result.log.pressure[-1], 0.005, SOURCE)
    yield Row("displacement of the outermost cell", u[-1], moved[-1], 0.002, SOURCE)
    fine = np.linspace(A, B, 200)
    for k, (name, (found, exact)) in enumerate(stresses.items()):
        off = abs(found - exact).max() / PRESSURE
        yield Row(f"largest error of the {name} / pressure", 0.0, off, 0.01, SOURCE)
        axes.plot(r, found / PRESSURE, "os^"[k], ms=4, mfc="none", label=name)
    for exact in (1 - B**2 / fine**2, 1 + B**2 / fine**2, np.full_like(fine, 2 * NU)):
        axes.plot(fine, exact * share / PRESSURE, "k-", lw=0.7)
    axes.plot([], [], "k-", lw=0.7, label="exact")
    axes.set(xlabel="radius / inner radius", ylabel="stress / pressure inside")
