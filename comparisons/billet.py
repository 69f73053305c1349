"""Billet compressed between sticking platens, in 3D: load and shape against axisymmetry."""

import numpy as np

from comparisons.row import Row

SOURCE = "in.billet_axisymmetric"
RADIUS, HEIGHT = 10.0, 30.0  # mm
SMALL = None  # tests/test_paper_scenes.py runs it axisymmetric


def uniform(press):
    """Load (kN) of a billet that stays a cylinder, with the stress 700 + 300 ln(H/h) MPa."""
    area = np.pi * RADIUS**2 / (1 - press)
    return area * (700 - 300 * np.log(1 - press)) / 1000


def sticking(press):
    """Bound of the load over that, where the ends stick: 1 + D/(3 sqrt(3) h)."""
    diameter, height = 2 * RADIUS / np.sqrt(1 - press), HEIGHT * (1 - press)
    return 1 + diameter / (3 * np.sqrt(3) * height)


def loads(log, press):
    """Mean load around a share of the height: cells that fill and empty make it swing."""
    return log.load[np.abs(log.press - press) < 0.02].mean()


def work(log):
    """Work of the platen in J."""
    return np.trapezoid(log.load * 1000, log.press * HEIGHT / 2000)


def compare(run, axes, full):
    """Loads, radius and plastic work of the two; bounds; balance of energy."""
    flat, space = run(scene="billet_axisymmetric").log, run().log
    for press in (0.1, 0.2, 0.3, 0.4, 0.5):
        here, there = loads(space, press), loads(flat, press)
        yield Row(f"load at {press:.0%} (kN)", there, here, 0.03, SOURCE)
    for press in (0.2, 0.4):
        name = f"load at {press:.0%} / load of a frictionless cylinder"
        ratio = loads(flat, press) / uniform(press)
        yield Row(name, (1, sticking(press)), ratio, 0.01, "limit analysis (Siebel 1923)")
    yield Row("largest radius at 60 % (mm)", flat.radius[-1], space.radius[-1], 0.03, SOURCE)
    spent, there = 4 * space.lost[-1], 2 * np.pi * flat.lost[-1]
    yield Row("plastic work (J)", there, spent, 0.03, SOURCE)
    yield Row("energy / work of the platen", 1.0, energy(space, 4), 0.03, "balance")
    yield Row("energy / work, axisymmetric", 1.0, energy(flat, 2 * np.pi), 0.03, "balance")
    press = np.linspace(0, 0.6)
    axes.plot(flat.press, flat.load, lw=0.8, label="axisymmetric")
    axes.plot(space.press, space.load, lw=0.8, label="in 3D")
    axes.plot(press, uniform(press), "k--", lw=0.8, label="a cylinder")
    axes.plot(press, uniform(press) * sticking(press), "k:", lw=0.8, label="bound, ends stick")
    axes.set(xlabel="compression / height", ylabel="load (kN)", ylim=(0, 1200))


def energy(log, times):
    """What is stored and spent over the work."""
    return times * (log.lost[-1] + log.Es[-1] + log.Ek[-1] - log.Ek[0]) / work(log)
