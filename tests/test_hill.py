"""Plasticity with directions: closed forms of yielding and flow, rotations, and energy."""

from math import cos, log, radians, sin, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from laws import lanes_are_the_point_function, leaning_is_reported
from tensors import every_kinematics, flat, rotation, symmetric_matrix

from comparisons.results import read_log
from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.slopes import Dual
from karamelo_py.points.kinematics import I, PlaneStrain, Space
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    dissipated_energy,
    energy_density,
    initial_state,
    kirchhoff_stress,
    plastic_strain,
    with_stress,
)
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.hill import Hill, of_lankford
from karamelo_py.points.laws.jointed import JointedConstants
from karamelo_py.points.laws.linear import LinearConstants
from karamelo_py.points.laws.orthotropic import Orthotropic
from karamelo_py.points.laws.strengths.hardening import LinearHardening, Plastic
from karamelo_py.points.laws.strengths.metals import Swift

E, NU, Y = 200e9, 0.3, 300e6
STEEL = LinearConstants(7850, E, NU).checked()
SPRUCE = Orthotropic(7850, E, 0.7 * E, 0.5 * E, 0.3, 0.25, 0.2, 0.3 * E, 0.25 * E, 0.2 * E)
R = (1.8, 1.2, 2.3)
SPACE = Space()


def sheet(*angles, elastic=STEEL, strength=None, **surface):
    strength = strength or Plastic(STEEL.G, Y)
    part = SimpleNamespace(laws={"strength": strength}, id="hard")
    return Hill(SimpleNamespace(whole=elastic), part, *angles, **surface or {"R": R}).checked()


def full(law, kin, state, function=cauchy_stress):
    return symmetric_matrix(kin, function(law, kin, state))


