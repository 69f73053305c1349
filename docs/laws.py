"""Draw the laws of impact, blast and rubber against references: python docs/laws.py.

It runs scenes of inputs/ and tests of one element, and writes docs/_static/laws.png.
"""

from __future__ import annotations

import sys
import tempfile
from contextlib import chdir
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from comparisons.results import read_log
from karamelo_py.app.cli import main as karamelo
from karamelo_py.app.studies.look import PALETTE
from karamelo_py.output import snapshots
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy

DOCS = Path(__file__).parent
INPUTS = DOCS.parent / "inputs"
# Treloar 1944: stretch and nominal stress (MPa).
TRELOAR = {
    "uniaxial": (
        (1.39, 0.32),
        (2.17, 0.58),
        (3.01, 0.85),
        (4.76, 1.58),
        (5.76, 2.29),
        (6.87, 3.75),
    ),
    "equibiaxial": ((1.14, 0.26), (1.69, 0.65), (2.49, 0.96), (3.43, 1.45), (4.26, 2.22)),
    "pure shear": ((1.32, 0.33), (1.87, 0.59), (2.98, 0.93), (3.96, 1.28), (4.96, 1.79)),
}
# Johnson & Holmquist 1993; Cronin et al. 2003: no strength when broken, some, and a failure strain.
ALUMINA = "90.16, 0.93, 0.6, {B}, {M}, 0, 1, 0.2, 2.79, 1.46, {D1}, {D2}"
CASES = {
    "A": {"B": 0, "M": 0, "D1": 0, "D2": 0},
    "B": {"B": 0.31, "M": 0.6, "D1": 0, "D2": 0},
    "C": {"B": 0.31, "M": 0.6, "D1": 0.005, "D2": 1},
}
ELEMENTS = """
eos(alumina, linear, 3.7, 130.95)
eos(quartz, linear, 2.65, 37)
eos(sandstone, p-alpha, quartz, 1.25, 0.05, 1.2)
strength(none, linear, 1)
material(sandstone, eos-strength, sandstone, none)
load_path(crush, 300, exx=-0.1, eyy=-0.1, ezz=-0.1)
load_path(release, 100, sxx=0, syy=0, szz=0)
element(crush, sandstone, crush, release)
material(rubber, ogden, 1e-3, 2e3, 0.618, 1.3, 0.00118, 5, -0.00981, -2)
load_path(uniaxial, 200, exx=1.94, syy=0, szz=0)
load_path(equibiaxial, 200, exx=1.45, eyy=1.45, szz=0)
load_path(shear, 200, exx=1.6, eyy=0, szz=0)
element(uniaxial, rubber, uniaxial)
element(equibiaxial, rubber, equibiaxial)
element(shear, rubber, shear)
material(elastic, neo-hookean, 1000, 2.8, 0.4)
viscosity(prony, elastic, g=(0.3, 0.2), tau=(0.01, 1))
load_path(pull, 1, exy=5e-4, duration=1e-9)
load_path(hold, 400, duration=4)
element(hold, elastic, pull, hold)
load_path(squeeze, 300, exx=-0.06, eyy=0, ezz=0)
load_path(back, 300, exx=0, eyy=0, ezz=0)
"""


def run(script: str, *words: str) -> None:
    """Run a script in the present folder."""
    Path("in.laws").write_text(script, encoding="utf-8")
    if karamelo(["in.laws", "--quiet", *words]):
        raise SystemExit(script)


def element(name: str) -> np.ndarray:
    return np.genfromtxt(f"element_{name}.txt", names=True)


def explosive(axes) -> None:
    run((INPUTS / "in.tnt_slab").read_text("utf-8"))
    file = max(Path().glob("tnt.*.LAMMPS"), key=lambda one: int(one.name.split(".")[1]))
    *_, last = snapshots.read(file)
    axes.plot(1e3 * last.columns["x"], 1e-9 * last.columns["p"], color=PALETTE[0])
    axes.axhline(21, color="0.5", ls="--", lw=1)
    axes.annotate("Chapman-Jouguet", (2, 21), (2, 19.5), fontsize=8, color="0.3")
    axes.set(title="TNT slab", xlabel="x (mm)", ylabel="pressure (GPa)")


def flyer(axes) -> None:
    run((INPUTS / "in.flyer").read_text("utf-8"))
    log = read_log(Path("log.mpm"))
    axes.plot(log["Time"], log["u_x"], color=PALETTE[0])
    axes.axhline(0.4, color="0.5", ls="--", lw=1)
    axes.annotate("speed of the flyer", (0, 0.4), (0.05, 0.36), fontsize=8, color="0.3")
    axes.set(title="Flyer and spall", xlabel="time (µs)", ylabel="free surface (km/s)")


