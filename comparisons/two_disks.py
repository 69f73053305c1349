"""Two elastic disks that bounce: energies against Karamelo's, contact against the exact time."""

from pathlib import Path

import numpy as np

from comparisons.row import Row

KARAMELO = Path(__file__).parent / "data" / "two_disks_karamelo.csv"
SMALL = {}


def compare(run, axes, full):
    """The published grid, and a finer one for the time of contact.

    The two programs differ by rounding only (Karamelo reads numbers in single precision), which has
    grown to about 2e-6 of the initial energy by the end.
    """
    _, _, t, kinetic, strain = np.loadtxt(KARAMELO, delimiter=",", skiprows=2, unpack=True)
    log = run().log
    for name, column, theirs in (("kinetic", log.Ek, kinetic), ("strain", log.Es, strain)):
        ours = np.interp(t, log.Time, column)
        off = np.abs(ours - theirs).max() / log.Ek[0]
        yield Row(
            f"{name} energy, largest difference / initial kinetic energy",
            0.0,
            off,
            0.01,
            "Karamelo",
        )
        axes.plot(log.Time, column, lw=1, label=f"{name} energy")
        axes.plot(t[::2], theirs[::2], "k+", ms=4, label="Karamelo" if name == "strain" else None)
    if full:
        fine = run(N=80).log
        felt = fine.Time[np.argmax(fine.Es > 1e-4 * fine.Ek[0])]
        # Functions of the grid meet a cell before the disks do.
        yield Row("start of contact with 80 cells (s)", 1.5858, felt, 0.08, "exact")
    axes.set(xlabel="time (s)", ylabel="energy per thickness (J/m)")
