"""Manufactured solution of a vibrating square: order of the displacement."""

from __future__ import annotations

import numpy as np

from comparisons.row import Row

SMALL = None  # tests of its own (tests/test_verification.py)


def compare(run, axes, full):
    """Linear functions while no point crosses a cell, cpgimp and CPDI while they do."""
    ways = {
        "linear, points stay": {"G": 1e-4},
        "CPDI R4, points cross": {"kind": "ulcpdi", "domains": "R4", "G": 0.1},
        "tlmpm, far deformation": {"kind": "tlmpm", "G": 0.1},
    }
    cells = np.array([8, 16, 32])
    for name, words in ways.items():
        errors = [run(refine=n / 16, **words).log.error_z[-1] for n in cells]
        order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
        yield Row(f"order, {name}", 2.0, order, 0.1, "Wallstedt & Guilkey 2008 (exact)")
        axes.loglog(cells, errors, "o-", label=name)
    axes.set(xlabel="cells", ylabel="relative error of the displacement")
