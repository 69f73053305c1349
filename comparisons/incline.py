"""Elastic disk on an incline: it slides, or it rolls."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from comparisons.row import Row

SMALL = None  # tests of its own (tests/test_verification_beams.py)
G = 10.0


def compare(run, axes, full):
    """Acceleration down the incline, from 0.2 s on."""
    slides = G * (sin(radians(45)) - 0.1 * cos(radians(45)))
    rolls = 2 / 3 * G * sin(radians(30))
    cases = {
        "slides": ({"angle": 45, "mu": 0.1}, slides, 0.002),
        "rolls, 24 cells across": ({"refine": 2}, rolls, 0.05),
    }
    for name, (words, expected, within) in cases.items():
        log = run(**words).log
        late = log.Time > 0.2
        found = np.polyfit(log.Time[late], log.v_x[late], 1)[0]
        yield Row(f"acceleration, {name} (m/s2)", expected, found, within, "rigid disk (exact)")
        axes.plot(log.Time, log.v_x, lw=1, label=name)
        axes.plot(log.Time, expected * log.Time, "k--", lw=0.8)
    axes.set(xlabel="time (s)", ylabel="velocity (m/s)")
