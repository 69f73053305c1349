"""Laws in scripts: what a scene carries, columns and computes, UL and TL, mistakes."""

import re
from math import cos, radians, sin

import numpy as np
import pytest

from karamelo_py.app.cli import main

HEAD = """
dimension(2, -0.5, 1.5, 0, 1, 0.5)
region(box, block, 0, 1, 0, 1)
region(everywhere, block, INF, INF, INF, INF)
"""
COPPER = """
eos(bulk, shock, 8.96, 1.1, 0.394, 1.489, 2.02, 383e-8, 298, 1.5, 0.06)
strength(hard, johnson_cook, 0.46, 90e-5, 292e-5, 0.31, 1e-6, 0.025, 1.09, 298, 1356)
damage(ductile, damage_johnson_cook, 0.54, 4.89, -3.03, 0.014, 1.12, 1e-6, 298, 1356)
temperature(warm, plastic_work, 0.9, 383e-8, 0, 0, 298, 1356)
"""
PULL = """
group(nodes, nodes, region, everywhere, all)
fix(pull, velocity_nodes, nodes, RATE*x0, 0)
compute(worst, max_plastic_strain, all)
compute(Es, strain_energy, all)
compute(Ed, dissipated_energy, all)
compute(heat, average_temperature, all)
dump(end, all, particle, 100000, end.*.LAMMPS, x, s11, s22, s33, s12, ep, damage, damage_init, T)
log_modify(custom, step, time, worst_Epmax, worst_Tmax, heat, Es, Ed)
set_output(100000)
set_dt(0.02)
run(50)
"""


def pulled(material, rate=0.05, method="ulmpm, FLIP, linear, 1", more=""):
    pull = PULL.replace("RATE", str(rate))
    if "warm" not in material + more:  # nothing of the scene has a temperature
        pull = pull.replace("compute(heat, average_temperature, all)\n", "").replace(" heat,", "")
    return (
        f"method({method})\n{HEAD}{COPPER}{material}\n{more}"
        f"solid(s, region, box, 1, m, 0.5)\n{pull}"
    )


ALL = "material(m, eos-strength, bulk, hard, ductile, warm)"


@pytest.mark.parametrize("method", ["ulmpm, FLIP, linear, 1", "tlmpm, FLIP, linear, 1"])
def test_columns_and_computes(run_interpreted, method):
    """Uniform strain: damage, temperature and dissipated energy are there."""
    result = run_interpreted(pulled(ALL, method=method))
    assert "will be 0" not in result.err
    last = result.dump("end.50.LAMMPS")
    assert np.ptp(last.T) == pytest.approx(0, abs=1e-9)
    assert last.T[0] > 298 and last.ep[0] > 0 and 0 < last.damage_init[0] < 1
    assert last.damage.tolist() == [0] * len(last.id)
    lost = result.log.Ed[-1]
    assert result.log.worst_Tmax[-1] == pytest.approx(last.T[0])
    assert result.log.heat == pytest.approx([298, last.T[0]])
    assert result.log.Ed[0] == 0
    # One unit of volume: dT = chi/(rho0 cp) Ed.
    assert last.T[0] - 298 == pytest.approx(0.9 / (8.96 * 383e-8) * lost, rel=1e-2)


def test_ul_and_tl_are_the_same(run_interpreted):
    ul, tl = (
        pulled(ALL, method=f"{kind}, FLIP, linear, 1").replace("0.5)", "0.25)")
        for kind in ("ulmpm", "tlmpm")
    )
    ul = ul.replace("0.05*x0", "0.05*x0/(1 + 0.05*time)")
    a = run_interpreted(ul, folder="ul").dump("end.50.LAMMPS")
    b = run_interpreted(tl, folder="tl").dump("end.50.LAMMPS")
    for name in ("s11", "s22", "ep", "T", "damage_init"):
        assert a[name] == pytest.approx(b[name], rel=1e-6)


def test_order_of_damage_and_temperature_is_free(run_interpreted):
    """The first two lines differ in the order; numbers do not."""
    a, b = (
        run_interpreted(pulled(f"material(m, eos-strength, bulk, hard, {x})"), folder=x[:4])
        for x in ("ductile, warm", "warm, ductile")
    )
    assert a.dump("end.50.LAMMPS").s11.tolist() == b.dump("end.50.LAMMPS").s11.tolist()


def test_columns_of_what_is_absent(run_interpreted):
    result = run_interpreted(pulled("material(m, eos-strength, bulk, hard)"))
    assert re.search(r"damage, damage_init, T will be 0", result.err)
    assert result.dump("end.50.LAMMPS")["T"].tolist() == [0] * 4


