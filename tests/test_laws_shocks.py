"""Shocks in scenes: the tube of two ideal gases (Sod 1978), and copper driven by a piston."""

from __future__ import annotations

import numpy as np
import pytest

TUBE = """
method(ulmpm, FLIP, quadratic-spline, 1)
dimension(1, 0, 1, 0.005)
region(left, block, 0, 0.5)
region(right, block, 0.5, 1)
region(wall1, block, -0.01, 0.0001)
region(wall2, block, 0.9999, 1.01)
eos(a, ideal-gas, 1, 1.4, p=1, Q1=2, Q2=0.2)
eos(b, ideal-gas, 0.125, 1.4, p=0.1, Q1=2, Q2=0.2)
strength(thin, fluid, 0)
material(high, eos-strength, a, thin)
material(low, eos-strength, b, thin)
solid(l, region, left, 4, high, 0.005)
solid(r, region, right, 4, low, 0.005)
group(w1, nodes, region, wall1, all)
group(w2, nodes, region, wall2, all)
fix(h1, velocity_nodes, w1, 0)
fix(h2, velocity_nodes, w2, 0)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
compute(Ed, dissipated_energy, all)
dump(end, all, particle, 100000, end.*.LAMMPS, x, vx, s11, volume, mass)
log_modify(custom, step, time, Ek, Es, Ed)
set_output(100)
dt_factor(0.4)
run_time(0.143)
"""


@pytest.mark.full
def test_sod(run_script):
    """p* 0.30313, u* 0.92745, rho*L 0.42632, rho*R 0.26557, shock speed 1.75216 (exact solution).

    The shock is spread over some five cells: plateaus are read 0.03 away from all fronts.
    """
    result = run_script(TUBE)
    (end,) = (p for p in result.folder.glob("end.*") if p.name != "end.0.LAMMPS")
    last = result.dump(end.name)
    rho, p, t = last.mass / last.volume, -last.s11, 0.143
    contact, shock = 0.5 + 0.92745 * t, 0.5 + 1.75216 * t
    left = (last.x > 0.53) & (last.x < contact - 0.03)
    right = (last.x > contact + 0.05) & (last.x < shock - 0.03)
    assert rho[left].mean() == pytest.approx(0.42632, rel=1e-2)
    assert rho[right].mean() == pytest.approx(0.26557, rel=2e-2)
    for plateau in (left, right):
        assert p[plateau].mean() == pytest.approx(0.30313, rel=2e-2)
        assert last.vx[plateau].mean() == pytest.approx(0.92745, rel=2e-2)
    front = last.x[(p > (0.30313 + 0.1) / 2) & (last.x > 0.65)].max()
    assert front == pytest.approx(shock, abs=0.005)
    total = np.array(result.log.Ek) + result.log.Es + result.log.Ed
    assert np.abs(total).max() < 0.01 * result.log.Ek[-1]


PISTON = """
method(tlmpm, FLIP, linear, 0.99)
dimension(1, -1, 3, 0.01)
region(bar, block, 0, 2)
region(end, block, -0.001, 0.001)
eos(a, shock, 8.96, 1.1, 0.394, 1.489, 2.02, 383e-8, 298, 1.5, 0.06)
strength(thin, fluid, 0)
material(m, eos-strength, a, thin)
solid(l, region, bar, 1, m, 0.01)
group(w1, nodes, region, end, all)
fix(h1, velocity_nodes, w1, 0.1)
dump(end, all, particle, 100000, end.*.LAMMPS, x0, s11, volume)
set_output(1000)
dt_factor(0.4)
run_time(2.5)
"""


@pytest.mark.full
def test_piston(run_script):
    """Behind the shock p = rho0 U u and J = (U - u)/U, U = c0 + S u (Rankine & Hugoniot)."""
    result = run_script(PISTON)
    (end,) = (p for p in result.folder.glob("end.*") if p.name != "end.0.LAMMPS")
    last = result.dump(end.name)
    u = 0.1
    U = 0.394 + 1.489 * u
    shocked = (last.x0 > 0.2) & (last.x0 < 2.5 * U - 0.15)
    assert -last.s11[shocked].mean() == pytest.approx(8.96 * U * u, rel=5e-3)
    assert last.volume[shocked].mean() / 0.01 == pytest.approx((U - u) / U, rel=2e-3)
    front = last.x0[-last.s11 > 8.96 * U * u / 2].max()
    assert front == pytest.approx(2.5 * U, abs=0.01)