def ceramics(axes) -> None:
    lines = ""
    for name, numbers in CASES.items():
        lines += f"strength({name}, johnson-holmquist-2, {ALUMINA.format(**numbers)})\n"
        lines += f"material({name}, eos-strength, alumina, {name})\n"
        lines += f"element({name}, {name}, squeeze, back)\n"
    run(ELEMENTS + lines)
    for k, name in enumerate(CASES):
        d = element(name)
        axes.plot(d["p"], d["q"], color=PALETTE[k], label=f"case {name}")
    p = np.linspace(0, 8, 50)
    surface = 1.5 * 1.33 * 0.93 * ((p + 0.2) / 1.46) ** 0.6
    axes.plot(p, surface, color="0.5", ls="--", lw=1, label="intact")
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="Ceramic JH-2", xlabel="pressure (GPa)", ylabel="von Mises (GPa)")


def pores(axes) -> None:
    d = element("crush")
    axes.plot(d["p"], d["alpha"], color=PALETTE[0])
    p = np.linspace(0.05, 1.2, 100)
    axes.plot(p, 1 + 0.25 * ((1.2 - p) / 1.15) ** 2, color="0.5", ls="--", lw=1, label="Herrmann")
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="P-alpha", xlabel="pressure (GPa)", ylabel="distension")


def rubber(axes) -> None:
    for k, (name, points) in enumerate(TRELOAR.items()):
        d = element(name.split()[-1])
        x = np.cumprod(np.append(1, 1 + np.diff(d["exx"])))
        axes.plot(x, d["sxx"] * d["J"] / x, color=PALETTE[k], label=name)
        axes.plot(*np.transpose(points), "o", color=PALETTE[k], ms=4)
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="Treloar's rubber, Ogden", xlabel="stretch", ylabel="nominal stress (MPa)")


def relaxation(axes) -> None:
    d = element("hold")
    t = d["time"][1:]
    axes.plot(t, d["sxy"][1:] / d["sxy"][1], color=PALETTE[0])
    exact = 1 - 0.3 * (1 - np.exp(-t / 0.01)) - 0.2 * (1 - np.exp(-t))
    axes.plot(t, exact, color="0.5", ls="--", lw=1, label="Prony series")
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="Relaxation", xlabel="time (s)", ylabel="stress / initial", ylim=(0, 1.05))


def moduli(axes) -> None:
    """Storage and loss from elements sheared through three periods."""
    found = []
    for w in (0.3, 1, 3, 10, 30, 100, 300):
        n = 40
        times = 2 * np.pi / w * np.arange(1, 3 * n + 1) / n
        lines = [f"load_path(p{k}, 1, exy={5e-5 * np.sin(w * t)}, duration={times[0]})"
                 for k, t in enumerate(times)]  # fmt: skip
        paths = ", ".join(f"p{k}" for k in range(len(times)))
        run(ELEMENTS + "\n".join(lines) + f"\nelement(w, damper, {paths})\n")
        t, s = times[n:], element("w")["sxy"][n + 1 :] / 1e-4
        waves = np.array([np.sin(w * t), np.cos(w * t), np.exp(-t)]).T
        found.append((w, *np.linalg.lstsq(waves, s, rcond=None)[0][:2]))
    w, stored, lost = np.array(found).T
    x = np.geomspace(w[0], w[-1], 200)
    terms = [(0.3, 0.01 * x), (0.2, x)]
    axes.plot(x, 1 - sum(g / (1 + y * y) for g, y in terms), color=PALETTE[0], label="storage")
    axes.plot(x, sum(g * y / (1 + y * y) for g, y in terms), color=PALETTE[1], label="loss")
    axes.plot(w, stored, "o", color=PALETTE[0], ms=4)
    axes.plot(w, lost, "o", color=PALETTE[1], ms=4)
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="Moduli of the series", xlabel="frequency (rad/s)", ylabel="modulus / G")
    axes.set_xscale("log")


def strip(axes) -> None:
    text = (INPUTS / "in.fibre_strip").read_text("utf-8")
    run("\n".join(line for line in text.splitlines() if not line.startswith("dump")))
    log = read_log(Path("log.mpm"))
    x = 1 + 0.3 * np.asarray(log["Step"]) / 20
    axes.plot(x, 1e3 * np.asarray(log["force"]), "o", color=PALETTE[0], ms=4, label="strip")
    d = element("one")
    exact = 1e3 * d["sxx"] / np.cumprod(np.append(1, 1 + np.diff(d["exx"])))
    axes.plot(np.exp(d["exx"]), exact, color="0.5", ls="--", lw=1, label="one element")
    axes.legend(fontsize=8, frameon=False)
    axes.set(title="Strip with fibres", xlabel="stretch", ylabel="force (mN)")


def main() -> None:
    figure = blank_figure(13, 6)
    panels = explosive, flyer, ceramics, pores, rubber, relaxation, moduli, strip
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for axes, panel in zip(figure.subplots(2, 4).flat, panels, strict=True):
            panel(axes)
            tidy(axes)
            axes.set_title(axes.get_title(), fontsize=10)
    savefig(figure, DOCS / "_static" / "laws.png")


if __name__ == "__main__":
    main()
