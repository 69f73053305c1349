"""Manufactured solution of a vibrating square: order of the displacement."""

import numpy as np

from comparisons.row import Row

SMALL = {"CFL": 0.8}


def compare(run, axes, full):
    """Linear functions while no point crosses a cell, tlmpm and, in full, CPDI while they do."""
    ways = {
        "linear, points stay in their cells": {"G": 1e-4},
        "tlmpm, large deformation": {"kind": "tlmpm", "G": 0.1},
    }
    if full:
        ways["CPDI R4, points cross cells"] = {"kind": "ulcpdi", "domains": "R4", "G": 0.1}
    cells = np.array([8, 16, 32])
    for name, words in ways.items():
        errors = [run(refine=n / 16, **words).log.error_z[-1] for n in cells]
        order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
        source = "Wallstedt & Guilkey 2008 (exact)"
        yield Row(f"order of the error, {name}", 2.0, order, 0.1, source)
        # A half wave over 32 cells: (pi/32)^2 = 1 %, times a constant of about one.
        yield Row(f"error with 32 cells, {name}", 0.0, errors[-1], 0.015, source)
        axes.loglog(cells, errors, "o-", label=name)
    axes.set(xlabel="cells", ylabel="relative error of the displacement")
