"""python -m comparisons.lesser [ROW ...]: scenes by a lesser model, and their 3D twins.

Writes docs/lesser.md. Rows that are not named keep what the page said about them before.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from math import log, pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons.cost import processor_seconds
from comparisons.results import Result, Table

ROOT = Path(__file__).parent.parent
MODELS, PAGE = ROOT / "inputs" / "models", ROOT / "docs" / "lesser.md"
HEAD = """# What reduced-dimension models save

Each row is a scene of `inputs/models/` in fewer dimensions and in 3D, next to its exact or
published answer. The 3D grid has cubic cells, one across half the thickness of a plate and two
across half a bar. Cost is the processor time of the steps in 3D divided by the time of the reduced
model. The surface of a sphere is a staircase of nodes in 3D. Displacements prescribed inside a hole
(`in.shell`, `in.cavity`) are therefore 11 to 18 % too small at its surface; the result of a
pressure on cut points (`in.pressed`) is off by 2 %. The wall of `in.spin_up` is such a staircase,
too.

Five factors are below 20. `in.specimen` (16, 13, 11) and the limit load of `in.disk` (11) are
implicit; the reduced models have only 128 and 723 points, and most of their 0.2 and 1.4 s is fixed
overhead. The 3D counterparts of the joint and limit-load scenes have a larger thickness t, 0.1 and
0.08 (6400 and 13 395 points), since they take minutes with t = 0.04. `in.spin_up` (18) compares 32
cells in the reduced model with 16 in 3D, which is off by 8 %.

`python -m comparisons.lesser` writes the table. For some scenes it changes variables of the
script: the reduced model of `in.kirsch` has n=10 (3.017), and the default n=6 gives 2.995.

A step in plane stress takes 1.55 times as long as in plane strain, with a neo-Hookean law and with
plastic metal (the same script with `plane_stress(true)` and `plane_stress(false)`, 65 536 points on
one core, medians of seven alternate runs).

| scene | answer | reduced model | 3D | exact | cost of 3D |
|---|---|---|---|---|---|
"""


def logged(column: str) -> Callable[[Result], float]:
    def last(result: Result) -> float:
        return float(result.log[column][-1])

    return last


def newest(result: Result, name: str) -> Table:
    return result.snapshots(name)[-1]


def angle_of_neck(result: Result) -> float:
    """Angle in degrees between the pull and the line through the most strained points."""
    t = newest(result, "strip")
    rows = np.unique(t.y0)
    rows = rows[(rows > 0.1) & (rows < 0.4)]
    middle = [np.average(t.x0[t.y0 == y], weights=t.ep[t.y0 == y] ** 2) for y in rows]
    return float(np.degrees(np.arctan2(1, np.polyfit(rows, middle, 1)[0])))


def radius_of_shock(result: Result) -> float:
    """Where the density falls to the mean of its peak and the gas ahead, between two points."""
    t = newest(result, "blast")
    r = np.sqrt(t.x**2 + t.y**2 + t.z**2)
    order = np.argsort(r)
    r, rho = r[order], t.rho[order]
    mean = (1 + rho.max()) / 2
    last = int(np.flatnonzero(rho > mean)[-1])
    part = (rho[last] - mean) / (rho[last] - rho[last + 1])
    return float(r[last] + part * (r[last + 1] - r[last]))


def contraction_of_edge(result: Result, angle: float = 0.0) -> float:
    """-e_r/e_hoop at the edge of the ring, at an angle to the rolling direction, x."""
    t = newest(result, "earing")
    rim = t.x0.max() - 0.08
    near = (np.hypot(t.x0, t.y0) > rim) & (abs(np.arctan2(t.y0, t.x0) - angle) < 0.1)
    places = np.stack([t.x0, t.y0, np.ones_like(t.x0)], axis=1)[near]
    moved = np.stack([t.x, t.y], axis=1)[near]
    F = np.linalg.lstsq(places, moved, rcond=None)[0][:2].T
    c, s = np.cos(angle), np.sin(angle)
    radial, hoop = (one @ F.T @ F @ one for one in (np.array([c, s]), np.array([-s, c])))
    return float(-log(radial) / log(hoop))


def contraction_between_axes(result: Result) -> float:
    return contraction_of_edge(result, pi / 4)


class Twins(NamedTuple):
    script: str
    answer: str
    lesser: Mapping[str, object]  # variables
    full: Mapping[str, object]
    measure: Callable[[Result], float]
    exact: float
    within: float  # relative difference of the lesser model, absolute for an exact 0


PLANE, FULL = {"model": "plane"}, {"model": "full"}
LINE = {"model": "line"}


def modulus(angle: float) -> float:
    """Return E of a lamina against the angle of its fibres (Jones 1999, equation 2.97)."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return 1e-9 / (c**4 / 140e9 + (1 / 5e9 - 0.6 / 140e9) * (s * c) ** 2 + s**4 / 9e9)


