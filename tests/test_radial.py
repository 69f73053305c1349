"""Cylindrical and spherical scenes: one dimension, x the radius, against closed forms."""

from math import log

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

HEAD = """
method({method})
{scheme}
dimension(1, {a}, {b}, {h})
{kind}(true)
{law}
region(wall, block, {a}, {b})
solid(wall, region, wall, 2, m, {h})
b = {b}
E = 1e3
nu = 0.3
"""
ELASTIC = "material(m, linear, 1, 1e3, 0.3)"
INSIDE = "region(inside, block, INF, 1)\ngroup(inside, nodes, region, inside, all)\n"


def head(kind, a=1, b=2, n=16, *, method="tlmpm, FLIP, linear, 1", scheme="", law=ELASTIC):
    return HEAD.format(kind=kind, a=a, b=b, h=(b - a) / n, method=method, scheme=scheme, law=law)


LAME = {
    "spherical": "p/(E*(b^3 - 1))*((1 - 2*nu)*x0 + (1 + nu)*b^3/(2*x0^2))",
    "cylindrical": "(1 + nu)/E*p/(b^2 - 1)*((1 - 2*nu)*x0 + b^2/x0)",
}


@pytest.mark.parametrize("method", ["tlmpm, FLIP, linear, 1", "ulmpm, FLIP, quadratic-spline, 1"])
@pytest.mark.parametrize("kind", LAME)
def test_a_thick_shell_under_pressure(run_interpreted, kind, method):
    """Lame 1852; Timoshenko & Goodier 1970, sections 28 and 136. No node is held."""
    script = head(kind, n=32, method=method, scheme="scheme(quasi-static)") + f"""
p = 1e-2
fix(p, edge_pressure, all, wall, p*(x < 1.5))
compute(err, error, all, displacement, {LAME[kind]}, relative)
log_modify(custom, step, err, p_x)
run(1)
"""  # fmt: skip
    log = run_interpreted(script).log
    assert log["err"][-1] < 0.014  # the load acts half a box inside the wall
    assert log["p_x"][-1] == pytest.approx(0.01, rel=1e-12)  # of the radius 1


def cavity(u, b=2, E=1e3, nu=0.3, Y=1):
    """Pressure in a cavity of radius 1 in a thick shell, by the displacement of its wall.

    Plastic up to c: p = 2 Y ln c + 2 Y/3 (1 - c^3/b^3) (Hill 1950, section V.2), and the volume
    strain follows from the mean stress.
    """

    def widened(c):
        at_c = 2 * Y * c**3 / (3 * E * b**3) * ((1 - 2 * nu) * c + (1 + nu) * b**3 / (2 * c * c))
        sums = quad(lambda r: (2 * Y * (c / b) ** 3 - 6 * Y * log(c / r)) * r * r, 1, c)[0]
        return c * c * at_c - (1 - 2 * nu) / E * sums

    c = brentq(lambda c: widened(c) - u, 1, b)
    return 2 * Y * log(c) + 2 * Y / 3 * (1 - (c / b) ** 3)


def test_a_cavity_expands_in_metal(run_interpreted):
    """In four load steps, to plastic flow in two thirds of the wall: Tresca is von Mises here."""
    law = """eos(e, linear, 1, 1e3/1.2)
strength(s, plastic, 1e3/2.6, 1)
material(m, eos-strength, e, s)"""
    script = head("spherical", scheme="scheme(quasi-static)", law=law) + INSIDE + """
fix(widen, velocity_nodes, inside, 1e-3)
set_output(1)
log_modify(custom, step, widen_x)
run(4)
"""  # fmt: skip
    found = run_interpreted(script).log["widen_x"][1:]
    exact = [cavity(1e-3 * k) for k in range(1, 5)]
    assert np.abs(found / exact - 1).max() < 0.01


def test_a_sphere_breathes(run_interpreted):
    """Its first radial mode, of the wave number k with tan kR/kR = 1/(1 - (kR c/2 cs)^2) (Lamb
    1882), after a period: the frequency, the form of the mode, and the energy."""
    k = brentq(lambda q: np.tan(q) - q / (1 - q * q / 4 * 3.5), 2.2, 3.1)
    script = head("spherical", 0, 1, 16) + f"""
w = {k}*sqrt(E*(1 - nu)/((1 + nu)*(1 - 2*nu)))
q = {k}*x0
v = 1e-3*(sin(q)/q^2 - cos(q)/q)
fix(v, initial_velocity_particles, all, v)
compute(err, error, all, velocity, v*cos(w*time), relative)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, time, err, Ek, Es)
run_time(2*PI/w)
"""  # fmt: skip
    log = run_interpreted(script).log
    assert log["err"][-1] < 0.02
    energy = log["Ek"] + log["Es"]
    assert energy[-1] == pytest.approx(energy[0], rel=2e-3)