def test_torn_apart(run_interpreted):
    """Beyond failure the run goes on: D = 1, no stress, no NaN."""
    weak = ALL.replace("ductile", "weak")
    more = "damage(weak, damage_johnson_cook, 0.02, 0, 0, 0, 0, 1, 298, 1356)\n"
    script = pulled("", rate=0.2, more=more + weak + "\n")
    last = run_interpreted(script).dump("end.50.LAMMPS")
    assert last.damage.tolist() == [1] * len(last.id)
    assert last.s11 == pytest.approx(np.zeros(4), abs=1e-15)


def test_initial_temperature(run_interpreted):
    """That of the solid; where it says none, that of the material."""
    script = pulled(ALL).replace("run(50)", "run(0)")
    assert run_interpreted(script, folder="a").dump("end.0.LAMMPS")["T"].tolist() == [298] * 4
    hot = script.replace("m, 0.5)", "m, 0.5, 600)")
    assert run_interpreted(hot, folder="b").dump("end.0.LAMMPS")["T"].tolist() == [600] * 4


@pytest.mark.parametrize("strength", ["mohr-coulomb", "drucker-prager"])
def test_soil(run_interpreted, strength):
    """Compressed beyond its strength in a script: on the surface of the soil."""
    script = pulled(
        f"eos(ground, linear, 2, 100)\nstrength(soil, {strength}, 150, 0.3, 30, 0)\n"
        "material(m, eos-strength, ground, soil)",
        rate=-0.02,
    )
    last = run_interpreted(script).dump("end.50.LAMMPS")
    if strength == "mohr-coulomb":
        a = radians(30)
        s = np.sort([last.s11, last.s22, last.s33], axis=0)
        f = s[2] - s[0] + (s[2] + s[0]) * sin(a) - 2 * 0.3 * cos(a)
    else:
        p = -(last.s11 + last.s22 + last.s33) / 3
        root = np.sqrt(((last.s11 + p) ** 2 + (last.s22 + p) ** 2 + (last.s33 + p) ** 2) / 2)
        below = np.sqrt(3) * (3 - 0.5)
        f = root - 6 * cos(radians(30)) / below * 0.3 - 6 * 0.5 / below * p
    assert last.ep.min() > 0
    assert f == pytest.approx(np.zeros(4), abs=1e-9)  # nine digits are written


def test_gas_and_fluid(run_interpreted):
    """A gas at rest in a closed box stays; compressed as the box is, it heats by the work."""
    gas = "eos(gas, ideal-gas, 1.2, 1.4, p=1, Q1=2, Q2=0.2)\nstrength(thin, fluid, 1e-3)\n"
    script = pulled("", rate=-0.1, more=gas + "material(m, eos-strength, gas, thin)\n")
    result = run_interpreted(script)
    last = result.dump("end.50.LAMMPS")
    j = (1 - 0.1 * 0.02) ** 50
    assert last.s11 == pytest.approx(-np.full(4, j**-1.4), rel=2e-2)
    assert (last.s11 < -(j**-1.4)).all()  # viscous pressure, and heat
    assert result.log.Ed[-1] > 0


def test_viscosity_knows_the_cell_size(tmp_path, capsys):
    """The first step is shorter by viscous damping, by more in smaller cells."""
    limits = []
    for h in (0.25, 0.125):
        script = pulled("strength(thick, fluid, 0.2)\nmaterial(m, eos-strength, bulk, thick)")
        path = tmp_path / f"in.{h}"
        cells = script.replace("1, 0.5)", f"1, {h})").replace("m, 0.5)", f"m, {h})")
        path.write_text(cells.replace("0.05*x0", "0*x0"))
        assert main(["check", str(path)]) == 0
        found = re.search(r"stable limit ([0-9.e+-]+)", capsys.readouterr().out)
        limits.append(float(found[1]))
        c2 = 0.394**2
        a = 4 / 3 * 0.2 / (8.96 * h)
        shear = np.sqrt(c2 + a * a) + a
        b = 0.06 * 0.394
        assert limits[-1] == pytest.approx(h / (np.sqrt(shear**2 + b * b) + b), rel=1e-5)
    assert limits[1] < limits[0] / 2


def test_check_names_the_parts_there_are(run_interpreted):
    for parts, name, count in (  # viscosity is a number more
        ("bulk, hard", "shock, johnson_cook", 8),
        ("bulk, hard, warm", "shock, johnson_cook, plastic_work", 9),
        ("bulk, hard, ductile", "shock, johnson_cook, damage_johnson_cook", 9),
        ("quiet, hard", "shock, johnson_cook", 7),
    ):
        quiet = "eos(quiet, shock, 8.96, 1, 0.394, 1.489, 2, 383e-8, 298, 0, 0)\n"
        text = pulled(f"{quiet}material(m, eos-strength, {parts})")
        out = run_interpreted(text, command="check").out
        assert f"a point of m (eos-strength: {name})\n" in out
        assert re.search(rf"^  state +{count} +{8 * count}$", out, re.M)


