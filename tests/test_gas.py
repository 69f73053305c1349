"""Gases take as heat the kinetic energy that a transfer takes."""

import re

import numpy as np
import pytest
from conftest import INPUTS, ROOT
from selection import parameters

from comparisons.lesser import radius_of_shock

TUBE = """
    method(ulmpm, {transfer}, quadratic-spline, {alpha})
    dimension(1, 0, 1, 0.1)
    region(all, block, 0.2, 0.8)
    eos(air, ideal-gas, 1, 1.4, p=1)
    strength(none, fluid, 0)
    material(air, eos-strength, air, none)
    solid(air, region, all, 2, air, 0.1)
    fix(v, initial_velocity_particles, all, sin(50*x0))
    compute(Ek, kinetic_energy, all)
    compute(Es, strain_energy, all)
    compute(Ed, dissipated_energy, all)
    E = Ek + Es + Ed
    set_dt(1e-12)
    set_output(1)
    log_modify(custom, step, Ek, E)
    run(3)
"""


@pytest.mark.parametrize(
    ("transfer", "alpha"),
    [("PIC", ""), ("FLIP", "0"), ("FLIP", "0.6"), ("XPIC", "1"), ("XPIC", "2"), ("XPIC", "3")],
)
def test_what_the_transfer_takes_is_heat(run_interpreted, transfer, alpha):
    """In steps so short that forces do nothing: conservation of energy, to the log's ten digits."""
    script = TUBE.format(transfer=transfer, alpha=alpha).replace(", )", ")")
    log = run_interpreted(script).log
    assert log.Ek[-1] < 0.1 * log.Ek[0]
    assert abs(log.E - log.E[0]).max() < 1e-9 * log.E[0]


ALONE = """
    method(ulmpm, {})
    dimension(1, 0, 1, 0.1)
    region(one, block, 0.5, 0.6)
    eos(air, ideal-gas, 1, 1.4, p=1)
    strength(none, fluid, 0)
    material(air, eos-strength, air, none)
    solid(air, region, one, 1, air, 0.1)
    fix(v, initial_velocity_particles, all, 0.1)
    compute(V, probe, all, volume)
    set_output(1)
    log_modify(custom, step, V)
    run(8)
"""


@pytest.mark.parametrize("transfer", ["APIC", "MLS", "TPIC", "AFLIP", "TFLIP"])
def test_a_point_alone_keeps_its_volume(run_interpreted, transfer):
    """Nobody shows it a gradient: exactly V0, where it was 1e9 times as much after these steps."""
    share = ", 1" if "FLIP" in transfer else ""
    log = run_interpreted(ALONE.format(f"{transfer}, quadratic-spline{share}")).log
    assert abs(log.V - 0.1).max() < 1e-12


@pytest.mark.parametrize(
    ("transfer", "alpha", "scheme", "within"),
    [
        # Without the heat it is 62, 17, 13 and 18 %; 12, 7, 17 and 8 %. With musl in the place of
        # usavg it is 3.1 and 6.6 %, with usavg 2.5 and 6.2 %. Of the full ones the heat is above.
        pytest.param("PIC", "mechanical", "musl", 0.1, marks=pytest.mark.full),
        pytest.param("APIC", "mechanical", "usl", 0.05, marks=pytest.mark.full),
        ("TPIC", "mechanical", "usavg", 0.03),
        pytest.param("FLIP", "0.9", "musl", 0.02, marks=pytest.mark.full),
        pytest.param("AFLIP", "0.5", "musl", 0.06, marks=pytest.mark.full),
        pytest.param("TFLIP", "0.9", "usavg", 0.07, marks=pytest.mark.full),
        pytest.param("XPIC", "2", "musl", 0.03, marks=pytest.mark.full),
        pytest.param("XPIC", "3", "musl", 0.02, marks=pytest.mark.full),
    ],
)
def test_energy_of_the_shock_tube(run_interpreted, transfer, alpha, scheme, within):
    """Conservation of energy on twenty cells, in 47 steps.

    What is left is of the order of the step, and what affine transfers keep within points.
    """
    script = (INPUTS / "in.sod").read_text(encoding="utf-8")
    script = script.replace("method(kind", f"scheme({scheme})\nmethod(kind")
    lines = [line for line in script.splitlines() if not line.startswith("dump(")]
    words = ["-var", "transfer", transfer, "-var", "alpha", alpha, "-var", "refine", "0.1"]
    words += ["-var", "ppc", "3"]
    log = run_interpreted("\n".join(lines), *words).log
    assert abs(log.total[-1]) / log.Ek[-1] < within


@pytest.mark.parametrize(("basis", "speed"), parameters([("linear", 0.4 / 1.4)], [("cpgimp", 1)]))
def test_sound_with_gradients_that_jump(run_interpreted, basis, speed):
    """A standing wave (Rayleigh 1878); c^2 = g p/rho, (g - 1) p/rho where cells keep volumes.

    Points of a gas that stay in their cells change p V by (1 - g) p dV, while the gradients and the
    sum of their volumes in a cell should change it by -g p dV.
    """
    script = (INPUTS.parent / "docs" / "verdicts" / "in.organ").read_text("utf-8")
    for old, new in (
        ("(k*c)", "(k*s)"),
        ("k*c*time", "k*s*time"),
        ("k = 2*PI/L", "k = 2*PI/L\ns = c*sqrt({speed})"),
    ):
        assert old in script
        script = script.replace(old, new.format(speed=speed))
    done = run_interpreted(script, "-var", "basis", basis, "-var", "refine", "2")
    # 0.021 and 0.035, a fourth of that with cells half as large; of the other speed 1.98.
    assert done.log.err_history[-1] < 0.05
    assert ("sound in a gas: " in done.err) == (speed < 1)


