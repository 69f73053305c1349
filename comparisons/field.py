"""python -m comparisons.field [FOLDER [SCENE ...]]: error against cost of set-ups, twelve scenes.

Runs the scenes in FOLDER and writes their rows of comparisons/data/field.csv. Results that FOLDER
has are used, except those of auto. Draws docs/_static/field.png from the data, and prints the least
error at equal cost: of ten usual set-ups, and with corrected accelerations, PolyPIC, usl, AFLIP,
F-bar, long steps and fewer points. Cost is visited nodes (:mod:`comparisons.auto`), or with
``-seconds`` the processor time of the steps, and then the picture is seconds.png.
"""

import csv
import re
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from math import exp, inf, isfinite, log
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from comparisons import slopes
from comparisons.auto import SCENES, SETUPS, Scene, run, warm

PICTURE = Path(__file__).parent.parent / "docs" / "_static" / "field.png"
DATA = Path(__file__).parent / "data" / "field.csv"
NUMBERS = ("refine", "error", "cost", "seconds")
SIZES = {  # finer than the two of `comparisons.auto`
    "axis_aligned": ("0.5", "1", "2"), "bar": ("0.2", "0.4", "1", "2"),
    "pulse": ("1", "2", "4", "8"), "energy_disk": ("4", "6", "8"), "turns": ("1", "1.5", "2"),
    "rods": ("1", "2", "4"), "slope_27": ("0.5", "1", "2"), "sod": ("0.25", "0.5", "1"),
    "slosh": ("0.5", "1", "2"), "taylor_green": ("0.5", "1", "2"),
    "plates": ("0.5", "1", "2"), "cantilever": ("0.5", "1", "2"),
}  # fmt: skip
TITLES = {
    "axis_aligned": "Pulsating square", "bar": "Vibrating bar", "pulse": "Travelling pulse",
    "energy_disk": "Vibrating disk", "turns": "Rotating disk", "rods": "Colliding rods",
    "slope_27": "Block on a slope of 27 degrees", "sod": "Shock tube", "slosh": "Sloshing tank",
    "taylor_green": "Taylor-Green vortices", "plates": "Plate impact", "cantilever": "Cantilever",
}  # fmt: skip
# 0.9 h/c and half the first kick; `TOTAL` takes 0.9 h/c by itself
LONG_STEPS = "method(tlmpm, PolyPIC, linear)\nscheme(usl, start=half)\ndt_factor(0.9)"
TOTAL = "method(tlmpm, PolyPIC, linear)\nscheme(usl)"
AFTER = {
    "APIC quadratic corrected": "method(ulmpm, APIC, quadratic-spline, mass=corrected)",
    "APIC cubic corrected": "method(ulmpm, APIC, cubic-spline, mass=corrected)",
    "AFLIP quadratic": "method(ulmpm, AFLIP, quadratic-spline, 1)",
    "APIC cubic corrected usl": "method(ulmpm, APIC, cubic-spline, mass=corrected)\nscheme(usl)",
    "AFLIP cubic corrected": "method(ulmpm, AFLIP, cubic-spline, 1, mass=corrected)",
    "MLS quadratic corrected": "method(ulmpm, MLS, quadratic-spline, mass=corrected)",
    "tlmpm PolyPIC usl": TOTAL,
    "tlmpm PolyPIC long steps, 1 point": LONG_STEPS,
    "tlmpm PolyPIC long steps, 2 points": LONG_STEPS,
    "APIC quadratic usl, 2 points": (
        "method(ulmpm, APIC, quadratic-spline)\nscheme(usl, start=half)"),
    "AFLIP quadratic usl": "method(ulmpm, AFLIP, quadratic-spline, 1)\nscheme(usl)",
    "AFLIP quadratic F-bar": (
        "method(ulmpm, AFLIP, quadratic-spline, 0.95)\nanti_volumetric_locking(true)"),
    "AFLIP cubic": "method(ulmpm, AFLIP, cubic-spline, 0.9)",
    "APIC linear": "method(ulmpm, APIC, linear)",
    "linear long steps, 1 point": "method(ulmpm, FLIP, linear, 1)\ndt_factor(0.9)",
    "PolyPIC/quadratic": "method(ulmpm, PolyPIC/quadratic, cubic-spline)",
    # of scenes in POINTS
    "tlmpm PolyPIC usl, contact of points, 1 point": TOTAL,
    "tlmpm PolyPIC usl, contact of points, 2 points": TOTAL,
    "tlmpm PolyPIC long steps, contact of points, 2 points": LONG_STEPS,
    # of liquids that fill a box
    "PolyPIC/quadratic long steps": (
        "method(ulmpm, PolyPIC/quadratic, cubic-spline)\nscheme(usl)\ndt_factor(0.6)"),
}  # fmt: skip
SLOPE = SCENES["slope_27"]._replace(error=partial(slopes.friction, angle=27, mu=0.25))
SCENES_HERE = SCENES | {
    "slope_27": SLOPE,
    # The exact solution is of small strain: with the 1 % of the script all methods err by 0.3 %.
    "bar": SCENES["bar"]._replace(more=("v0", 0.001)),
}
# The same scenes with contact between points, or of points with a surface.
POINTS = {
    "rods": Scene("inputs/defaults/in.rods_points", SCENES["rods"].error),
    "slope_27": SLOPE._replace(script="inputs/defaults/in.slope_surface"),
}
# Visited nodes and errors that others published, or a study of their method found.
PUBLISHED = {
    "axis_aligned": {
        "FMPM(2), FMPM(3) (NumPy)": (
            (3.96e5, 0.0155), (3.13e6, 0.00416), (7.05e5, 0.00749), (5.58e6, 0.00373)),
    },
    # 576 points, the published step of 0.1 h/c up to 1.3 s, musl: -3.310 and -3.319 m for -3.305
    "cantilever": {"CPDI2q, cpGIMP (Wyser et al. 2020)": ((6.9e7, 0.0015), (6.9e7, 0.0042))},
}  # fmt: skip
EXACT = 1e-4  # errors below count as this
Lines = Iterable[Sequence[dict]]  # the runs of each set-up, from coarse to fine