@pytest.mark.full
def test_compiled_is_the_same(run_script, run_interpreted):
    """Shear, flow, heat, damage and viscosity, from NumPy and from the compiler."""
    script = pulled(ALL, rate=-0.1)
    compiled = run_script(script, folder="compiled").dump("end.50.LAMMPS")
    interpreted = run_interpreted(script, folder="interpreted").dump("end.50.LAMMPS")
    for name in ("s11", "s22", "ep", "T", "damage_init"):
        assert compiled[name] == pytest.approx(interpreted[name], rel=1e-8)


@pytest.mark.parametrize(
    "line, says",
    [
        ("eos(e, shock, 8.96, 1, 0.394, 1.5, 2, 1, 298, 1)", "eos(ID, shock, rho0, K, c0, S"),
        ("eos(e, shock, 8.96, 1, 0, 1.5, 2, 1, 298, 1, 1)", "'c0' must be a number above 0"),
        ("eos(e, shock, 8.96, 1, 1, 1.5, 2, 1, 298, -1, 1)", "'Q1' must be a number"),
        ("eos(e, shok, 1)", "did you mean 'shock'?"),
        ("eos(e, fluid, 1000, 0, 7)", "'K' must be a number above 0"),
        ("eos(e, ideal-gas, 1.2, 1, p=1)", "the ratio of specific heats 1 is impossible"),
        ("eos(e, ideal-gas, 1.2, 1.4)", "needs a pressure or an energy"),
        ("eos(e, ideal-gas, 1.2, 1.4, p=1, e=1)", "one follows from the other"),
        ("eos(e, ideal-gas, 1.2, 1.4, p=-1)", "'p' must be a number above 0"),
        ("strength(s, plastic, 80, 1, -1)", "'H' must be a number"),
        ("strength(s, johnson_cook, 80, 1, 1, 1, 1, 0, 1, 300, 300)", "Tm = 300 is not above"),
        ("strength(s, johnson_cook, 80, 1, 1, 1, 0, 0.1, 1, 300, 400)", "needs a reference rate"),
        ("strength(s, johnson_cook, 80, 1, 1)", "strength(ID, johnson_cook, G, A, B, n, epsdot0"),
        ("strength(s, swift, 80, 0, 1, 0, 1)", "'A' must be a number above 0"),
        ("strength(s, fluid, -1)", "'mu' must be a number"),
        ("strength(s, mohr-coulomb, 80, 1, 90)", "the friction angle phi = 90 is impossible"),
        ("strength(s, mohr-coulomb, 80, 1, 30, 31)", "psi = 31 is impossible with phi = 30"),
        ("strength(s, mohr-coulomb, 80, 0, 0)", "neither cohesion nor friction"),
        ("strength(s, mohr-coulomb, 80, -1, 30)", "'cohesion' must be a number"),
        ("strength(s, mohr-coulomb, 80, 1, 30, 0, softening=1)", "needs a residual strength"),
        ("strength(s, mohr-coulomb, 80, 1, 30, 0, residual_phi=20)", "softening=plastic strain"),
        ("strength(s, mohr-coulomb, 80, 1, 30, 0, residual_phi=40, softening=1)",
         "the residual phi 40 is above its peak, 30"),
        ("strength(s, drucker-prager, 80, 1, 30, 0, fit=outer)", "'fit' must be one of"),
        ("strength(s, drucker-prager, 80, 1, 30, 0, tension=-1)", "'tension' must be a number"),
        ("damage(d, damage_johnson_cook, 1, 1, 1, 0, 0, 1, 300, 300)", "is not above Tr = 300"),
        ("damage(d, damage_johnson_cook, -1, 1, 1, 0, 0, 1, 0, 1)", "d1 + d2 = 0, is not above"),
        ("damage(ductile, damage_johnson_cook)", "damage: ID 'ductile' is already used"),
        ("damage(d, johnson_cook, 1)", "did you mean 'damage_johnson_cook'?"),
        ("temperature(t, plastic_work, 0.9, 0, 0, 0, 298, 1356)", "'cp' must be a number above 0"),
        ("temperature(t, plastic_work, 2, 1, 0, 0, 298, 1356)", "'chi' must be a number"),
        ("temperature(t, plastic_work, 0.9, 1, 0, 0, 298, 298)", "Tm = 298 is not above T0"),
        ("temperature(t, plastic_work, 0.9, 1, 0, 0, 298)", "temperature(ID, plastic_work, chi,"),
        ("material(m, eos-strength, bulk, hard, wrm)", "unknown damage or temperature 'wrm'"),
        ("material(m, eos-strength, bulk, hard, wrm)", "did you mean 'warm'?"),
        ("material(m, eos-strength, bulk, hard, warm, warm)", "are both a temperature"),
        ("material(m, eos-strength, bulk, hard, 3)", "unknown damage or temperature '3'"),
    ],
)  # fmt: skip
def test_mistakes(run_interpreted, line, says):
    script = f"method(ulmpm, FLIP, linear, 1)\n{HEAD}{COPPER}{line}\n"
    assert says in run_interpreted(script, status=1).err
