"""Flow stresses of metals by other laws than Johnson's, and of grains: against closed forms."""

from math import exp, log, sqrt

import numpy as np
import pytest
from laws import isochoric, mises, pressure_of, start, stress, stretched
from tensors import every_kinematics, flat

from comparisons.results import read_log
from karamelo_py.compiler import kernel
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.laws import law_in, law_on, law_table
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space
from karamelo_py.points.laws import advance, columns_of, dissipated_energy, plastic_strain, shown
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.formulas import with_numbers
from karamelo_py.points.laws.strengths.curves import FlowStress, Tabulated
from karamelo_py.points.laws.strengths.metals import ZerilliArmstrong
from karamelo_py.points.laws.strengths.mu_i import MuI
from karamelo_py.points.laws.temperatures import PlasticWork

RHO, K, G = 8.0, 160.0, 80.0
EOS = LinearPressure(1 / RHO, K)
HEAT = PlasticWork(0.0, 0.5, 0.0, 0.0, 400.0, 2000.0)  # 400 K, and no work becomes heat


# ---- Zerilli and Armstrong ----------------------------------------------------------------------

# Constants of their paper for OFHC copper (fcc) and Armco iron (bcc), in GPa.
COPPER = ZerilliArmstrong(G, 0.065, 0, 0.89, 0.0028, 0.000115, 0, 1)
IRON = ZerilliArmstrong(G, 0.065, 1.033, 0, 0.00698, 0.000415, 0.266, 0.289)


def published(strength, ep, rate, T):
    """Zerilli & Armstrong 1987, equations for fcc and for bcc metals."""
    s = strength
    if s.C1 == 0:
        return s.C0 + s.C2 * sqrt(ep) * exp(-s.C3 * T + s.C4 * T * log(rate))
    return s.C0 + s.C1 * exp(-s.C3 * T + s.C4 * T * log(rate)) + s.C5 * ep**s.n


@every_kinematics
@pytest.mark.parametrize("strength", [COPPER, IRON], ids=["fcc", "bcc"])
@pytest.mark.parametrize("heat", [False, True])
@pytest.mark.parametrize("steps", [1, 20])
def test_zerilli_armstrong(strength, kin, heat, steps):
    """q = Y(ep, rate, T) after increments of any size, T that of the material or as given."""
    law = EosStrength(EOS, strength, temperature=HEAT) if heat else EosStrength(EOS, strength)
    e, dt = -0.2 / steps, 1e-3 / steps
    before = stretched(law, kin, start(law, kin), np.diag([e, 0, 0]), steps - 1, dt)
    state = stretched(law, kin, before, np.diag([e, 0, 0]), 1, dt)
    ep = plastic_strain(law, kin, state)
    rate = (ep - plastic_strain(law, kin, before)) / dt
    assert rate > 50
    expected = published(strength, ep, rate, 400.0 if heat else 293.0)
    assert mises(law, kin, state) == pytest.approx(expected, rel=1e-9)


def test_zerilli_armstrong_takes_the_temperature_of_the_solid():
    """As lowering tells laws of it, where the material has no temperature of its own."""
    law = law_on(EosStrength(EOS, COPPER), 1.0, 500.0)
    state = stretched(law, Space(), start(law, Space()), isochoric(0.1), 1, 1e-3)
    ep = plastic_strain(law, Space(), state)
    assert mises(law, Space(), state) == pytest.approx(published(COPPER, ep, ep / 1e-3, 500.0))


# ---- curves -------------------------------------------------------------------------------------

POINTS = [(0.0, 0.4), (0.01, 0.5), (0.1, 0.6), (0.3, 0.55)]


@every_kinematics
@pytest.mark.parametrize("steps", [1, 7, 300])
@pytest.mark.parametrize("end", [0.02, 0.3, 0.8])
def test_tabulated_is_on_the_curve(kin, steps, end):
    """q = Y(ep) and q + 3 G ep is what it were without yield, also beyond kinks and the end."""
    law = EosStrength(EOS, Tabulated.given(G, *np.ravel(POINTS)))
    state = stretched(law, kin, start(law, kin), np.diag([-end / steps, 0, 0]), steps)
    ep, q = plastic_strain(law, kin, state), mises(law, kin, state)
    assert q == pytest.approx(np.interp(ep, *np.transpose(POINTS)), rel=1e-12)
    assert q + 3 * G * ep == pytest.approx(2 * G * end, rel=1e-12)