def jaeger(angle: float) -> float:
    """Return the strength in MPa of rock with joints of 1 MPa and 30 degrees (Jaeger 1960)."""
    b = np.radians(angle)
    return 2 / ((1 - np.tan(pi / 6) / np.tan(b)) * np.sin(2 * b))


def in_units(column: str, unit: float) -> Callable[[Result], float]:
    def last(result: Result) -> float:
        return float(result.log[column][-1]) / unit

    return last


def specimen(law: str, angle: float, exact: float, unit: float) -> Twins:
    answer = "modulus (GPa)" if law != "rock" else "strength (MPa)"
    of = {"plate": "a plate", "lamina": f"a lamina at {angle}°", "rock": f"joints at {angle}°"}[law]
    size = {"law": law, "angle": angle}
    thin = {**FULL, **size, "t": 0.1 if law == "rock" else 0.04}
    measure = in_units("found", unit)
    return Twins("specimen", f"{answer} of {of}", {**PLANE, **size}, thin, measure, exact, 0.02)


def waves(law: str, answer: str) -> Twins:
    lesser, full = {**LINE, "law": law}, {**FULL, "law": law, "t": 1 / 12}
    return Twins("bar", f"{answer}, error", lesser, full, logged("err"), 0, 0.003)


ROWS = {
    "bar": waves("bar", "wave along a bar, c^2 = E/rho"),
    "along": waves("along", "wave along fibres, C11/rho"),
    "across": waves("across", "wave across fibres, C22/rho"),
    "plate": specimen("plate", 0, 20, 1e9),
    **{f"lamina {a}": specimen("lamina", a, modulus(a), 1e9) for a in (0, 30, 90)},
    **{f"rock {a}": specimen("rock", a, jaeger(a), 1e6) for a in (50, 60, 75)},
    "kirsch": Twins("kirsch", "stress at a hole (Kirsch)", {**PLANE, "n": 10},
                    {**FULL, "t": 0.1}, logged("peak"), 3, 0.02),
    "beam": Twins("beam", "cantilever, error of the deflection", {**PLANE, "n": 16},
                  {**FULL, "t": 0.0625}, logged("err"), 0, 0.006),
    "sheet": Twins("sheet", "stress of a stretched rubber sheet (kPa)", PLANE,
                   {**FULL, "t": 0.05}, in_units("s_11", 1e3), 638.4099321, 1e-6),
    "disk": Twins("disk", "stress at the centre of a spinning disk (Pa)", PLANE,
                  {**FULL, "t": 0.02}, in_units("s_11", 1), 412.5, 0.002),
    "limit": Twins("disk", "limit of its speed, rho w^2 R^2/Y", {**PLANE, "law": "plastic"},
                   {**FULL, "law": "plastic", "t": 0.08}, logged("Time"), 3.2582, 0.005),
    "strip": Twins("strip", "angle of the neck of a strip (°, Hill 1952)", PLANE, FULL,
                   angle_of_neck, 54.74, 0.015),
    "impact": Twins("impact", "stress of a strip on a wall (MPa)", PLANE,
                    {**FULL, "t": 0.01}, in_units("stress", 1e6), 670.97, 0.025),
    "earing": Twins("earing", "lateral contraction at the edge of a rolled ring (Hill)", PLANE,
                    {**FULL, "t": 0.032}, contraction_of_edge, 2 / 3, 0.035),
    "earing 45": Twins("earing", "lateral contraction at 45° to the rolling direction (Hill)",
                       PLANE, {**FULL, "t": 0.032}, contraction_between_axes, 1 / 2, 0.05),
    "torsion": Twins("torsion", "torque of a plastic bar (Nadai 1923), error",
                     {"model": "twist", "n": 16}, {**FULL, "n": 16}, logged("err"), 0, 0.001),
    "loads": Twins("torsion", "torque in 5 load steps (Nadai 1923), error",
                   {"model": "twist", "n": 16, "steps": 5}, {**FULL, "n": 16, "steps": 5},
                   logged("err"), 0, 0.001),
    "pendulum": Twins("pendulum", "torsional pendulum, error of the frequency",
                      {"model": "twist"}, FULL, logged("err"), 0, 0.002),
    "clutch": Twins("clutch", "torque of a clutch / (2/3 mu N R) - 1", {"model": "twist"},
                    FULL, logged("err"), 0, 0.01),
    "spin-up": Twins("spin_up", "angular momentum of a fluid that spins up (Batchelor)",
                     {"model": "twist", "n": 32}, {**FULL, "n": 16}, logged("momentum"), 0.89323,
                     0.02),
    "shell": Twins("shell", "thick shell, error of the displacement", {"model": "spherical"},
                   {"model": "eighth"}, logged("err"), 0, 0.006),
    "cavity": Twins("cavity", "pressure of a plastic cavity (Tresca)", {"model": "spherical"},
                    {"model": "eighth", "n": 10}, logged("p"), 1.3728, 0.01),
    "pressed": Twins("pressed", "thick shell under pressure, error of the displacement",
                     {"model": "spherical", "n": 64}, {"model": "eighth", "n": 8}, logged("err"),
                     0, 0.01),
    "flows": Twins("pressed", "plastic shell under pressure (Hill), error",
                   {"model": "spherical", "n": 64, "c": 1.25},
                   {"model": "eighth", "n": 8, "c": 1.25}, logged("err"), 0, 0.02),
    "blast": Twins("blast", "radius of a blast wave (Sedov)", {"model": "spherical"},
                   {"model": "eighth", "n": 30}, radius_of_shock, 0.7579, 0.03),
}  # fmt: skip