def test_a_wave_leaves_a_cavity(run_interpreted):
    """A sudden pressure p in a cavity of radius a: u = d(f/r)/dr at the time t - (r - a)/c, where
    f'' + 4 cs^2/(c a) f' + 4 cs^2/a^2 f = -p a/rho (Selberg 1952, Ark. Fys. 5)."""
    script = head("spherical", 1, 4, 36) + """
c = sqrt(E*(1 - nu)/((1 + nu)*(1 - 2*nu)))
G = E/(2*(1 + nu))
damping = 2*G/c
w = sqrt(4*G - damping^2)
t = max(time - (x0 - 1)/c, 0)
p = 0.1
fade = exp(-damping*t)
f = -p/(4*G)*(1 - fade*(cos(w*t) + damping/w*sin(w*t)))
rate = -p/(4*G)*fade*(w + damping^2/w)*sin(w*t)
fix(p, edge_pressure, all, wall, p*(x < 2))
compute(err, error, all, displacement, -f/x0^2 - rate/(c*x0), relative)
log_modify(custom, step, err)
run_time(2.5/c)
"""  # fmt: skip
    assert run_interpreted(script).log["err"][-1] < 0.05


@pytest.mark.parametrize("kind", LAME)
@pytest.mark.parametrize("method", ["tlmpm, FLIP, linear, 1", "ulmpm, APIC, cpgimp"])
def test_even_expansion_is_exact(state_interpreted, kind, method):
    """x -> (1 + s) x: all hoop stretches are the radial one, and no inner node has a force."""
    law = "material(m, neo-hookean, 1, 1e3, 0.3)"
    script = head(kind, 0, 1, 8, method=method, law=law).replace("(1, 0, 1,", "(1, 0, 2,") + """
region(inner, block, INF, 0.8)
group(inner, nodes, region, inner, all)
fix(v, initial_velocity_particles, all, x)
fix(n, velocity_nodes, all, x)
set_dt(0.001)
run(20)
"""  # fmt: skip
    columns = ("x", "s11", "s22", "s33", "volume")
    state = state_interpreted(script, *columns)
    assert state["s22"] == pytest.approx(state["s11"], rel=1e-12)
    assert np.ptp(state["s11"]) < 1e-10 * state["s11"][0]
    if kind == "spherical":
        assert state["s33"] == pytest.approx(state["s11"], rel=1e-12)
    # In the total frame nodes stay at their places, and velocities do not grow.
    stretch = 1.02 if method.startswith("tlmpm") else 1.001**20
    assert state["x"][0] == pytest.approx(stretch / 32, rel=1e-12)
    bounds = stretch * np.array([0, 1 / 16])  # of the innermost point, with r^n dr of its middle
    n = 2 if kind == "spherical" else 1
    assert state["volume"][0] == pytest.approx(np.mean(bounds) ** n * np.ptp(bounds), rel=1e-12)


GAS = """eos(air, ideal-gas, 1.2, 1.4, p=10)
strength(thin, fluid, 0)
material(m, eos-strength, air, thin)"""


@pytest.mark.parametrize("kind", LAME)
@pytest.mark.parametrize("basis", ["linear", "cpgimp"])
def test_gas_stays_at_rest(run_interpreted, kind, basis):
    """Its pressure and that of the wall at the radius 1 are in equilibrium, also at r = 0."""
    script = head(kind, 0, 1, 10, method=f"ulmpm, FLIP, {basis}, 0.99", law=GAS) + INSIDE + """
region(outside, block, 1, INF)
group(outside, nodes, region, outside, all)
fix(hold, velocity_nodes, outside, 0)
compute(Ek, kinetic_energy, all)
log_modify(custom, step, Ek, hold_x)
run(20)
"""  # fmt: skip
    log = run_interpreted(script).log
    assert log["Ek"][-1] < 1e-20
    # With the volumes r^2 dr of the middles of points, of dr = 1/20, the wall is at R^2 - dr^2/4.
    area = 1 - 0.05**2 / 4 if kind == "spherical" else 1
    assert log["hold_x"][-1] == pytest.approx(-10 * area, rel=1e-9)


