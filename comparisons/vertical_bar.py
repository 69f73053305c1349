"""Cube that hangs from its upper face under a sudden weight, in three dimensions."""

from comparisons.row import Row

SMALL = None  # with fewer cells it is another bar


def compare(run, axes, full):
    """Lowest point. The finite elements of the tests give 1.66 m if the upper face is clamped, and
    1.76 m if it may slide. The published number lies between. The script clamps it."""
    log = run(refine=2).log
    lowest = log.tip_s.argmax()
    source = "finite elements (benchmark, see docs/verification.md)"
    yield Row("lowest point (m)", -1.7146, -log.tip_s[lowest], 0.05, source)
    yield Row("time of the lowest point (s)", 0.0882, log.Time[lowest], 0.06, source)
    yield Row("lowest point, clamped (m)", -1.662, -log.tip_s[lowest], 0.02, "own finite elements")
    axes.plot(log.Time, -log.tip_s, lw=1, label="tlmpm, 8 cells")
    axes.plot(0.0882, -1.7146, "k+", ms=12, label="published")
    axes.axhline(-1.662, color="k", ls=":", lw=1, label="finite elements, upper face clamped")
    axes.set(xlabel="time (s)", ylabel="height of the lower corner (m)")
