"""Steel disk into aluminium, 1160 m/s, plane strain: its path against a published program."""

from math import sqrt
from pathlib import Path

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

# The program limits the norm of the deviator in the plane to 300 MPa. Where plane plastic flow is
# fully developed, that is von Mises' limit with sqrt(3/2) of it.
TABLE = Path(__file__).parent / "data" / "disk_impact_sinaie.csv"
SOURCE = "formulas of Sinaie et al. 2017"
YIELD = 300e6 * sqrt(3 / 2)
FINE = 19.04  # mm, the last depth of the same formulas with cells of half the size
SMALL = {}  # the published size is small enough


def compare(run, axes, full):
    """Depth and speed along the way, energy at the end."""
    time, depth, speed, kinetic = np.loadtxt(TABLE, delimiter=",", comments="#", skiprows=4).T
    result = run(Y=YIELD)
    log = result.log
    t = 1e6 * log.Time
    for at in (10, 20, 40):
        there, here = np.interp(at, time, depth), np.interp(at, t, log.depth)
        # The block and the disk meet its grid 0.3 mm apart from where they do here.
        yield Row(f"depth at {at} us (mm)", there, here, 0.03 if at > 10 else 0.05, SOURCE)
    there, here = np.interp(20, time, speed), np.interp(20, t, log.vd_y)
    yield Row("velocity of the disk at 20 us (m/s)", there, here, 0.03, SOURCE)
    yield Row("kinetic energy at 40 us (kJ/m)", kinetic[-1], log.Ek[-1] / 1e3, 0.05, SOURCE)
    yield Row("final / initial energy", 1.0, log.Etot[-1] / log.Etot[0], 0.02, "exact")
    yield Row("sideways speed of the disk (m/s)", 0.0, log.vd_x[-1], 1e-6, "symmetry")
    axes.plot(time, depth, "k--", lw=1, label=SOURCE)
    axes.plot(t, log.depth, lw=1, label="von Mises 367 MPa")
    if full:
        fine = run(Y=YIELD, refine=2).log
        yield Row("depth at 40 us, cells of half the size (mm)", FINE, fine.depth[-1], 0.03, SOURCE)
        axes.plot(1e6 * fine.Time, fine.depth, lw=1, label="cells of half the size")
    last = result.snapshots("disk_impact")[-1]
    inset = axes.inset_axes([0.44, 0.05, 0.46, 0.6])
    coloured(inset, last.x, last.y, last.ep, "plastic strain")
    inset.set(aspect="equal", xticks=[], yticks=[])
    axes.set(xlabel="time (µs)", ylabel="depth of the foot of the disk (mm)")
