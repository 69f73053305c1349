"""Tensile test of a steel bar to failure: closed forms to the neck, finite elements beyond."""

from math import exp
from pathlib import Path

import numpy as np

from comparisons.pictures import coloured
from comparisons.row import Row

E, NU = 211e3, 0.33  # MPa
A, B, N = 499.0, 382.0, 0.458  # MPa; flow stress A + B ep^n
D1, D2, D3 = 0.636, 1.936, -2.969
TABLE = Path(__file__).parent / "data" / "tensile_bar_karamelo_fem.csv"
FEM = "finite elements, from Karamelo's examples"
SMALL = {"refine": 1 / 3}


def flow(ep):
    """Flow stress in MPa."""
    return A + B * ep**N


def engineering(ep):
    """Engineering strain and stress of a bar that stays a cylinder, at the plastic strain ep."""
    elastic = flow(ep) / E
    return np.expm1(ep + elastic), flow(ep) * np.exp(-ep - 2 * NU * elastic)


def half(strain, stress):
    """The strain at which the stress has fallen to half of its largest value."""
    late = np.arange(len(stress)) > np.argmax(stress)
    return np.interp(-stress.max() / 2, -stress[late], strain[late])


def compare(run, axes, full):
    """Hardening, the largest force, the law of damage, failure."""
    fem_strain, fem_stress = np.loadtxt(TABLE, delimiter=",", skiprows=2).T
    even_strain, even_stress = engineering(np.linspace(1e-5, 0.22, 10000))

    result = run()
    table = result.log
    strain, stress = table.eps, table.stress

    closed, found = np.interp(0.05, even_strain, even_stress), np.interp(0.05, strain, stress)
    yield Row("stress at a strain of 0.05 (MPa)", closed, found, 0.01, "closed form")
    # Considere: the force is largest where the hardening d sigma / d eps is the stress itself.
    best = np.argmax(stress)
    yield Row("largest stress (MPa)", even_stress.max(), stress[best], 0.01, "Considere")
    yield Row("largest stress (MPa)", fem_stress.max(), stress[best], 0.01, FEM)
    # A grip that holds the end sideways begins the neck as soon as the force is largest; a perfect
    # bar stretches evenly to 0.2. How the finite elements were held is not told.
    here, there = half(strain, stress), half(fem_strain, fem_stress)
    yield Row("strain at half of the largest stress", there, here, 0.2, FEM)

    snapshots = result.snapshots("tensile_bar")
    even = snapshots[1]  # before the neck
    point = np.argmin(np.hypot(even.x0, even.y0))
    fails = D1 + D2 * exp(D3 / 3)
    yield Row(
        "plastic strain / damage, before the neck",
        fails,
        even.ep[point] / even.damage_init[point],
        0.03,
        "failure strain of the law at a triaxiality of 1/3",
    )
    last = snapshots[-1]
    yield Row("largest damage at the end", 1.0, last.damage.max(), 0.0, "a crack")
    # Five cells across the bar leave a ring of points at the surface that breaks last.
    left = stress[-1] / stress[best]
    yield Row("stress at the end / largest stress", 0.0, left, 0.1 if full else 0.3, "a crack")

    axes.plot(fem_strain, fem_stress, "k--", lw=1, label="finite elements")
    axes.plot(even_strain, even_stress, "r:", lw=1, label="without a neck")
    axes.plot(strain, stress, lw=1, label="computed")
    axes.set(xlabel="engineering strain", ylabel="engineering stress (MPa)", ylim=(0, 700))
    inset = axes.inset_axes([0.05, 0.06, 0.33, 0.55])
    coloured(inset, last.x, last.y, last.damage, "damage", bar=0.3)
    inset.set(aspect="equal", xticks=[], yticks=[])
