"""The vibrating bar: first mode of a fixed-free bar (benchmark B1).

L 25, E 100, rho 1, nu 0, v0 = 0.1 sin(pi x / 2L): the mean velocity is 0.2/pi cos(omega t) with
omega = pi / (2L) sqrt(E / rho), a period of 10, and the energy m v^2 / 2 = 0.1^2 L / 4 stays.
"""

from math import pi, sqrt

import numpy as np
import pytest

from comparisons.vibrating_bar import frequency

LENGTH, AMPLITUDE = 25, 0.1
OMEGA = pi / (2 * LENGTH) * sqrt(100 / 1)
ENERGY = AMPLITUDE**2 * LENGTH / 4


def bar(d: int, transfer: str, time: float, law: str = "linear") -> str:
    """The bar along x: one cell wide, held at x = 0, without motion across."""
    across = ", 0, 1" * (d - 1)
    no_motion = ", 0" * (d - 1)
    return f"""
method(ulmpm, {transfer})
dimension({d}, 0, 27{across}, 1)
region(all, block, 0, {LENGTH}{across})
region(root, block, 0, 0{", INF, INF" * (d - 1)})
material(m, {law}, 1, 100, 0)
solid(bar, region, all, 2, m, 1, 0)
group(root, nodes, region, root, all)
fix(mode, initial_velocity_particles, all, {AMPLITUDE}*sin(PI*x0/(2*{LENGTH})))
fix(hold, velocity_nodes, root, 0{no_motion})
{f"fix(flat, velocity_nodes, all, NULL{no_motion})" if d > 1 else ""}
compute(v, average_velocity, all)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, time, dt, v_x, Ek, Es, Ek + Es)
set_output(5)
run_time({time})
""".replace("sin(PI*x0/(2*25)))", "sin(PI*x0/(2*25))" + no_motion + ")")


@pytest.mark.xdist_group("neo-hookean")
def test_flip_holds_frequency_and_energy(run_script):
    """Ten periods of a plane bar of 25 cells; comparisons/vibrating_bar.py: linear, in 1D.

    Frequency within 0.5 %: dispersion of linear elements with wave number k is (k h)^2 / 24 = 2e-4,
    the strains of 0.6 % add as much. Stress and velocity follow each other as in symplectic Euler,
    so their energy swings by omega dt / 2 = 2.8 %. Its mean over a period does not grow (0.2 %: the
    periods are cut at whole log lines, 1/22 of a period) and falls by less than 1 % in ten periods,
    where PIC loses ten times as much in one (lumped masses cost FLIP 0.06 % per period).
    """
    log = run_script(bar(2, "FLIP, linear, 1", 100, "neo-hookean"), "--threads", "1").log
    assert log.v_x[0] == pytest.approx(2 / pi * AMPLITUDE, rel=1e-3)  # midpoint rule
    assert frequency(log.Time, log.v_x) == pytest.approx(OMEGA, rel=5e-3)
    total = log.Ek + log.Es
    assert total[0] == pytest.approx(ENERGY, rel=1e-3)
    assert np.abs(total / total[0] - 1).max() < 1.25 * OMEGA * log.dt.max() / 2
    first, last = total[log.Time < 10].mean(), total[log.Time > 90].mean()
    assert 0.99 < last / first < 1.002


def test_pic_decays_as_computed(run_script):
    """PIC multiplies a wave by a^2 in each step, by its two averages between points and nodes.

    A node averages points h/4 and 3h/4 away with weights 3/4 and 1/4, a point its nodes alike:
    a = 3/4 cos(k h / 4) + 1/4 cos(3 k h / 4). So v' = ... - g v with g = (1 - a^2) / dt, an
    oscillator whose energy falls by exp(-g t). The swing of the energy (see above) vanishes at
    whole half periods. Within 1 %: the ends of the bar average differently.
    """
    dt, k = 0.05, pi / (2 * LENGTH)
    script = bar(1, "PIC, linear", 10).replace("run_time", f"set_dt({dt})\nrun_time")
    log = run_script(script.replace("set_output(5)", "set_output(100)")).log
    total = log.Ek + log.Es
    a = 0.75 * np.cos(k / 4) + 0.25 * np.cos(3 * k / 4)
    expected = np.exp(-(1 - a**2) / dt * log.Time)
    assert log.Time == pytest.approx([0, 5, 10])
    assert total / total[0] == pytest.approx(expected, rel=0.01)
    assert expected[-1] < 0.9
