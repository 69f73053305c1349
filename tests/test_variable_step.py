"""Steps that change: what a velocity belongs to, order, and energy.

Places belong to the ends of steps, velocities to their middles (leapfrog). With steps dt_n a force
acts for (dt_(n-1) + dt_n)/2. Kicks of dt_n would be of first order and feed vibrations.
"""

from itertools import pairwise, product
from math import cos, factorial, log, pi, sqrt

import numpy as np
import pytest
from conftest import INPUTS
from scenes import SCHEMES, block
from selection import few, parameters

DT = (0.002, 0.003, 0.0012, 0.0026, 0.0026, 0.0015)
STEPS = "\n".join(f"set_dt({dt})\nrun(1)" for dt in DT)


TAKEN = list(zip(SCHEMES, ("FLIP", "APIC", "XPIC", "FLIP"), strict=True))
OTHERS = [way for way in product(SCHEMES, ("FLIP", "APIC", "XPIC")) if way not in TAKEN]


@pytest.mark.parametrize(("scheme", "transfer"), parameters(TAKEN, OTHERS))
def test_velocities_belong_to_the_middles_of_steps(state_interpreted, scheme, transfer):
    """In free fall the velocity grows by g times the time between the middles, to round-off."""
    fall = ("fix(g, body_force, all, 0, -3)", STEPS)
    state = state_interpreted(block(2, *fall, scheme=scheme, transfer=transfer, size=(0.2, 0.2)))
    # The first kick is that of a whole step: the velocity at the start counts for its middle.
    fallen = DT[0] + sum((a + b) / 2 for a, b in pairwise(DT))
    assert state["v"][:, 1] == pytest.approx(-3 * fallen, rel=1e-12)


def test_reactions_are_impulses_over_the_kick(run_interpreted):
    """A floor bears the weight of what rests on it (m g), whatever the steps."""
    lines = [
        "region(all_of_it, block, 0, 1.2, 0, 1.2)",
        "group(nodes, nodes, region, all_of_it, all)",
        "fix(g, body_force, all, 0, -3)",
        "fix(hold, velocity_nodes, nodes, 0, 0)",
        "log_modify(custom, step, hold_y)",
        "set_output(1)",
        STEPS,
    ]
    log = run_interpreted(block(2, *lines)).log
    assert log.hold_y[1:] == pytest.approx(np.full(len(DT), 2 * 0.3 * 0.2 * 3), rel=1e-9)


def test_prescribed_points_bear_their_inertia(run_interpreted):
    """A grip that is accelerated evenly needs m a, whatever the steps."""
    lines = [
        "group(pull, particles, region, box, all)",
        "fix(pull, velocity_particles, pull, 4*time, NULL)",
        "log_modify(custom, step, pull_x)",
        "set_output(1)",
        STEPS,
    ]
    log = run_interpreted(block(2, *lines)).log
    # v goes from a t_(n-1) to a t_n in a kick: a dt_(n-1) over the kick.
    kicks = [(a + b) / 2 for a, b in pairwise(DT)]
    exact = [2 * 0.3 * 0.2 * 4 * a / kick for a, kick in zip(DT, kicks, strict=False)]
    assert log.pull_x[2:] == pytest.approx(exact, rel=1e-9)


# --- a vibrating ring -------------------------------------------------------------------------

A, B = 1.0, 2.0
E, NU, RHO = 1000.0, 0.3, 1.0
LAMBDA, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
C = sqrt((LAMBDA + 2 * MU) / RHO)


def j(n: int, x: float) -> float:
    """Bessel function of the first kind, by its series."""
    return sum(
        (-1) ** m * (x / 2) ** (2 * m + n) / (factorial(m) * factorial(m + n)) for m in range(30)
    )


def y1(x: float) -> float:
    """Bessel function of the second kind and first order, by its series."""
    gamma = 0.5772156649015329
    total = 2 / pi * (log(x / 2) + gamma) * j(1, x) - 2 / (pi * x)
    for m in range(25):
        harmonic = sum(1 / k for k in range(1, m + 1)) + sum(1 / k for k in range(1, m + 2))
        term = harmonic * (x / 2) ** (2 * m + 1) / (factorial(m) * factorial(m + 1))
        total -= (-1) ** m * term / pi
    return total


