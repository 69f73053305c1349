"""Rigid strip that is pressed into clay: the load when it yields, against Prandtl."""

from __future__ import annotations

from math import pi

from comparisons.row import Row

SMALL = None  # tests of its own (tests/test_verification_beams.py)


def compare(run, axes, full):
    """With volumes averaged against locking."""
    log = run().log
    late = log.Time > 0.7
    yield Row("load / c", 2 + pi, log.load[late].mean(), 0.05, "Prandtl 1920 (exact)")
    axes.plot(log.Time, log.load, lw=1, label="computed")
    axes.axhline(2 + pi, color="k", lw=1, ls="--", label="2 + pi")
    axes.set(xlabel="time (s)", ylabel="load / c")