def words_of(setup: str) -> str:
    """Return the arguments of the commands of a set-up."""
    lines = SETUPS[setup].replace(", {domain}", "").split("\n")
    words = [re.sub(r"^(method|scheme)\((.*)\)$", r"\2", line) for line in lines]
    return ", ".join(words + re.findall(r", (contact of points|\d points?)", setup))


def runs_of(name: str, setup: str, folder: Path, most: float = inf) -> list[dict]:
    """Run a set-up in all sizes; then, up to a cost of `most`, with cells of half the size."""
    points = re.findall(r", (\d) points?$", setup)
    scenes = POINTS if "contact of points" in setup else SCENES_HERE
    scene = scenes[name]._replace(points=int(points[0]) if points else None)
    sizes = list(SIZES[name])
    runs = [run(scene, name, setup, n, folder) for n in sizes]
    before, last = (one["cost"] for one in runs[-2:])
    growth = (last / before) ** (log(2) / log(float(sizes[-1]) / float(sizes[-2])))
    while last * growth <= most < inf:
        sizes.append(f"{2 * float(sizes[-1]):g}")
        runs.append(run(scene, name, setup, sizes[-1], folder))
        last = runs[-1]["cost"]
    return [one | {"refine": float(size)} for size, one in zip(sizes, runs, strict=True)]


def drawn(runs: Sequence[dict], cost: str) -> list[tuple[float, float]]:
    """Return cost and error of the runs that have one."""
    return [(r[cost], max(r["error"], EXACT)) for r in runs if isfinite(r["error"])]


def least(costs: np.ndarray, lines: Lines, cost: str) -> np.ndarray:
    """Return the least error at each cost, on lines between the runs of a set-up (logarithms)."""
    errors = np.full(len(costs), inf)
    for runs in lines:
        if points := sorted(drawn(runs, cost)):
            at, of = np.log(points).T
            line = np.exp(np.interp(np.log(costs), at, of, left=inf))
            errors = np.minimum(errors, line)
    return errors


def covered(lines: Lines, cost: str) -> np.ndarray:
    """Return costs from the cheapest run to the dearest."""
    costs = [c for runs in lines for c, _ in drawn(runs, cost)]
    return np.geomspace(min(costs), max(costs), 61)


def measure(name: str, folder: Path) -> list[list[str]]:
    """Run a scene with every set-up; return its rows of the data."""
    setups = [s for s in SETUPS if name in POINTS or "contact of points" not in s]
    found = {s: runs_of(name, s, folder) for s in setups if s not in AFTER}
    most = max(one["cost"] for runs in found.values() for one in runs if one["cost"] > 0)
    found |= {s: runs_of(name, s, folder, most) for s in setups if s != "auto"}
    return [
        [name, setup, *(f"{one[key]:.4g}" for key in NUMBERS), one["status"]]
        for setup, runs in found.items()
        for one in runs
    ]


