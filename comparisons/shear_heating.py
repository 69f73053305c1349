"""Adiabatic heating of a sheared block: temperature against the closed form."""

from math import sqrt

import numpy as np

from comparisons.row import Row

RHO, E, NU, Y, H = 8930, 117e9, 0.35, 400e6, 100e6
CHI, CP, T0 = 0.9, 385, 298  # Taylor & Quinney 1934
L = 10e-3
SMALL = {"refine": 1 / 2}


def solution(gamma):
    """Plastic strain, its work per volume, and the temperature after a shear gamma.

    The shear strain gamma is q/(sqrt(3) G) elastic and sqrt(3) ep plastic, with q = Y + H ep. This
    neglects the rotation of the elastic strain, of the order q/G.
    """
    shear_modulus = E / (2 * (1 + NU))
    ep = np.maximum(0, (gamma / sqrt(3) - Y / (3 * shear_modulus)) / (1 + H / (3 * shear_modulus)))
    work = Y * ep + H * ep**2 / 2
    return ep, work, T0 + CHI * work / (RHO * CP)


def compare(run, axes, full):
    """Heating, at half and at the full shear, and the energy dissipated."""
    log = run().log
    source = "closed form"
    for gamma in (0.5, 1.0):
        ep, work, temperature = solution(gamma)
        mean = np.interp(gamma, log.sheared, log.T)
        yield Row(
            f"heating at a shear of {gamma:g} (K)", temperature - T0, mean - T0, 0.005, source
        )
    # Shear is the same everywhere: so is the temperature.
    yield Row(
        "temperature rise of the hottest point (K)",
        temperature - T0,
        log.worst_Tmax[-1] - T0,
        0.005,
        source,
    )
    yield Row("plastic strain", ep, log.worst_Epmax[-1], 0.005, source)
    yield Row("dissipated energy (J)", work * L**2, log.lost[-1], 0.005, source)
    axes.plot(log.sheared, solution(log.sheared)[2], "k-", lw=0.8, label=source)
    axes.plot(log.sheared, log.T, "o", ms=4, mfc="none", markevery=0.05, label="mean of the points")
    axes.set(xlabel="shear", ylabel="temperature (K)")