def test_curves_of_different_lengths_share_a_table():
    one, other = (Tabulated.given(G, *np.ravel(p)) for p in (POINTS, POINTS[:2]))
    table = law_table([one, other], np.float32)
    assert table.strain.shape == (2, 4)
    assert table.strain.dtype == np.float32
    np.testing.assert_array_equal(table.stress[1], np.float32([0.4, 0.5, 0.5, 0.5]))
    np.testing.assert_array_equal(table.count, [4, 2])
    np.testing.assert_array_equal(law_in(other, np.float64).strain, [0, 0.01])


PULL = """
eos(bulk, linear, 8, 160)
strength(s, {})
material(m, eos-strength, bulk, s)
load_path(pull, 40, exx=0.2, syy=0, szz=0, duration=1e-3)
element(end, m, pull)
"""


def pulled(run_interpreted, script, folder="run"):
    """Plastic strain and von Mises stress at the end of a tension test of 200/s."""
    result = run_interpreted(script, folder=folder)
    table = read_log(result.folder / "element_end.txt")
    return table.ep[-1], table.q[-1]


def test_a_curve_from_a_file(run_interpreted, tmp_path):
    text = "# strain, stress\n0,0.4\t# 20 C; 1/s\n0.01 0.5\n0.1, 0.6\n0.3 0.55\n"
    (tmp_path / "curve.txt").write_text(text)
    by_file = pulled(run_interpreted, PULL.format(f'tabulated, 80, "{tmp_path}/curve.txt"'), "file")
    curve = ", ".join(str(value) for value in np.ravel(POINTS))
    assert by_file == pulled(run_interpreted, PULL.format(f"tabulated, 80, {curve}"))
    assert by_file[1] == pytest.approx(np.interp(by_file[0], *np.transpose(POINTS)), rel=1e-5)


@pytest.mark.parametrize(
    ("curve", "message"),
    [
        ("0.1, 0.4", "does not begin"),
        ("0, 0.4, 0.1", "pairs of numbers"),
        ("0, 0.4, 0, 0.5", "do not rise"),
        ("0, 0.4, 0.1, -1", "not above 0"),
        ("0, 40, 0.1, 1", "falls by more"),
        ("missing.txt", "does not exist"),
    ],
)
def test_curves_that_are_refused(run_interpreted, curve, message):
    result = run_interpreted(PULL.format(f"tabulated, 80, {curve}"), status=1)
    assert message in result.err


# ---- formulas -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "formula"),
    [
        ("plastic, 80, 0.4, 0.5", "0.4 + 0.5*ep"),
        ("swift, 80, 0.4, 0.5, 0.01, 0.5", "0.4 + 0.5*sqrt(max(ep - 0.01, 0))"),
        ("johnson_cook, 80, 0.4, 0.3, 0.3, 1, 0.05, 1.1, 300, 1300",
         "(0.4 + 0.3*ep^0.3)*(1 + 0.05*log(max(epdot, 1)))*(1 - (max(T - 300, 0)/1000)^1.1)"),
        (f"tabulated, 80, {', '.join(str(v) for v in np.ravel(POINTS))}",
         "if(ep < 0.01, 0.4 + 10*ep, if(ep < 0.1, 0.5 + (ep - 0.01)*10/9, 0.6 - (ep - 0.1)/4))"),
    ],
    ids=["hardening", "swift", "johnson-cook", "curve"],
)  # fmt: skip
def test_a_formula_is_what_it_says(run_interpreted, law, formula):
    """The same numbers as by the law that is built in, with heat of plastic work."""
    warm = """temperature(warm, plastic_work, 0.9, 0.005, 0, 0, 400, 1300)
material(w, eos-strength, bulk, s, warm)
element(end, w, pull)"""
    text = PULL.replace("element(end, m, pull)", warm)
    expected = pulled(run_interpreted, text.format(law), "law")
    assert expected[0] > 0.1
    found = pulled(run_interpreted, text.format(f"formula, 80, {formula}"), "formula")
    assert found == pytest.approx(expected, rel=1e-6)


