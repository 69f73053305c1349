"""python -m comparisons.field FOLDER: error against cost of every set-up, over twelve scenes.

Draws docs/_static/field.png and prints the fronts: the least error of the set-ups before and after
corrected accelerations, PolyPIC and usl, at equal cost. Cost is visited nodes
(:mod:`comparisons.auto`), or with ``-seconds`` the processor time of the steps.
"""

import sys
from collections.abc import Sequence
from math import exp, isfinite, log
from pathlib import Path

import numpy as np

from comparisons.auto import SCENES, SETUPS, run, warm

PICTURE = Path(__file__).parent.parent / "docs" / "_static" / "field.png"
SIZES = {  # finer than the two of `comparisons.auto`
    "axis_aligned": ("0.5", "1", "2"), "bar": ("0.2", "0.4", "1", "2"),
    "pulse": ("1", "2", "4", "8"), "energy_disk": ("4", "6", "8"), "turns": ("1", "1.5", "2"),
    "rods": ("1", "2", "4"), "slope_27": ("0.5", "1", "2"), "sod": ("0.25", "0.5", "1"),
    "slosh": ("0.5", "1", "2"), "taylor_green": ("0.5", "1", "2"),
    "plates": ("0.5", "1", "2"), "cantilever": ("0.5", "1", "2"),
}  # fmt: skip
AFTER = {
    "APIC quadratic corrected": "method(ulmpm, APIC, quadratic-spline, mass=corrected)",
    "APIC cubic corrected": "method(ulmpm, APIC, cubic-spline, mass=corrected)",
    "AFLIP quadratic": "method(ulmpm, AFLIP, quadratic-spline, 1)",
    "APIC cubic corrected usl": "method(ulmpm, APIC, cubic-spline, mass=corrected)\nscheme(usl)",
    "AFLIP cubic corrected": "method(ulmpm, AFLIP, cubic-spline, 1, mass=corrected)",
    "MLS quadratic corrected": "method(ulmpm, MLS, quadratic-spline, mass=corrected)",
    "tlmpm PolyPIC usl": "method(tlmpm, PolyPIC, linear)\nscheme(usl)",
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
Front = list[tuple[float, float]]


def front(runs: Sequence[dict], cost: str) -> Front:
    """Cost and error of the runs that none beats in both."""
    points = sorted((r[cost], max(r["error"], EXACT)) for r in runs if isfinite(r["error"]))
    kept: Front = []
    for point in points:
        if not kept or point[1] < kept[-1][1]:
            kept.append(point)
    return kept


def at(cost: float, of: Front) -> float:
    """Error of the front at a cost, on a line between its runs (logarithms)."""
    costs, errors = np.log(of).T
    return exp(float(np.interp(log(cost), costs, errors)))


def gain(before: Front, after: Front) -> float:
    """Mean logarithm of the error before over that after, at costs that both fronts reach."""
    low = max(before[0][0], after[0][0])
    high = max(before[-1][0], after[-1][0])
    costs = np.geomspace(low, high, 41)
    return float(np.mean([log(at(c, before) / at(c, after)) for c in costs]))


def main() -> None:
    folder = Path(sys.argv[1])
    warm(folder)
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    folder = Path(sys.argv[1])
    cost = "seconds" if "-seconds" in sys.argv else "cost"
    SETUPS.update(AFTER)
    fig, panels = plt.subplots(3, 4, figsize=(16, 11))
    gains = []
    print("| scene | before | after | less error | auto |\n|---|---|---|---|---|")
    for axes, (name, sizes) in zip(panels.flat, SIZES.items(), strict=True):
        found = {s: [run(SCENES[name], name, s, n, folder) for n in sizes] for s in SETUPS}
        for k, (setup, runs) in enumerate(found.items()):
            good = [(r[cost], max(r["error"], EXACT)) for r in runs if isfinite(r["error"])]
            new = setup in AFTER
            line = {"color": plt.cm.tab20(k), "lw": 1.6 if new else 0.9, "ls": "-" if new else ":"}
            if setup == "auto":
                line = {"color": "k", "marker": "*", "ms": 11, "ls": "", "zorder": 9}
            axes.loglog(*zip(*good, strict=True) if good else ((), ()), label=setup, **line)
        mine = found.pop("auto")
        of_old = [r for s, runs in found.items() if s not in AFTER for r in runs]
        before, after = front(of_old, cost), front([r for v in found.values() for r in v], cost)
        axes.loglog(*zip(*before, strict=True), color="0.6", lw=5, alpha=0.5, label="front before")
        axes.loglog(*zip(*after, strict=True), color="r", lw=5, alpha=0.3, label="front after")
        for k, (label, points) in enumerate(PUBLISHED.get(name, {}).items()):
            if cost == "cost":
                axes.loglog(*zip(*points, strict=True), "sD"[k], color="b", mfc="none", label=label)
                axes.annotate(label, points[0], fontsize=7, color="b")
        axes.set_title(name)
        gains.append(gain(before, after))
        of_auto = [log(r["error"] / at(r[cost], after)) for r in mine if r["error"] > EXACT]
        cells = name, f"{100 * before[-1][1]:.2g} %", f"{100 * after[-1][1]:.2g} %"
        times = f"{exp(gains[-1]):.2f}", f"{exp(max(of_auto, default=0.0)):.2f}"
        print(f"| `{'` | '.join(cells[:1])}` | {' | '.join((*cells[1:], *times))} |", flush=True)
    print(f"mean of log(error before / after) at equal cost: {np.mean(gains):.3f}, a factor of "
          f"{exp(np.mean(gains)):.2f}")  # fmt: skip
    words = "processor time of the steps (s)" if cost == "seconds" else "visited nodes"
    fig.supxlabel(words)
    fig.supylabel("relative error; below 0.01 % counts as 0.01 %")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    fig.legend(
        handles, labels, loc="lower center", ncols=7, fontsize=8, bbox_to_anchor=(0.5, -0.06)
    )
    fig.tight_layout()
    fig.savefig(PICTURE, dpi=70, bbox_inches="tight")


if __name__ == "__main__":
    main()
