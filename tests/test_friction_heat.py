"""The work of friction becomes heat."""

import re

import pytest

from karamelo_py.points.laws.linear import LinearConstants
from karamelo_py.styles.methods.ulmpm_contacts import heat_fractions

pytestmark = pytest.mark.xdist_group("friction heat")
MU, G, V, TIME = 0.4, 10.0, 2.0, 0.2
BLOCK = f"""
    method({{method}}, FLIP, linear, 1)
    dimension(2, 0, 8, 0, 4, 0.5)
    region(block, block, 2, 4, 1, 2)
    material(steel, linear, 1000, 1e6, 0, 500, 0)
    solid(block, region, block, 2, steel, 0.5, 300)
    {{ground}}
    group(block, particles, region, block, solid, block)
    fix(g, body_force, all, 0, -{G})
    fix(v, initial_velocity_particles, block, {V}, 0)
    compute(T, average_temperature, block)
    compute(x, center_of_mass, block)
    compute(v, average_velocity, block)
    set_output(10)
    compute(Ek, kinetic_energy, block)
    compute(Es, strain_energy, block)
    E = (Ek + Es)/2000 + {G}*x_y
    log_modify(custom, step, time, T, x_x, E)
    dt_factor({{factor}})
    run_time({TIME})
"""
BASE = f"""region(base, block, 0, 8, 0, 1)
    material(rock, {{rock}})
    solid(base, region, base, 1, rock, 0.5{{T}})
    fix(rub, contact/friction, block, base, {MU})"""
WALL = f"""region(low, block, INF, INF, INF, 1.1)
    group(low, nodes, region, low, all)
    fix(wall, velocity_nodes, low, NULL, 0, mu={MU})"""


@pytest.mark.parametrize(
    ("method", "ground"),
    [
        ("ulmpm/contacts", BASE.format(rock="rigid, 1000", T="")),
        ("ulmpm", WALL),
    ],
)
@pytest.mark.parametrize(
    ("factor", "rel"), [pytest.param(0.1, 0.012, marks=pytest.mark.full), (0.8, 0.05)]
)
def test_heat_is_the_work_of_friction(run_script, run_interpreted, method, ground, factor, rel):
    """A block slides: m cp (T - T0) is what its energy lacks (exact), and mu m g s (Coulomb).

    With any step: taken with the speed that internal forces lead the surface to, the heat is 20 %
    and more too large at 0.8 of the stable step. What differs from the first there is what the
    bouncing block gains. It is dropped on the ground with its weight: the second holds on average.
    """
    run = run_script if factor < 0.5 else run_interpreted
    result = run(BLOCK.format(method=method, ground=ground, factor=factor))
    log = result.log
    heat = 500 * (log.T - 300)
    assert heat[-1] == pytest.approx(log.E[0] - log.E[-1], rel=rel)
    if factor < 0.5:  # enough steps for a look
        (lost,) = re.findall(r"  energy +(\S+) % of", result.out)
        assert abs(float(lost)) < 1  # what friction dissipates is in the balance
    assert heat[-1] == pytest.approx(MU * G * (log.x_x[-1] - log.x_x[0]), rel=0.08)


def test_heat_is_shared_by_effusivity():
    """sqrt(kappa rho cp) of steel and glass, 4 : 1 here; all to the one that has a temperature."""
    steel, glass = (LinearConstants(1000, 1e6, 0.3, 500, kappa).checked() for kappa in (16, 1))
    cold = LinearConstants(1000, 1e6, 0.3).checked()
    shares = heat_fractions([steel, glass, cold], conducting=True)
    assert shares[0] == pytest.approx([0.5, 0.8, 1])
    assert shares[2] == pytest.approx([0, 0, 0.5])
    assert heat_fractions([steel, glass], conducting=False)[0, 1] == 0.5