def test_names_in_a_formula_are_its_own(run_interpreted):
    """T and ep may be variables of the script, and constants take part."""
    strength = "formula, 80, Y0 + H*ep"
    text = PULL.replace("eos(", "T = 1e-3\nep = 7\nY0 = 0.4\nH = 0.5\neos(")
    ep, q = pulled(run_interpreted, text.format(strength))
    assert q == pytest.approx(0.4 + 0.5 * ep, rel=1e-5)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("0.4 + x", "cannot depend on x"),
        ("0.4*log(epdot)*ep", "the flow stress is"),
        ("ep - 1", "not above 0"),
        ("0.4*eq", "unknown name 'eq'"),
        ("0.4*epp", "expected: one of ep, epdot, T, p, J, or a number that the script has set"),
        ("0.4*ep_dot", "did you mean 'epdot'?"),
        ('"linear"', "unknown name 'linear'"),
        ('"k*ep - 1", k=1', "not above 0"),
        ("0.4 + atan(ep)", "atan is not possible in a law"),
    ],
)
def test_formulas_that_are_refused(run_interpreted, formula, message):
    result = run_interpreted(PULL.format(f"formula, 80, {formula}"), status=1)
    assert message in result.err
    assert "^" in result.err  # the word is marked


# ---- grains -------------------------------------------------------------------------------------

GRAINS = MuI(4e5, 0.382, 0.643, 0.279, 0.5e-3, 2450.0)
SAND = EosStrength(LinearPressure(1 / 1500, 1e6), GRAINS)


def friction(inertial):
    """Jop, Forterre & Pouliquen 2006."""
    return GRAINS.mu_s + (GRAINS.mu_2 - GRAINS.mu_s) / (GRAINS.I0 / inertial + 1)


@pytest.mark.parametrize("kin", [PlaneStrain(), Space()], ids=["plane", "space"])
@pytest.mark.parametrize("rate", [1e-3, 1.0, 100.0, 1e5])
def test_steady_shear_has_the_friction_of_its_rate(kin, rate):
    """tau = mu(I) p with I = rate d sqrt(rho_s/p), whatever the step."""
    state = start(SAND, kin)
    state = stretched(SAND, kin, state, np.diag([-1e-3, 0, 0]), 1)  # p = 1 kPa
    shear = np.zeros((3, 3))
    shear[0, 1] = 0.02
    state = stretched(SAND, kin, state, shear, 300, 0.02 / rate)
    p = pressure_of(SAND, kin, state)
    assert p == pytest.approx(1000, rel=1e-9)
    inertial = rate * GRAINS.d * sqrt(GRAINS.rho_s / p)
    # Stress turns with the shear, and goes on doing so: (tau/G)^2 of the shear is elastic.
    found = shown(columns_of(SAND)["inertial"], SAND, kin, state)
    assert found == pytest.approx(inertial, rel=1e-4)
    tau = mises(SAND, kin, state) / sqrt(3)
    assert tau == pytest.approx(friction(inertial) * p, rel=1e-4)
    # It turns with the shear, by tau/G at most.
    assert stress(SAND, kin, state)[0, 1] == pytest.approx(tau, rel=1e-3)


def test_shear_work_is_dissipated():
    """In steady flow tau times the shear, per volume; ep is the shear over sqrt(3)."""
    kin, dt = PlaneStrain(), 1e-3
    state = stretched(SAND, kin, start(SAND, kin), np.diag([-1e-3, 0, 0]), 1)
    shear = np.zeros((3, 3))
    shear[0, 1] = 0.01
    state = stretched(SAND, kin, state, shear, 200, dt)
    before, ep = dissipated_energy(SAND, kin, state), plastic_strain(SAND, kin, state)
    state = stretched(SAND, kin, state, shear, 100, dt)
    tau = mises(SAND, kin, state) / sqrt(3)
    work = dissipated_energy(SAND, kin, state) - before
    assert work == pytest.approx(tau * 1.0 * state.J, rel=1e-3)
    assert plastic_strain(SAND, kin, state) - ep == pytest.approx(1 / sqrt(3), rel=1e-5)


