"""Bar that vibrates in its first mode: frequency and energy over ten periods."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from comparisons.row import Row

SMALL = None  # tests of its own (tests/test_verification.py)
OMEGA = pi / (2 * 25) * sqrt(100 / 1)


def frequency(time, v):
    """omega from the falls of a velocity through zero, linear in between."""
    falls = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))
    crossings = time[falls] + (time[falls + 1] - time[falls]) * v[falls] / (v[falls] - v[falls + 1])
    return 2 * pi * (len(crossings) - 1) / (crossings[-1] - crossings[0])


def compare(run, axes, full):
    """FLIP, linear functions, 25 cells."""
    log = run().log
    yield Row("frequency (rad/s)", OMEGA, frequency(log.Time, log.v_x), 0.002, "first mode (exact)")
    energy = log.Ek + log.Es
    last = log.Time > log.Time[-1] * 0.9
    yield Row("energy kept", 1.0, energy[last].mean() / energy[0], 0.01, "exact")
    axes.plot(log.Time, log.exact, "k-", lw=1, label="exact")
    axes.plot(log.Time, log.v_x, ".", ms=2, label="computed")
    axes.set(xlabel="time", ylabel="mean velocity")