def traction(f, k: float, r: float) -> float:
    """Radial stress over lambda + 2 mu of u = f(k r), without strain along the axis."""
    slope = (f(k * r * (1 + 1e-6)) - f(k * r * (1 - 1e-6))) / (2e-6 * r)
    return slope + LAMBDA / (LAMBDA + 2 * MU) * f(k * r) / r


def mode() -> tuple[float, float]:
    """Wave number k and share s of the lowest radial mode u = J1(k r) + s Y1(k r), free at A, B."""

    def misfit(k):
        s = -traction(lambda x: j(1, x), k, A) / traction(y1, k, A)
        return traction(lambda x: j(1, x) + s * y1(x), k, B), s

    low, high = 0.3, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        if misfit(low)[0] * misfit(middle)[0] <= 0:
            high = middle
        else:
            low = middle
    return low, misfit(low)[1]


K, S = mode()
OMEGA = K * C


def shape(r: np.ndarray) -> np.ndarray:
    """The lowest radial mode, 1 at the inner edge."""
    values = [j(1, K * x) + S * y1(K * x) for x in r]
    return np.array(values) / (j(1, K * A) + S * y1(K * A))


def uneven_steps(count: int, time: float) -> list[float]:
    """Steps that go up and down by a half, as often as the velocity: the worst for energy."""
    swing = np.array([1 + 0.5 * cos(2 * OMEGA * time * n / count + 1) for n in range(count)])
    return (swing * time / swing.sum()).tolist()


@pytest.mark.parametrize("grids", few(((2, 4), (4, 8)), (2, 4)))
def test_a_ring_converges_with_second_order(state_interpreted, grids):
    """A ring vibrates in its lowest radial mode for a good half period, on grids of 4 and 8 cells.

    Exact: linear elasticity in cylindrical coordinates without strain along the axis (Love).
    """
    time, small = 0.6 * 2 * pi / OMEGA, 1e-6
    errors = []
    for cells in grids:
        h = (B - A) / cells
        r = A + h * (0.25 + 0.5 * np.arange(2 * cells))
        nodes = np.linspace(A, B, 65)
        fit = np.polyfit(nodes, shape(nodes), 9)
        u = "".join(f"{c:+.12g}*x0^{9 - n}" for n, c in enumerate(fit)).lstrip("+")
        steps = uneven_steps(round(2 * time * C / h), time)
        script = [
            "method(tlmpm, FLIP, linear, 1)",
            f"dimension(2, 0, {B + 4 * h}, 0, {h}, {h})",
            "axisymmetric(true)",
            f"region(ring, block, {A}, {B}, 0, {h})",
            f"material(steel, linear, {RHO}, {E}, {NU})",
            f"solid(ring, region, ring, 2, steel, {h})",
            "fix(plane, velocity_nodes, all, NULL, 0)",
            f"fix(start, initial_velocity_particles, all, {small * OMEGA}*({u}), 0)",
            "log_modify(custom, step, time)",
            "set_output(1000)",
            *(f"set_dt({dt!r})\nrun(1)" for dt in steps),
        ]
        columns = state_interpreted("\n".join(script), "x", "x0")
        r, moved = columns["x0"], columns["x"] - columns["x0"]
        exact = small * np.sin(OMEGA * time) * shape(r)
        errors.append(np.sqrt(np.mean((moved - exact) ** 2)) / small)
    orders = [log(a / b) / log(2) for a, b in pairwise(errors)]
    # Kicks of dt_n leave orders of 1.2 and less here.
    assert min(orders) > 1.8, (errors, orders)


@pytest.mark.parametrize("scheme", ["usf", "usavg"])
def test_schemes_that_strain_first_are_of_second_order(run_script, scheme):
    """Manufactured solution of a pulsating bar, whose step falls with the cells.

    In the first step there is nothing to strain by; else stress would lead by a step, with order 1.
    """
    words = ["-var", "update", scheme, "-var", "basis", "quadratic-spline", "-var", "refine"]
    scene = INPUTS / "in.axis_aligned_1d"
    errors = [run_script(scene, *words, n).log.error_z[-1] for n in ("0.5", "1")]
    assert log(errors[0] / errors[1], 2) > 1.9
