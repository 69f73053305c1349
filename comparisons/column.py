"""Column under its own weight: convergence of the stress with CPDI."""

import numpy as np

from comparisons.row import Row
from karamelo_py.app.studies import look

SMALL = None  # orders take several grids; tests/test_verification.py has other properties
WEIGHT = 80 * 9.81 * 10


def compare(run, axes, full):
    """Mean error of the vertical stress from 16 to 64 cells, as Wyser et al. 2020 measure it."""
    cells, errors = (16, 32, 64), []
    for n in cells:
        words = {"kind": "ulcpdi", "domains": "Q4", "refine": n / 16}
        last = run(**words).snapshots("column")[-1]
        exact = -80 * 9.81 * (10 - last.y0)
        errors.append(np.abs(last.s22 - exact).mean() / WEIGHT)
    order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    # The order falls short of the published one; docs/verification.md has it up to 512 cells.
    yield Row("order of the stress", 2.0, order, 0.15, "Wyser et al. 2020")
    yield Row("error with 64 cells", 0.0, errors[-1], 3e-4, "equilibrium (exact)")
    axes.loglog(cells, errors, "o-", label="CPDI Q4")
    look.slope(axes, [(cells, errors)], -2)
    axes.set(xlabel="cells", ylabel="mean error of the stress / (rho g l0)")