def test_shells_in_contact_are_one_shell(run_interpreted):
    """Two shells under inner pressure, as in `test_a_thick_shell_under_pressure`, in load steps;
    the contact carries p a^3/(b^3 - a^3) (b^3/c^3 - 1) c^2 per steradian of the radius c."""
    contacts = "ulmpm/contacts, FLIP, linear, 1"
    both = head("spherical", n=32, method=contacts, scheme="scheme(quasi-static)")
    one = "region(wall, block, 1, 2)\nsolid(wall, region, wall, 2, m, 0.03125)\n"
    assert one in both
    script = both.replace(one, """region(wall, block, 1, 1.5)
region(outer, block, 1.5, 2)
solid(wall, region, wall, 2, m, 1/32)
solid(outer, region, outer, 2, m, 1/32)
""") + f"""
p = 1e-2
fix(p, edge_traction, all, wall, xlo, p)
compute(err, error, all, displacement, {LAME["spherical"]}, relative)
log_modify(custom, step, err, ContactForce_outer_x)
run(1)
"""  # fmt: skip
    log = run_interpreted(script).log
    assert log["err"][-1] < 0.008
    exact = 1e-2 / 7 * (8 / 1.5**3 - 1) * 1.5**2
    assert abs(log["ContactForce_outer_x"][-1]) == pytest.approx(exact, rel=0.01)


def test_a_rubber_shell_needs_averaged_volumes(run_interpreted):
    """Lame's shell with nu = 0.4999: linear cells are too stiff, which is warned of."""
    law = "material(m, linear, 1, 1e3, 0.4999)"
    script = head("spherical", method="ulmpm, FLIP, linear, 1", law=law) + f"""
scheme(quasi-static)
p = 1e-2
nu = 0.4999
fix(p, edge_traction, all, wall, xlo, p)
compute(err, error, all, displacement, {LAME["spherical"]}, relative)
log_modify(custom, step, err)
run(1)
"""  # fmt: skip
    stiff = run_interpreted(script, folder="stiff")
    assert "locking" in stiff.err and stiff.log["err"][-1] > 0.5
    averaged = run_interpreted(script.replace("scheme(", "anti_volumetric_locking(true)\nscheme("))
    assert averaged.log["err"][-1] < 0.035


def test_heat_flows_out_of_a_shell(run_interpreted):
    """T = 2/r - 1 in the end, flux k a b/(b - a) (Carslaw & Jaeger 1959, section 9.2)."""
    warm = "tlmpm, FLIP, linear, 1, thermo-mechanical"
    law = "material(m, linear, 1, 1e3, 0.3, 1, 10)"
    script = head("spherical", n=4, method=warm, law=law) + INSIDE + """
region(outside, block, 2, INF)
group(outside, nodes, region, outside, all)
fix(still, velocity_particles, all, 0)
fix(in, temperature_nodes, inside, 1)
fix(out, temperature_nodes, outside, 0)
compute(err, error, all, T, 2/x0 - 1)
log_modify(custom, step, err, in_s)
run_time(0.07)
"""  # fmt: skip
    log = run_interpreted(script).log
    assert log["err"][-1] < 0.01
    assert log["in_s"][-1] == pytest.approx(20, rel=0.02)


def test_check_proposes_a_line(run_interpreted):
    script = """
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 1, 0, 0.2, 0.1)
axisymmetric(true)
region(all, block, INF, INF, INF, INF)
material(m, linear, 1, 1e3, 0.3)
solid(s, region, all, 2, m, 0.1)
group(n, nodes, region, all, all)
fix(plane, velocity_nodes, n, NULL, 0)
fix(v, initial_velocity_particles, all, x0, 0)
run(1)
"""
    found = run_interpreted(script, command="check").out
    assert "dimension(1, 0, 1, 0.1), and cylindrical(true)" in found


SOLID = """
material(m, linear, 1, 1e3, 0.3)
region(r, block, 0, 0.5)
solid(s, region, r, 2, m, 0.1)
"""
LINE = "dimension(1, 0, 1, 0.1)\n"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("dimension(2, 0, 1, 0, 1, 0.1)\nspherical(true)", "axisymmetric(true)"),
        ("dimension(3, 0, 1, 0, 1, 0, 1, 0.1)\ncylindrical(true)", "must have one: the radius"),
        (LINE + "axisymmetric(true)", "spherical(true)"),
        ("dimension(1, -1, 1, 0.1)\nspherical(true)", "x is a radius"),
        (LINE + "uniaxial_stress(true)\nspherical(true)", "uniaxial_stress(false)"),
        (LINE + "spherical(true)\nuniaxial_stress(true)", "spherical(false)"),
        (LINE + "spherical(true)\ncylindrical(true)", "spherical already"),
        (LINE + SOLID + "spherical(true)", "before the first"),
        (LINE + "spherical(true)\nmaterial(w, orthotropic, 1, 3, 2, 1, 0, 0, 0, "
         "1, 1, 1)", "stay round"),
    ],
)  # fmt: skip
def test_what_has_no_radius_is_refused(run_interpreted, lines, says):
    assert says in run_interpreted(f"method(ulmpm, FLIP, linear, 1)\n{lines}\n", status=1).err