def pulled(law, steps=6, end=0.02):
    """Stress and logarithmic strain of a thin sheet that is pulled along x without stress else."""
    state, strain = initial_state(law, SPACE, 1.0), np.zeros((3, 3))
    free = [(1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    guess = np.zeros(5)

    def step(x):
        dl = np.zeros((3, 3))
        dl[0, 0] = end / steps
        for (i, j), value in zip(free, x, strict=True):
            dl[i, j] = dl[j, i] = value
        new = advance(law, SPACE, state, flat(SPACE, dl), 1.0)
        s = full(law, SPACE, new)
        return new, dl, np.array([s[place] for place in free])

    for _ in range(steps):
        for _ in range(30):
            r = step(guess)[2]
            if abs(r).max() < 1e-7 * Y:
                break
            slopes = [(step(guess + 1e-9 * unit)[2] - r) / 1e-9 for unit in np.eye(5)]
            guess = guess + np.clip(np.linalg.solve(np.array(slopes).T, -r), -1e-3, 1e-3)
        state, dl, _ = step(guess)
        strain += dl
    return full(law, SPACE, state)[0, 0], strain, state


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_yield_stress_and_r_value_against_the_angle(angle):
    """Y(a), R(a) of Hill (1948): Y^2/Y(a)^2 = F s^4 + G c^4 + H (c^2 - s^2)^2 + 2 N s^2 c^2."""
    stress, strain, _ = pulled(sheet(-angle), steps=1, end=0.004)
    F, G, H, _, _, N = of_lankford(R)
    c, s = cos(radians(angle)), sin(radians(angle))
    factor = F * s**4 + G * c**4 + H * (c * c - s * s) ** 2 + 2 * N * s * s * c * c
    assert stress == pytest.approx(Y / sqrt(factor), rel=2e-3)
    elastic = Y / sqrt(factor) / E
    across, through = strain[1, 1] + NU * elastic, strain[2, 2] + NU * elastic
    ratio = (H + (2 * N - F - G - 4 * H) * s * s * c * c) / (F * s * s + G * c * c)
    assert across / through == pytest.approx(ratio, rel=1e-2)
    if angle in (0, 45, 90):
        assert ratio == pytest.approx(R[(0, 45, 90).index(angle)])


def trace_of(dl):
    """Mean of the diagonal, 0 where there is only one component."""
    diagonal = [dl.at()[i, i] for i in dl.axes]
    return sum(diagonal) / len(diagonal) if len(diagonal) > 1 else 0


@pytest.mark.parametrize("H", [0.0, 2e9])
@every_kinematics
def test_equal_directions_are_von_mises(kin, H):
    """The stress and plastic strain of eos-strength, linear and plastic, for any small step."""
    strength = LinearHardening(STEEL.G, Y, H).checked()
    hill = sheet(20, 30, 40, strength=strength, yields=(1, 1, 1, 1, 1, 1))
    bulk = STEEL.lam + 2 / 3 * STEEL.G
    mises = EosStrength(LinearPressure(1 / 7850, bulk), strength)
    random = np.random.default_rng(5)
    states = [initial_state(law, kin, 1.0) for law in (hill, mises)]
    for _ in range(3):
        a = random.normal(0, 1e-3, (3, 3))
        dl = flat(kin, 0.5e-2 * (a + a.T))
        dl = dl - trace_of(dl) * I  # flow at constant volume
        for _ in range(400):
            states = [
                advance(law, kin, s, dl, 1.0) for law, s in zip((hill, mises), states, strict=True)
            ]
    s, t = (full(law, kin, one) for law, one in zip((hill, mises), states, strict=True))
    assert plastic_strain(hill, kin, states[0]) > 1e-3
    # They differ by the volume: Kirchhoff and Cauchy stress, ln J and J - 1.
    assert np.allclose(s, t, rtol=6e-3, atol=1e-3 * Y)
    strains = [
        plastic_strain(law, kin, one) for law, one in zip((hill, mises), states, strict=True)
    ]
    assert strains[0] == pytest.approx(strains[1], rel=5e-3)


@pytest.mark.parametrize("elastic", [STEEL, SPRUCE.checked()], ids=["steel", "spruce"])
def test_stress_returns_to_the_surface_in_steps_of_any_size(elastic):
    """q = Y + H ep, the plastic work is q dep, and energy is conserved in an elastic step."""
    strength = LinearHardening(STEEL.G, Y, 3e9)
    law = sheet(25, 10, -40, elastic=elastic, strength=strength)
    random = np.random.default_rng(2)
    for size in (1e-4, 1e-2, 0.2):
        dl = random.normal(0, size, (3, 3))
        state = advance(law, SPACE, initial_state(law, SPACE, 1.0), flat(SPACE, dl), 1.0)
        z = np.array(law[9:45]).reshape(6, 6) @ (
            np.array([1, 1, 1, sqrt(2), sqrt(2), sqrt(2)]) * np.array(state.e)[[0, 1, 2, 5, 4, 3]]
        )
        q, ep = sqrt(np.array(law[3:9]) @ z**2), plastic_strain(law, SPACE, state)
        assert (ep > 0) == (size > 1e-3)
        assert q == pytest.approx(Y + 3e9 * ep, rel=1e-9) if ep else q <= Y
        assert dissipated_energy(law, SPACE, state) == pytest.approx(q * ep)
        assert energy_density(law, SPACE, state) == pytest.approx(0.5 * z @ z)
        # plastic flow keeps the volume
        assert sum(state.e[:3]) == pytest.approx(np.log(np.linalg.det(np.eye(3) + dl)), rel=1e-9)


def test_rotations_of_any_size_cause_no_stress():
    """F to Q(t) F: tau to Q tau Q^T, whatever the path of Q between steps."""
    law, random = sheet(10, 20, 30), np.random.default_rng(8)
    state = turned = initial_state(law, SPACE, 1.0)
    before = np.eye(3)
    for _ in range(5):
        dl = random.normal(0, 3e-3, (3, 3))
        Q = rotation(random.normal(0, 1, 3))
        step = Q @ (np.eye(3) + dl) @ before.T - np.eye(3)
        state = advance(law, SPACE, state, flat(SPACE, dl), 1.0)
        turned, before = advance(law, SPACE, turned, flat(SPACE, step), 1.0), Q
    s, t = (full(law, SPACE, one, kirchhoff_stress) for one in (state, turned))
    assert plastic_strain(law, SPACE, state) > 0
    assert np.allclose(t, before @ s @ before.T, rtol=0, atol=1e-9 * Y)
    assert energy_density(law, SPACE, turned) == pytest.approx(energy_density(law, SPACE, state))


def test_hardening_follows_the_strength():
    """Pull along the rolling direction to 30 %: sigma = A + B ep^n of Ludwik (1909)."""
    strength = Swift(STEEL.G, 200e6, 400e6, 0.0, 0.4)
    stress, _, state = pulled(sheet(strength=strength), steps=12, end=0.3)
    ep = plastic_strain(sheet(strength=strength), SPACE, state)
    assert stress == pytest.approx(200e6 + 400e6 * ep**0.4, rel=3e-3)
    assert ep == pytest.approx(12 * log(1.025) - stress / E, rel=1e-3)


def test_a_stress_is_taken_back():
    law, kin = sheet(15, elastic=SPRUCE.checked()), PlaneStrain()
    stress = kin.Symmetric._make([1e7, -2e7, 3e6, 4e6])
    state = with_stress(law, kin, initial_state(law, kin, 1.0), stress)
    assert np.allclose(cauchy_stress(law, kin, state), stress, rtol=1e-9)


MATERIAL = """
    material(elastic, linear, 7850, 200e9, 0.3)
    strength(hard, plastic, 77e9, 300e6, 1e9)
    material(sheet, hill, elastic, hard, 30, R=(1.8, 1.2, 2.3))
"""


def test_a_sheet_in_plane_stress(run_interpreted):
    """element: pulled at an angle to the rolling direction, in a plane, without stress else."""
    folder = run_interpreted(
        MATERIAL
        + """
        load_path(pull, 30, exx=0.01, syy=0, sxy=0)
        element(strip, sheet, pull, kinematics=plane-stress)
    """
    ).folder
    t = read_log(folder / "element_strip.txt")
    F, G, H, _, _, N = of_lankford(R)
    c, s = cos(radians(30)), sin(radians(30))
    factor = sqrt(F * s**4 + G * c**4 + H * (c * c - s * s) ** 2 + 2 * N * s * s * c * c)
    # The work of ep against the flow stress is that of the plastic strain along the pull.
    assert t.sxx[-1] == pytest.approx((300e6 + 1e9 * t.ep[-1]) / factor, rel=1e-3)
    assert t.ep[-1] == pytest.approx((0.01 - t.sxx[-1] / 200e9) / factor, rel=5e-3)
    ratio = (H + (2 * N - F - G - 4 * H) * s * s * c * c) / (F * s * s + G * c * c)
    elastic = 0.3 * t.sxx[-1] / 200e9
    assert (t.eyy[-1] + elastic) / (t.ezz[-1] + elastic) == pytest.approx(ratio, rel=2e-2)
    assert t.work[-1] == pytest.approx(t.stored[-1] + t.dissipated[-1], rel=0.02)


DISK = f"""
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.5)
    plane_stress(true)
    region(box, block, 0, 1, 0, 1)
    {MATERIAL}
    solid(s, region, box, 2, sheet, 0.5, 0)
    group(s, particles, region, box, solid, s)
    fix(v, initial_velocity_particles, s, 90*x, -60*y + 30*x)
    set_dt(1e-5)
    compute(Es, strain_energy, s)
    compute(Ed, dissipated_energy, s)
    log_modify(custom, Es, Ed)
    log(5)
    run(10)
"""


def test_compiled_lanes_are_the_point_function(run_script, run_interpreted):
    lanes_are_the_point_function(run_script, run_interpreted, DISK)


def test_axes_that_lean_out_of_the_plane_are_reported(run_interpreted):
    leaning_is_reported(run_interpreted, DISK, "hard, 30, R", "hard, 30, 40, R")


def test_axes_by_formulas_of_place(state_interpreted):
    """A sheet with angle 30, and axes of 30 degrees by a formula and by vectors."""
    names, found = ("s11", "s22", "s12", "ep"), []
    for axes in ("30", "axes=(30 + 0*x0)", "axes=(cos(PI/6), 0.5, 0, -0.5, cos(PI/6), 0)"):
        script = DISK.replace("hard, 30, R", f"hard, {axes}, R").replace("run(10)", "run(4)")
        script = script.replace("90*x, -60*y + 30*x", "9000*x, -6000*y + 3000*x")
        found.append(state_interpreted(script, *names))
    assert found[0]["ep"].max() > 0.01
    for name in names:
        for one in found[1:]:
            # The bound of the wave speed, where the stress across is sought from, depends on axes.
            size = abs(found[0][name]).max()
            assert np.allclose(one[name], found[0][name], rtol=0, atol=2e-3 * size)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("elastic, hard, R=(1, 1, 1), axes=(1, 0, 0, 2, 0, 0)", "parallel or zero"),
        ("elastic, hard", "either R-values or yield stresses"),
        ("elastic, hard, R=(1, 1)", "R-values (R0, R45, R90)"),
        ("elastic, hard, R=(1, -1, 1)", "all above 0"),
        ("elastic, hard, yields=(0.4, 1, 1, 1, 1, 1)", "some shear would never yield"),
        ("elastic, free, R=(1, 1, 1)", "no yield stress"),
        ("rubber, hard, R=(1, 1, 1)", "no constant stiffness"),
    ],
)
def test_surfaces_that_no_sheet_has(run_interpreted, line, says):
    head = MATERIAL + "strength(free, linear, 1)\nmaterial(rubber, yeoh, 1, 1e3, 1, 1)\n"
    assert says in run_interpreted(f"{head}material(m, hill, {line})\n", status=1).err


