"""Bar that vibrates in its first mode: frequency and energy over ten periods."""

from math import pi

import numpy as np

from comparisons.exact import bar_frequency
from comparisons.row import Row

SMALL = {}


def frequency(time, v):
    """omega from the falls of a velocity through zero, linear in between."""
    falls = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))
    crossings = time[falls] + (time[falls + 1] - time[falls]) * v[falls] / (v[falls] - v[falls + 1])
    return 2 * pi * (len(crossings) - 1) / (crossings[-1] - crossings[0])


def compare(run, axes, full):
    """FLIP, linear functions, 25 cells.

    Lumped masses and linear functions change omega by (k h)^2 / 24 with k h = pi / 50: 2e-4. The
    free end shares mass with an empty node. This acts like up to h/4 of length, 1 %, but is of
    second order in k h, because the wave has no slope there.

    """
    log = run().log
    omega, source = bar_frequency(25, 100, 1), "first mode (exact)"
    yield Row("frequency (rad/s)", omega, frequency(log.Time, log.v_x), 0.002, source)
    energy = log.Ek + log.Es
    first, last = energy[log.Time < 10].mean(), energy[log.Time > 90].mean()
    yield Row(
        "final / initial energy",
        (0.98, 1.002),
        last / first,
        0.0,
        "exact; lumped masses cost a little",
    )
    axes.plot(log.Time, log.exact, "k-", lw=1, label="exact")
    axes.plot(log.Time, log.v_x, "--", lw=1.4, label="computed")
    # The last three periods, where a difference in frequency would have added up.
    axes.set(xlabel="time (s)", ylabel="mean velocity (m/s)", xlim=(70, 100))
