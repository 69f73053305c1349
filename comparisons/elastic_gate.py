"""Water that pushes an elastic gate open: stiff gate at rest by beam theory; outflow and energy."""

import numpy as np

from comparisons.row import Row

RHO, G = 1000.0, 9.81
DEPTH, LENGTH, THICK, NU = 0.14, 0.079, 5e-3, 0.4
SMALL = None  # tests/test_paper_scenes.py runs it


def beam(E):
    """Deflection (mm) of the free end of a plate held above, under the pressure of water at rest.

    Euler and Bernoulli: q L^4/(8 E I) for the constant part, 11 q L^4/(120 E I) for the part that
    grows to q at the free end. Shear adds 6/5 of the moment of the load over G A.
    """
    even, grown = RHO * G * (DEPTH - LENGTH), RHO * G * LENGTH
    bending = E / (1 - NU**2) * THICK**3 / 12
    shear = E / (2 * (1 + NU)) * THICK * 5 / 6
    bent = (even / 8 + 11 * grown / 120) * LENGTH**4 / bending
    return 1000 * (bent + (even / 2 + grown / 3) * LENGTH**2 / shear)


def compare(run, axes, full):
    """At rest and in motion."""
    stiff = run(E=1e9, calm=0.8, T=0.12).log
    rest = stiff.ux[stiff.Time > 0.096].mean()
    # Two cells across its thickness are too stiff.
    yield Row(
        "deflection of the end of a stiff gate (mm)",
        beam(1e9),
        rest,
        0.12,
        "Euler & Bernoulli, Timoshenko",
    )
    result = run()
    log = result.log
    most = log.ux.argmax()
    rise = log.uy[most]
    # A plate that keeps its length and bends evenly: (1 - sin a/a) L where it goes (1 - cos a)/a L.
    angles = np.linspace(0.01, 2, 400)
    even = np.interp(log.ux[most] / 1e3 / LENGTH, (1 - np.cos(angles)) / angles, angles)
    round_ = 1000 * LENGTH * (1 - np.sin(even) / even)
    yield Row(
        "rise of the gate's end at the widest opening (mm)",
        round_,
        rise,
        0.25,
        "circle of its length",
    )
    last = result.snapshots("elastic_gate")
    water = [s.mass[(s.type == 1) & (s.x < 0.1)].sum() / RHO for s in last]
    fall = np.sqrt(2 * G * DEPTH)
    speed = np.hypot(last[1].vx, last[1].vy)[last[1].type == 1]
    name = "speed of 99 of 100 points / Torricelli's speed"
    yield Row(name, (0.5, 1), np.quantile(speed, 0.99) / fall, 0.1, "Torricelli")
    least = 1 - log.uy.max() / 1e3 * fall * log.Time[-1] / (0.1 * DEPTH)
    name = "water in the tank at 0.3 s / initial amount"
    yield Row(name, (least, 1), water[-1] / water[0], 0.0, "Torricelli, at the widest opening")
    axes.plot(log.Time, log.ux, label="end of the gate, sideways")
    axes.plot(log.Time, log.uy, label="upwards")
    lift = np.interp(log.ux / 1e3 / LENGTH, (1 - np.cos(angles)) / angles, angles)
    lift = 1000 * LENGTH * (1 - np.sin(lift) / lift)
    axes.plot(log.Time, lift, "k:", lw=0.9, label="upwards, if it bends to a circular arc (exact)")
    axes.set(xlabel="time (s)", ylabel="displacement (mm)")