def rock(angle):
    return JointedConstants(2700, E, NU, 1e6, 10.0, angle, 90.0, psi=5.0).checked()


@pytest.mark.parametrize(
    "law",
    [sheet(20), rock(35.0), rock(75.0)],
    ids=["hill", "slip", "opening"],
)
def test_slopes_are_the_tangent_of_a_step_with_flow(law):
    """Load steps: stress by each component of grad v, beside central differences."""
    kin, size = PlaneStrain(), 2e-3
    start = with_stress(law, kin, initial_state(law, kin, 1.0), kin.Symmetric(0.0, -1e6, 0.0, 0.0))
    step = [size * x for x in (1.0, 1.5, 0.2, -1.4)]

    def stress(dl):
        new = on_numbers(advance)(law, kin, start, kin.Tensor._make(dl), 1.0)
        return on_numbers(cauchy_stress)(law, kin, new), new

    made, _ = stress([Dual(x, tuple(float(j == k) for j in range(4))) for k, x in enumerate(step)])
    assert dissipated_energy(law, kin, stress(step)[1]) > 0
    for k in range(4):
        low, high = ([x + sign * 1e-7 * (j == k) for j, x in enumerate(step)] for sign in (-1, 1))
        exact = (np.array(stress(high)[0]) - np.array(stress(low)[0])) / 2e-7
        slopes = [one.slopes[k] for one in made]
        assert np.allclose(slopes, exact, rtol=1e-5, atol=1e-5 * E)