FLUX = """
    method(ulmpm, FLIP, quadratic-spline, 1{more})
    dimension(1, 0, 1, 0.1)
    region(all, block, 0, 1)
    eos(air, ideal-gas, 1, 1.4, p=1, Q1=1, Qh=5e4)
    strength(none, fluid, 0)
    material(air, eos-strength, air, none)
    solid(air, region, all, 2, air, 0.1)
    p = -1 - 0.5*cos(PI*x0)
    fix(p, initial_stress, all, p, p, p, 0, 0, 0)
    fix(v, initial_velocity_particles, all, -x0)
    region(half, block, 0, 0.5)
    group(half, particles, region, half, all)
    compute(left, average_stress, half)
    compute(all, average_stress, all)
    waves = all_11 - left_11
    set_dt(1e-6)
    set_output(1)
    log_modify(custom, step, time, waves)
    run(7)
"""


def test_artificial_heat_flux(run_interpreted):
    """A uniform rate of compression d: the first cosine of e decays by exp(-pi^2 Qh Q1 h^2 d t).

    From the second step on, since the first has no viscous pressure yet.
    """
    log = run_interpreted(FLUX.format(more=", thermo-mechanical")).log
    decay = log.waves[3:] / log.waves[2]
    exact = np.exp(-(np.pi**2) * 5e4 * 0.1**2 * (log.Time[3:] - log.Time[2]))
    assert exact[-1] < 0.98
    assert abs(decay - exact).max() < 1e-3


def test_heat_flux_needs_a_method_with_heat(run_interpreted):
    said = run_interpreted(FLUX.format(more=""), command="check").err
    assert "heat flux of material 'air': Qh has no effect" in said


def test_heat_flux_does_not_mix_with_temperatures(run_interpreted):
    """Nodes would average kelvin and energy per mass: cold steel warmed beside a gas at rest."""
    text = FLUX.format(more=", thermo-mechanical")
    steel = "region(b, block, 0.5, 1)\n    material(steel, linear, 7800, 2e11, 0.3, 500, 50)\n"
    solid = "    solid(steel, region, b, 2, steel, 0.1, 300)\n    p = "
    text = text.replace("region(all, block, 0, 1)", "region(all, block, 0, 0.5)")
    err = run_interpreted(text.replace("    p = ", "    " + steel + solid, 1), status=1).err
    assert "Qh of material 'air' diffuses energy per mass, and solid 'steel'" in err
    assert err.count("error:") == 1


WALL = """
    method(ulmpm, FLIP, quadratic-spline, 1)
    dimension(1, 0, 1, 0.1)
    region(column, block, 0, 0.8)
    eos(gas, ideal-gas, 1, 5/3, p=1e-6, Q1=6, Q2=0.2)
    strength(none, fluid, 0)
    material(gas, eos-strength, gas, none)
    solid(gas, region, column, 2, gas, 0.1)
    region(wall, block, -INF, 0.01)
    group(wall, nodes, region, wall, all)
    fix(wall, velocity_nodes, wall, 0)
    fix(v, initial_velocity_particles, all, -1)
    compute(Ek, kinetic_energy, all)
    set_output(1)
    log_modify(custom, step, dt, Ek)
    run(10)
"""


def test_first_step_of_a_shock(run_interpreted):
    """A cold gas that flows against a wall only loses kinetic energy (Noh 1987).

    No rate of compression is known yet. The step is 0.9 h/(c' + v), c' = 2 Q1 v for a cell that
    closes with v (Belytschko et al. 2014, eq. 6.3.10); with 0.9 h/v the energy grows by 40 %.
    """
    log = run_interpreted(WALL).log
    assert log.dt[0] == pytest.approx(0.9 * 0.1 / (2 * 6 + 1), rel=2e-3)
    assert log.Ek.max() <= log.Ek[0] * (1 + 1e-9)


def test_auto_follows_a_gas_that_expands_into_empty_space(run_interpreted):
    """Its points keep their neighbours, so it does not separate: Landau & Lifshitz 1987, 99."""
    text = (ROOT / "docs" / "verdicts" / "in.expansion").read_text("utf-8")
    text = re.sub(r"^method.*", "method(auto)", text, flags=re.M).replace("dt_factor(CFL)\n", "")
    done = run_interpreted(text, "-var", "g", "1.2")
    assert re.search("^  method +tlmpm APIC linear usl$", done.out, re.M)
    assert done.log.err[-1] < 0.045  # 8.7 % and more in ulmpm


def test_auto_follows_a_blast(run_script, run_interpreted):
    """Radius of a blast from three cells: Sedov 1959 (Kamm & Timmes 2007, LA-UR-07-2849)."""
    script, spherical, gas = (
        (INPUTS / "models" / name).read_text("utf-8")
        for name in ("in.blast", "blast.spherical", "blast.gas")
    )
    text = script.replace('include("blast." + model)', spherical).replace("dt_factor(0.3)\n", "")
    text = text.replace('include("blast.gas")', gas)
    apart = "points that are more than a cell apart lose up to half of the energy"
    assert apart in run_interpreted(text, command="check").err
    text = text.replace("method(ulmpm, APIC, quadratic-spline)", "method(auto)")
    done = run_script(text)
    assert apart not in done.err
    assert re.search(r"^  method +ulmpm FLIP \(alpha 1\) quadratic-spline usavg$", done.out, re.M)
    # 1.2, 0.2 and 0.3 % with 20, 40 and 80 cells; APIC is right near 40, 4 % off with 160.
    assert radius_of_shock(done) == pytest.approx(0.7579, rel=0.005)
