"""Copper rod against a wall, 227 m/s, axisymmetric: final shape against finite element codes."""

from comparisons.pictures import coloured
from comparisons.row import Row

SOURCE = "finite element codes, as quoted"
LENGTH, RADIUS = (21.4, 21.5), (7.0, 7.2)  # mm, of several codes
ENERGY = 239.6  # J, at the start
SMALL = {"refine": 1 / 2}


def compare(run, axes, full):
    """Length and head, and where the kinetic energy goes."""
    result = run()
    log = result.log
    # The ranges are of few codes: one more may lie as far outside as they are wide.
    yield Row("length (mm)", LENGTH, log.length[-1], 0.01, SOURCE)
    yield Row("radius of the head (mm)", RADIUS, log.radius[-1], 0.03, SOURCE)
    yield Row("kinetic energy at the start (J)", ENERGY, log.E_kinetic[0], 2e-3, SOURCE)
    # What is missing is lost by the transfer, FLIP 0.99.
    spent = log.E_dissipated[-1] / ENERGY
    yield Row(
        "fraction of the energy spent on plastic flow",
        1.0,
        spent,
        0.03,
        "no elastic vibration left",
    )
    last = result.snapshots("taylor_bar_227")[-1]
    coloured(axes, 1e3 * last.x, 1e3 * last.y, last.ep, "plastic strain", bar=0.08)
    axes.axhspan(*LENGTH, color="k", alpha=0.3, label="length, finite elements")
    axes.axvspan(*RADIUS, color="r", alpha=0.3, label="radius, finite elements")
    axes.set(xlabel="radius (mm)", ylabel="height (mm)", aspect="equal", xlim=(0, 12))
