"""Elastic disk on a rigid plane: force and stress below the contact against Hertz."""

import numpy as np

from comparisons.exact import hertz_load, hertz_stress
from comparisons.row import Row

SMALL = {}
R, APPROACH, SURFACE, MODULUS = 1.0, 0.02, 0.27, 1e6 / (1 - 0.3**2)
LOAD = hertz_load(APPROACH, R, MODULUS)
HALF = np.sqrt(4 * LOAD * R / (np.pi * MODULUS))  # width of the contact
LARGEST = 2 * LOAD / (np.pi * HALF)
# Of the force, by cells in the radius: the rim is met early or late by less than its steps.
CUT = {16: 0.1, 32: 0.03, 64: 0.025, 128: 0.0125}
# Of the force, by cells in the radius: the rim is met early or late by less than its steps.
CUT = {16: 0.1, 32: 0.03, 64: 0.025, 128: 0.0125}
HERTZ = "Hertz 1882; Johnson 1985 (exact)"


def error(last, top=0.3):
    """Of the stress between `top` and 1.5 half widths deep, rms over the largest pressure."""
    depth = last.y - SURFACE
    near = (last.y0 > 0.25) & (last.x < 1.5 * HALF)
    near &= (depth > top * HALF) & (depth < 1.5 * HALF)
    off = last.s22[near] - hertz_stress(last.x[near], depth[near], LOAD, HALF)
    return np.sqrt((off**2).mean()) / LARGEST


def beside(last, cell):
    """Place and mean pressure of each column of cells, of the points above 0.3 half widths."""
    near = (last.y0 > 0.25) & (last.x < 1.5 * HALF) & (last.y - SURFACE < 0.3 * HALF)
    column = (last.x[near] / cell).astype(int)
    count = np.bincount(column)
    there = count > 0
    sums = (np.bincount(column, values)[there] for values in (last.x[near], -last.s22[near]))
    return [of / count[there] for of in sums]


def compare(run, axes, full):
    """Force and stress on finer and finer grids, and with finer points on one of them.

    With whole squares of points the rim has steps of 1 / ppc of a cell. The plane is met up to half
    a step too early or late, a quarter on average. Squares that are cut at the rim err less.
    """
    cases = [("linear", 2, "cut", (16, 32))]
    if full:
        cases = [("linear", 2, "cut", (16, 32, 64))]
        cases.append(("quadratic-spline", 2, "cut", (16, 32, 64, 128)))
        cases += [("linear", 2, "regular", (16, 32, 64)), ("linear", 4, "regular", (32,))]
    for basis, ppc, rim, sizes in cases:
        errors = []
        for cells in sizes:
            result = run(refine=cells / 32, basis=basis, ppc=ppc, rim=rim)
            last = result.snapshots("hertz")[-1]
            force = result.log.force[result.log.Time > 0.45].mean()
            errors.append(error(last))
            of = f"{basis}, {ppc} x {ppc} points, {rim}, {cells} cells"
            within = CUT[cells] if rim == "cut" else R / cells / ppc / 4 / APPROACH
            yield Row(f"force, {of} (kN/m)", LOAD / 1000, force / 1000, within, HERTZ)
            # Of first order: some cells below the contact err, whatever their size.
            quantity = "rms error of the stress / largest stress"
            yield Row(f"{quantity}, {of}", 0.0, errors[-1], 6 / cells, HERTZ)
            yield Row(f"{quantity}, deeper than 0.7 half widths, {of}", 0.0, error(last, 0.7),
                      4 / cells, HERTZ)  # fmt: skip
        label = f"{basis}, {ppc} x {ppc}, {rim}, {cells} cells"
        x, stress = beside(last, R / cells)
        axes.plot(x / HALF, stress / LARGEST, "o-", ms=4, mfc="none", lw=0.6, label=label)
        if len(sizes) > 1:
            slope = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
            of = f"{basis}, {rim}, {sizes[0]} to {sizes[-1]} cells"
            # Steps of the rim leave order 1; where they do not show, the basis has order 2.
            yield Row(
                f"order of the stress error, {of}", (1.0, 2.0), slope, 0.3, "steps of the rim"
            )
    x, deep = np.linspace(0, 1.5, 100), np.linspace(0.01, 0.3, 30)[:, None]
    exact = -hertz_stress(x * HALF, deep * HALF, LOAD, HALF).mean(axis=0) / LARGEST
    axes.plot(x, exact, "k-", lw=1, label="Hertz (exact)")
    axes.set(xlabel="x / half width", ylabel="stress near the plane / largest pressure")
