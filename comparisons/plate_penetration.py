"""Lead ball through a lead plate at 6.58 km/s: shock, momentum, energy, speed of the debris."""

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

RHO, C0, S, V = 11350.0, 2030.0, 1.47, 6580.0
U = V / 2  # behind the shock, of two bodies of one material
PRESSURE = RHO * (C0 + S * U) * U / 1e9  # GPa, 256
THROUGH = 2e-3 / (C0 + S * U)  # s, the time of the shock through the plate
MASS = RHO * 4 / 3 * np.pi * 7.5e-3**3 / 4
SMALL = None  # tests/test_paper_scenes.py runs it


def compare(run, axes, full):
    """The first 15 us."""
    result = run()
    log = result.log
    # From when the shock has passed half of the plate to when its release is back there.
    there = (log.Time > 0.7 * THROUGH) & (log.Time < 1.4 * THROUGH)
    # Artificial viscosity and the heat of shear are in it, too.
    yield Row("pressure behind the shock (GPa)", PRESSURE, log.p[there].mean(), 0.2, "Hugoniot")
    yield Row("momentum / momentum of the ball", 1.0, -log.P_z[5] / (MASS * V), 0.03, "exact")
    # Later, what splashes back leaves the domain.
    kept = log.P_z[log.Time < 5e-6][-1] / log.P_z[0]
    yield Row("momentum at 5 us / initial momentum", 1.0, kept, 1e-6, "exact")
    total = (log.Ek + log.Es + log.lost) / log.Ek[0]
    yield Row("final / initial energy", 1.0, total[-1], 0.03, "exact")
    last = result.snapshots("plate_penetration")[-1]
    # It is free to spread sideways, too, which a plane shock does not know.
    plug = (last.type == 2) & (np.hypot(last.x0, last.y0) < 3e-3)
    speed = -np.average(last.vz[plug], weights=last.mass[plug])
    yield Row("speed of the plug (m/s)", V, speed, 0.15, "2 x speed behind the shock")
    ahead = -last.z[last.type == 2].min() / (15e-6 * V)
    yield Row(
        "position of the front / (v t)", (0.9, 1.1), ahead, 0.05, "2 x speed behind the shock"
    )
    cut = last.y < 1e-3  # a cell beside a plane of symmetry, and its image in the other
    along, across, speed = (1e3 * a[cut] for a in (-last.z, last.x, -last.vz / 1e6))
    along, across, speed = np.tile(along, 2), np.append(across, -across), np.tile(speed, 2)
    name = "speed along the flight (km/s)"
    coloured(axes, along, across, speed, name, cmap="plasma", limits=(-2, 9))
    axes.set(xlabel="distance behind the plate (mm)", ylabel="x (mm)", aspect="equal")
