"""Sod's shock tube: plateaus and shock against the exact solution."""

import numpy as np

from comparisons.exact import riemann
from comparisons.row import Row

SOURCE = "exact (Sod 1978; Toro 2009, section 4.3)"
GAMMA, TIME = 1.4, 0.143
PRESSURE, SPEED, SHOCK = 0.30313, 0.92745, 1.75216
LEFT, RIGHT = 0.42632, 0.26557  # densities beside the contact
SMALL = {}  # it takes 230 steps


def compare(run, axes, full):
    """Plateaus are read 0.03 away from all fronts: the shock is spread over some five cells."""
    result = run()
    last = result.snapshots("sod")[-1]
    density, p = last.mass / last.volume, -last.s11
    contact, shock = 0.5 + SPEED * TIME, 0.5 + SHOCK * TIME
    behind = (last.x > 0.53) & (last.x < contact - 0.03)
    ahead = (last.x > contact + 0.03) & (last.x < shock - 0.03)
    for side, place, exact in (("left", behind, LEFT), ("right", ahead, RIGHT)):
        name = f"{side} of the contact"
        yield Row(f"density {name}", exact, density[place].mean(), 0.01, SOURCE)
        yield Row(f"pressure {name}", PRESSURE, p[place].mean(), 0.01, SOURCE)
        yield Row(f"velocity {name}", SPEED, last.vx[place].mean(), 0.01, SOURCE)
    front = last.x[(p > (PRESSURE + 0.1) / 2) & (last.x > 0.65)].max()
    yield Row("speed of the shock", SHOCK, (front - 0.5) / TIME, 0.01, SOURCE)
    log = result.log
    lost = abs(log.total).max() / log.Ek[-1]
    # What is left is of the order of the step; without the heat of what TPIC takes it is 3 %.
    yield Row("energy lost / kinetic energy", 0.0, lost, 0.01, "conservation of energy")
    axes.plot(last.x, density, "o", ms=2.5, mfc="none", label="density")
    axes.plot(last.x, p, "s", ms=2.5, mfc="none", label="pressure")
    x = np.linspace(0.25, 0.85, 2000)
    profiles = riemann((1.0, 1.0), (0.125, 0.1), GAMMA)
    for quantity in profiles((x - 0.5) / TIME)[::2]:
        axes.plot(x, quantity, "k-", lw=0.7)
    axes.plot([], [], "k-", lw=0.7, label="exact")
    axes.set(xlabel="x / length of the tube", ylabel="density, pressure", xlim=(0.25, 0.85))