def read() -> list[list[str]]:
    with DATA.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]


def write(rows: list[list[str]]) -> None:
    with DATA.open("w", encoding="utf-8", newline="") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerows([["scene", "setup", *NUMBERS, "failure"], *rows])


def bands(found: dict[str, list[dict]], cost: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return costs, and the least error at each: of the usual set-ups, and of all."""
    mine = {setup: runs for setup, runs in found.items() if setup != "auto"}
    usual = [runs for setup, runs in mine.items() if setup not in AFTER]
    costs = covered(usual, cost)
    return costs, least(costs, usual, cost), least(costs, mine.values(), cost)


def row(name: str, found: dict[str, list[dict]], cost: str) -> tuple[str, float]:
    """Return the row of a scene in the table, and the mean gain (logarithm)."""
    _, before, after = bands(found, cost)
    gain = float(np.mean(np.log(before / after)))
    mine = [runs for setup, runs in found.items() if setup != "auto"]
    ratios = [e / least(np.array([c]), mine, cost)[0] for c, e in drawn(found["auto"], cost)]
    ends = (f"{100 * errors[-1]:.2g} %" for errors in (before, after))
    cells = (
        f"{TITLES[name]} (`{name}`)", *ends, f"{exp(gain):.2f}", f"{max(ratios, default=inf):.2f}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |", gain


def by_scene() -> dict[str, dict[str, list[dict]]]:
    """Return the runs of each set-up of each scene."""
    setups = dict.fromkeys([*SETUPS, *AFTER])  # once, as main has both in SETUPS
    found: dict = {name: {setup: [] for setup in setups} for name in SIZES}
    for name, setup, *numbers, _ in read():
        if setup in setups:
            found[name][setup].append(dict(zip(NUMBERS, map(float, numbers), strict=True)))
    return found


def draw(axes, name: str, found: dict[str, list[dict]], cost: str) -> None:
    """Draw the panel of a scene."""
    for k, (setup, runs) in enumerate(found.items()):
        good = drawn(runs, cost)
        new = setup in AFTER
        line = {
            "color": plt.cm.tab20(k % 20), "lw": 1.6 if new else 0.9, "ls": "-" if new else ":",
        }  # fmt: skip
        if setup == "auto":
            line = {"color": "k", "marker": "*", "ms": 11, "ls": "", "zorder": 9}
        axes.loglog(*zip(*good, strict=True) if good else ((), ()), label=words_of(setup), **line)
    costs, before, after = bands(found, cost)
    axes.loglog(costs, before, color="0.6", lw=5, alpha=0.5, label="least error, usual set-ups")
    axes.loglog(costs, after, color="r", lw=5, alpha=0.3, label="least error, all set-ups")
    for k, (label, points) in enumerate(PUBLISHED.get(name, {}).items()):
        if cost == "cost":
            axes.loglog(*zip(*points, strict=True), "sD"[k], color="b", mfc="none", label=label)
            axes.text(0.03, 0.03, label, fontsize=7, color="b", transform=axes.transAxes)
    axes.set_title(TITLES[name])


def main() -> None:
    cost = "seconds" if "-seconds" in sys.argv else "cost"
    folder, *names = [word for word in sys.argv[1:] if word != "-seconds"] or [""]
    SETUPS.update(AFTER)
    if folder:
        warm(Path(folder))
        for name in names or SIZES:
            rows = measure(name, Path(folder))
            write(sorted([row for row in read() if row[0] != name] + rows, key=lambda row: row[0]))
    fig, panels = plt.subplots(3, 4, figsize=(16, 13), layout="constrained")
    gains = []
    print("| scene | before | now | error before over now | auto over the least |")
    print("|---|---|---|---|---|")
    for axes, (name, found) in zip(panels.flat, by_scene().items(), strict=True):
        draw(axes, name, found, cost)
        text, gain = row(name, found, cost)
        gains.append(gain)
        print(text, flush=True)
    print(f"mean of log(error before / after) at equal cost: {np.mean(gains):.3f}, a factor of "
          f"{exp(np.mean(gains)):.2f}")  # fmt: skip
    words = "processor time of the steps (s)" if cost == "seconds" else "visited nodes"
    for axes in panels[-1]:
        axes.set_xlabel(words)
    fig.supylabel("relative error; below 0.01 % counts as 0.01 %")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8.5)
    fig.savefig(PICTURE if cost == "cost" else "seconds.png", dpi=80)


if __name__ == "__main__":
    main()