def run(script: str, variables: Mapping[str, object], folder: Path) -> Result:
    folder.mkdir(parents=True)
    options = [part for name, value in variables.items() for part in ("-var", name, str(value))]
    command = [sys.executable, "-m", "karamelo_py.app.cli", str(MODELS / f"in.{script}")]
    done = subprocess.run(
        command + options, cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"in.{script} {' '.join(options)}\n{done.stderr}")
    return Result(done.returncode, done.stdout, done.stderr, folder)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m comparisons.lesser", description=__doc__)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"all, or some of {', '.join(ROWS)}")
    options = parser.parse_args()
    text = PAGE.read_text("utf-8") if PAGE.exists() else ""
    lines = {
        line.split("|")[2].strip(): line for line in text.splitlines() if line.startswith("| `in.")
    }
    for name in options.rows or ROWS:
        twins = ROWS[name]
        folder = Path(tempfile.mkdtemp(prefix="lesser-"))
        both = [run(twins.script, twins.lesser, folder / "lesser")]
        both.append(run(twins.script, twins.full, folder / "full"))
        answers = [f"{twins.measure(result):.4g}" for result in both]
        factor = processor_seconds(both[1]) / processor_seconds(both[0])
        cells = (twins.answer, *answers, f"{twins.exact:.4g}", f"{factor:.2g}")
        lines[twins.answer] = f"| `in.{twins.script}` | {' | '.join(cells)} |"
        print(lines[twins.answer], flush=True)
        there = [lines[one.answer] for one in ROWS.values() if one.answer in lines]
        PAGE.write_text(HEAD + "\n".join(there) + "\n", "utf-8")


if __name__ == "__main__":
    main()
