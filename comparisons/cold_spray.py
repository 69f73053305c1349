"""Copper ball on copper at 500 m/s, a quarter in 3D: strain and heat against axisymmetry."""

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

SOURCE = "in.cold_spray_axisymmetric"
SAME = {"ppc": 2, "refine": 25 / 40}  # cells of 1.6 um, too
ENERGY = 2 / 3 * np.pi * 10e-6**3 * 8960 * 500**2 * 1e9  # of the ball at first, in nJ
SMALL = None  # tests/test_paper_scenes.py runs it axisymmetric


def weighted(points, column, of):
    """Mean over the points of a solid by mass."""
    there = points.type == of
    return np.average(points[column][there], weights=points.mass[there])


def exceeded(points, share, of):
    """The plastic strain that a share of a solid exceeds, by mass."""
    there = points.type == of
    order = np.argsort(points.ep[there])
    mass = points.mass[there][order]
    behind = np.cumsum(mass) - 0.5 * mass
    return np.interp((1 - share) * mass.sum(), behind, points.ep[there][order])


def compare(run, axes, full):
    """Mean and largest plastic strain and temperature, shape, energies."""
    plane, space = run(scene="cold_spray_axisymmetric", **SAME), run()
    flat, solid = plane.log, space.log
    a = plane.snapshots("cold_spray_axisymmetric")[-1]
    b = space.snapshots("cold_spray")[-1]
    for column, name, zero in (
        ("ep", "plastic strain", 0.0),
        ("T", "rise of temperature (K)", 298.0),
    ):
        there, here = weighted(a, column, 2) - zero, weighted(b, column, 2) - zero
        yield Row(f"mean {name} of the ball", there, here, 0.05, SOURCE)
    # The largest of all is that of one point at the rim of the contact, and grows with the grid.
    there, here = exceeded(a, 0.05, 2), exceeded(b, 0.05, 2)
    yield Row("plastic strain that 5 % of the ball exceed", there, here, 0.05, SOURCE)
    yield Row("largest plastic strain", flat.worst_Epmax[-1], solid.worst_Epmax[-1], 0.1, SOURCE)
    rise = flat.flat_Tmax[-1] - 298
    yield Row("largest rise of temperature (K)", rise, solid.flat_Tmax[-1] - 298, 0.1, SOURCE)
    yield Row(
        "height of the top of the ball above the block (um)",
        flat.height[-1],
        solid.height[-1],
        0.05,
        SOURCE,
    )
    yield Row("plastic work (nJ)", flat.spent[-1], solid.spent[-1], 0.05, SOURCE)
    for log, what in ((flat, "axisymmetric"), (solid, "in 3D")):
        # The transfer loses a hundredth of what differs between points and grid in each step.
        total = (log.kinetic[-1] + log.spent[-1] + log.stored[-1]) / ENERGY
        yield Row(f"final / initial energy, {what}", (0.85, 1), total, 0.0, "balance")
    cut = b.y0 < 1.5 * b.y0.min()  # the layer of points beside a plane of symmetry
    x, y = np.append(a.x, -b.x[cut]), np.append(a.y, b.z[cut])
    heat = np.append(a["T"], b["T"][cut])
    coloured(axes, 1e6 * x, 1e6 * y, heat, "temperature (K)", limits=(298, 500))
    for at, what in ((-28, "in 3D"), (28, "axisymmetric")):
        axes.text(at, 33, what, ha="center", fontsize=8)
    axes.set(xlabel="radius (um)", ylabel="height (um)", aspect="equal")
