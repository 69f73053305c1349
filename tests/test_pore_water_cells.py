"""Semi-implicit steps of pore water in the updated frame, with splines, and around an axis."""

import numpy as np
import pytest
from conftest import INPUTS
from test_pore_water import REST, SMOOTH

from comparisons.results import read_dump

scipy = pytest.importorskip("scipy")
from scipy.optimize import brentq  # noqa: E402
from scipy.special import jv  # noqa: E402

E = 1e7


def cylinder(T, terms=60):
    """Pressure over load on the axis of a loaded cylinder, nu = 0 (de Josselin de Jong 1953).

    With the volume strain e and its mean over the section, M e = p + C and C = G mean - F. Residues
    at the roots of a J0(a) = 2 G/M J1(a), with G/M = 1/2; T = c t / b^2.
    """
    ends = [(np.pi * k + 1e-3, np.pi * (k + 1)) for k in range(terms)]
    roots = np.array([brentq(lambda a: jv(0, a) - jv(1, a) / a, *end) for end in ends])
    slopes = -roots / 2 * (jv(1, roots) - jv(2, roots) / roots)
    decay = np.exp(-np.outer(T, roots**2)) / slopes
    centre = -2 - decay.sum(axis=1)
    mean = -2 - (decay * 2 * jv(1, roots) / roots).sum(axis=1)
    return 1 + centre - mean / 2


LOADED = """
    N = {N}
    H = 1
    method({kind}, FLIP, {form}, 1)
    scheme(semi-implicit)
    dimension({d}, 0, 1{z}, 1/N)
    {shape}(true)
    region(layer, block, 0, 1{z})
    material(clay, linear, 1590, {E}, 0)
    pore_water(clay, n=0.4, permeability=1e-3)
    solid(clay, region, layer, 2, clay, 1/N, 0)
    region(out, block, 1 - 1e-6, INF{all})
    group(out, nodes, region, out, all)
    {still}
    fix(load, force_nodes, out, -1000{none})
    fix(drain, pore_pressure, out, 0)
    fix(start, initial_pore_pressure, all, 1000)
    compute(p, probe, all, pore_pressure, x=0{middle})
    set_output({every})
    log_modify(custom, step, time, p)
    run_time({T}*9810/1e-3/{E})
"""
FORMS = {
    "cylindrical": {"d": 1, "z": "", "all": "", "none": "", "middle": "", "still": ""},
    "axisymmetric": {
        "d": 2, "z": ", 0, 1", "all": ", -INF, INF", "none": ", 0", "middle": ", y=0.5",
        "still": "region(still, block, -INF, INF, -INF, INF)\n"
        "group(still, nodes, region, still, all)\nfix(still, velocity_nodes, still, NULL, 0)",
    },
}  # fmt: skip


def error(log):
    T = log["Time"] * 1e-3 * E / 9810
    return np.abs(log["p"] / 1000 - cylinder(T))[T > 0.05].max()


def test_the_pressure_on_an_axis_rises_first_as_de_josselin_de_jong_found(run_interpreted):
    """It rises by 27 % before it falls (Mandel-Cryer effect)."""
    assert 1.27 < cylinder(np.linspace(0.01, 0.2, 50)).max() < 1.275
    values = {"kind": "tlmpm", "form": "linear", "N": 4, "E": E, "T": 0.12, "every": 4}
    text = LOADED.format(shape="cylindrical", **FORMS["cylindrical"], **values)
    assert error(run_interpreted(text).log) < 0.05


@pytest.mark.full
@pytest.mark.parametrize(
    ("shape", "kind", "form", "within"),
    [
        ("cylindrical", "tlmpm", "linear", 0.0015),
        ("axisymmetric", "tlmpm", "linear", 0.002),
    ],
)
def test_cylinders_of_16_cells_consolidate_as_de_josselin_de_jong_found(
    run_script, shape, kind, form, within
):
    values = {"kind": kind, "form": form, "N": 16, "E": E, "T": 0.5, "every": 20}
    log = run_script(LOADED.format(shape=shape, **FORMS[shape], **values)).log
    assert error(log) < within


@pytest.mark.parametrize("kind", [SMOOTH[0], pytest.param("tlmpm", marks=pytest.mark.full)])
def test_a_column_at_rest_has_hydrostatic_pressure(run_script, kind):
    text = REST.format(k="1e-6", method=kind, basis=SMOOTH[1], steps=500)
    text = text.replace("dimension(", "scheme(semi-implicit)\n    dimension(", 1)
    log = run_script(text.replace("dt_factor(0.5)", "")).log
    assert np.abs(log["p"] / (9810 * (1 - 1 / 64)) - 1).max() < 0.008
    assert abs(log["base_y"][-1] / (1990 * 9.81 / 16) - 1) < 1e-5


def column(more, *, K="2.2e9"):
    text = (INPUTS / "in.wet_column").read_text("utf-8").replace("dt_factor(0.5)", "")
    text = text.replace("dimension(", "scheme(semi-implicit)\ndimension(", 1)
    return text.replace("K=2e6", f"K={K}").replace("run_time(T)", f"{more}\nrun_time(T)")


def test_a_column_of_clay_with_real_water_spreads(run_script):
    """It fails at weight/strength 3.776 (Pastor, Thai & Francescato 2000) to 3.83 (Chen 1975).

    Strength follows the effective pressure, which undrained soil does not change.
    """
    columns = "s11, s22, s33, pore_pressure, porosity"
    text = column(f"dump(d, all, particle, 300, d.*.txt, {columns})")
    words = ("-var", "a", "2", "-var", "N", "8", "-var", "T", "0.3", "-var", "S")
    moved = {}
    for S in ("3.6", "4.4"):
        result = run_script(text, *words, S)
        moved[S] = result.log["runout"][-1] - result.log["runout"][0]
    assert moved["3.6"] < 0.05  # elastic
    assert moved["4.4"] > 0.15
    points = read_dump(result.folder / "d.300.txt")[-1]
    pressure = -(points["s11"] + points["s22"] + points["s33"]) / 3
    p0 = 2000 * 9.81 * 0.1 / 4.4 / 0.5
    assert np.abs(pressure / p0 - 1).max() < 0.01
    assert np.abs(points["pore_pressure"]).max() < 3 * 2000 * 9.81 * 0.1


@pytest.mark.full
def test_a_collapse_with_real_water_depends_little_on_the_cells(run_script):
    """1.73 and 1.80 half widths with 10 and 20 cells."""
    runout = [run_script(column(""), "-var", "N", N).log["runout"][-1] for N in ("10", "20")]
    assert abs(runout[0] / runout[1] - 1) < 0.05