def test_grains_that_are_apart_bear_nothing_and_meet_again():
    kin = Axisymmetric()
    state = stretched(SAND, kin, start(SAND, kin), np.diag([0.2, 0, 0]), 10)
    assert np.all(stress(SAND, kin, state) == 0)
    there = stretched(SAND, kin, state, np.diag([1 / state.J - 1, 0, 0]), 1)
    assert pressure_of(SAND, kin, there) == pytest.approx(0, abs=1e-6)
    pressed = stretched(SAND, kin, there, np.diag([-1e-3, 0, 0]), 1)
    assert pressure_of(SAND, kin, pressed) == pytest.approx(1000, rel=1e-6)


def test_below_slow_friction_grains_hold():
    kin = Space()
    state = stretched(SAND, kin, start(SAND, kin), -1e-3 * np.eye(3) / 3, 1)
    shear = np.zeros((3, 3))
    shear[0, 1] = 0.9 * GRAINS.mu_s * 1000 / GRAINS.G
    state = stretched(SAND, kin, state, shear, 1)
    assert plastic_strain(SAND, kin, state) == 0
    assert stress(SAND, kin, state)[0, 1] == pytest.approx(0.9 * GRAINS.mu_s * 1000, rel=1e-2)


# ---- compiled -----------------------------------------------------------------------------------


def test_compiled_laws_give_the_same_numbers():
    """One kernel for all of them: rows of numbers, the stack of a formula, roots and powers."""
    formula = FlowStress.given(G, with_numbers("0.4 + sqrt(ep)"))
    strengths = COPPER, Tabulated.given(G, *np.ravel(POINTS)), formula
    laws = [*(EosStrength(EOS, strength) for strength in strengths), SAND]
    shear = flat(Space(), np.array([[-1e-3, 0.02, 0], [0, 0, 0], [0, 0, 0]]))
    tables = tuple(law_table([law], np.float64) for law in laws)
    states = tuple(start(law, Space()) for law in laws)
    found = _advanced(tables, states, shear)
    for law, state, result in zip(laws, states, found, strict=True):
        assert result == pytest.approx(advance(law, Space(), state, shear, 1e-3), rel=1e-12)


@kernel
def _advanced(tables, states, dl):
    return (
        advance(record(tables[0], 0), Space(), states[0], dl, 1e-3),
        advance(record(tables[1], 0), Space(), states[1], dl, 1e-3),
        advance(record(tables[2], 0), Space(), states[2], dl, 1e-3),
        advance(record(tables[3], 0), Space(), states[3], dl, 1e-3),
    )


def test_a_scene_of_a_formula_and_curves(run_interpreted):
    """In single precision, with a table of curves of different lengths: all say the same line."""
    laws = {
        "f": "formula, 80, 0.4 + 0.5*ep",
        "t": "tabulated, 80, 0, 0.4, 1, 0.9",
        "u": "tabulated, 80, 0, 0.4, 0.5, 0.65, 1, 0.9",
        "p": "plastic, 80, 0.4, 0.5",
    }
    lines = ["precision(single)", "method(ulmpm, FLIP, linear, 1)",
             "dimension(2, 0, 0.5, 0, 0.3, 0.1)", "eos(bulk, linear, 8, 160)"]  # fmt: skip
    for k, (name, law) in enumerate(laws.items()):
        lines += [
            f"region({name}, block, 0.1*{k}, 0.1*{k + 1}, 0.1, 0.2)",
            f"strength({name}, {law})",
            f"material({name}, eos-strength, bulk, {name})",
            f"solid({name}, region, {name}, 1, {name}, 0.1)",
        ]
    lines += [
        "region(everywhere, block, INF, INF, INF, INF)",
        "group(nodes, nodes, region, everywhere, all)",
        "fix(pull, velocity_nodes, nodes, x0, 0)",
        "dump(end, all, particle, 1000, end.*.LAMMPS, ep, s11)",
        "set_dt(0.001)",
        "run(20)",
    ]
    end = run_interpreted("\n".join(lines)).dump("end.20.LAMMPS")
    assert end.ep[0] > 0.005
    assert end.ep == pytest.approx(end.ep[3], rel=1e-5)
    assert end.s11 == pytest.approx(end.s11[3], rel=1e-5)
