"""Bar that vibrates in its first mode, in steps of 10 and 100 times the wave transit of a cell."""

import numpy as np

from comparisons.row import Row

SMALL = None  # tests/test_implicit.py has the bar
SOURCE = "trapezoidal rule (exact)"


def compare(run, axes, full):
    """Three periods of 4000 h/c."""
    for courant, mark, within in ((10, "C0-", 1e-6), (100, "C1o", 1e-5)):
        log = run(courant=courant).log
        energy = log.Ek + log.Es
        name = f"steps of {courant} h/c"
        off = np.abs(log.v_x - log.exact).max() / log.exact[0]
        yield Row(f"{name}: largest error / initial velocity", 0.0, off, 5e-3, SOURCE)
        yield Row(f"{name}: final / initial energy", 1.0, energy[-1] / energy[0], within,
                  "exact")  # fmt: skip
        axes.plot(log.Time, log.v_x, mark, ms=3, lw=0.8, label=name)
    axes.plot(log.Time, log.exact, "k-", lw=0.7, label="trapezoidal rule, 100 h/c")
    axes.set(xlabel="time (s)", ylabel="mean velocity (m/s)")
