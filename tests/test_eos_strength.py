"""Laws of an equation of state and a strength: one point against closed forms, and in scripts."""

import re
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tensors import (
    ALL_KINEMATICS,
    every_kinematics,
    flat,
    symmetric_flat,
    symmetric_matrix,
    symmetric_tensors,
)

from karamelo_py.app.cli import main
from karamelo_py.compiler import real, tuples
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.laws import law_in, law_table
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space, tr, von_mises
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    law_kind,
    plastic_strain,
    specific_volume,
    wave_speed_squared,
    with_stress,
)
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.further import chained, initial_part, part_after, part_pressure
from karamelo_py.points.laws.strengths.hardening import Plastic
from karamelo_py.points.laws.strengths.linear import Elastic
from karamelo_py.scene.material import MaterialPart
from karamelo_py.script.values import Values

RHO, K, G, Y = 2.0, 160.0, 80.0, 0.4
ELASTIC = EosStrength(LinearPressure(1 / RHO, K), Elastic(G))
YIELDING = EosStrength(LinearPressure(1 / RHO, K), Plastic(G, Y))
every_law = pytest.mark.parametrize("law", [ELASTIC, YIELDING], ids=["elastic", "yielding"])


def after(law, kin, state, full, steps):
    """The state after `steps` equal increments, a (3, 3) velocity gradient times dt."""
    for _ in range(steps):
        state = advance(law, kin, state, flat(kin, np.asarray(full)), 1.0)
    return state


def deviatoric(kin, stress):
    full = symmetric_matrix(kin, stress)
    return full - np.trace(full) / 3 * np.eye(3)


def mises(kin, stress):
    s = deviatoric(kin, stress)
    return np.sqrt(1.5 * np.sum(s * s))


@every_kinematics
@every_law
def test_at_rest(law, kin):
    """No stress, no energy; longitudinal waves at sqrt((K + 4/3 G)/rho)."""
    state = initial_state(law, kin, 1.0)
    nothing = pytest.approx((0.0,) * len(kin.symmetric_names))
    assert cauchy_stress(law, kin, state) == nothing
    assert elastic_strain(law, kin, state) == nothing
    assert energy_density(law, kin, state) == plastic_strain(law, kin, state) == 0
    assert jacobian(law, kin, state) == 1
    assert wave_speed_squared(law, kin, state) == pytest.approx((K + 4 / 3 * G) / RHO)
    assert specific_volume(law) == 1 / RHO


@every_kinematics
def test_uniaxial_strain(kin):
    """Axial stress rises with K + 4/3 G up to the yield, then with K; |s_xx - s_yy| = Y there.

    Yield is at 2 G e = Y, e the sum of the increments, and the plastic strain is 2/3 of what
    exceeds it: closed forms of the incremental law, exact but for round-off. Pressure is K (1 - J).
    """
    steps, e, axial = 40, -1e-4, []
    state, at_yield = initial_state(YIELDING, kin, 1.0), Y / (2 * G)
    for n in range(1, steps + 1):
        state = after(YIELDING, kin, state, np.diag([e, 0, 0]), 1)
        stress, strain = cauchy_stress(YIELDING, kin, state), n * abs(e)
        axial.append(stress[0])
        shear = -min(4 / 3 * G * strain, 2 / 3 * Y)
        j = (1 + e) ** n
        assert stress[0] == pytest.approx(shear - K * (1 - j), rel=1e-10)
        assert abs(stress[0] - stress[1]) == pytest.approx(min(2 * G * strain, Y), rel=1e-10)
        ep = plastic_strain(YIELDING, kin, state)
        assert ep == pytest.approx(2 / 3 * max(strain - at_yield, 0), abs=1e-15)
    assert ep > 0.9e-3
    # J falls below 1 by 0.004 on the way: as much as that the slopes are off.
    assert (axial[10] - axial[0]) / (10 * e) == pytest.approx(K + 4 / 3 * G, rel=4e-3)
    assert (axial[39] - axial[29]) / (10 * e) == pytest.approx(K, rel=4e-3)


@every_kinematics
def test_unloading_is_elastic_until_yield_the_other_way(kin):
    """Back by 2 Y / (2 G) of strain the point yields again; before that nothing plastic happens."""
    e = 1e-4
    state = after(YIELDING, kin, initial_state(YIELDING, kin, 1.0), np.diag([e, 0, 0]), 60)
    loaded = plastic_strain(YIELDING, kin, state)
    top = cauchy_stress(YIELDING, kin, state)
    back = after(YIELDING, kin, state, np.diag([-e, 0, 0]), 49)  # Y/G = 50 e
    assert plastic_strain(YIELDING, kin, back) == loaded
    found = cauchy_stress(YIELDING, kin, back)
    pressure = K * (jacobian(YIELDING, kin, state) - jacobian(YIELDING, kin, back))
    assert top[0] - found[0] == pytest.approx(4 / 3 * G * 49 * e + pressure, rel=1e-10)
    assert found[0] - found[1] == pytest.approx(Y - 2 * G * 49 * e, rel=1e-9)
    further = after(YIELDING, kin, back, np.diag([-e, 0, 0]), 11)
    assert plastic_strain(YIELDING, kin, further) == pytest.approx(loaded + 2 / 3 * 10 * e)


@pytest.mark.parametrize("kin", ALL_KINEMATICS[1:], ids=lambda kin: type(kin).__name__)
def test_simple_shear_yields_at_the_root_of_a_third(kin):
    """s_xy = G gamma up to Y/sqrt(3), then constant; ep = (gamma - gamma_y)/sqrt(3).

    The turn of the stress adds normal stresses of Y gamma, 1e-3 of Y: their squares are left out.
    """
    law = EosStrength(LinearPressure(1 / RHO, K), Plastic(G, 1e-3 * G))
    g, state = 1e-5, initial_state(law, kin, 1.0)
    shear = np.zeros((3, 3))
    shear[0, 1] = g
    elastic = after(law, kin, state, shear, 50)
    assert cauchy_stress(law, kin, elastic)[3] == pytest.approx(50 * G * g, rel=1e-5)
    assert plastic_strain(law, kin, elastic) == 0
    plastic = after(law, kin, elastic, shear, 50)
    assert cauchy_stress(law, kin, plastic)[3] == pytest.approx(1e-3 * G / np.sqrt(3), rel=1e-5)
    assert mises(kin, cauchy_stress(law, kin, plastic)) == pytest.approx(1e-3 * G, rel=1e-12)
    at_yield = 1e-3 / np.sqrt(3)
    expected = (100 * g - at_yield) / np.sqrt(3)
    assert plastic_strain(law, kin, plastic) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("kin", [PlaneStrain(), Axisymmetric(), Space()])
def test_a_plastic_point_turns_with_its_stress(kin):
    """A right angle in 200 increments: the deviator turns, and no plastic strain comes of it.

    The increments I + w swell the volume by 1 + w^2, which pressure follows: K (1 - J).
    """
    steps = 200
    loading = np.diag([3e-3, 1e-3, -2e-3]) + 1e-3 * (np.eye(3, k=1) + np.eye(3, k=-1))
    state = after(YIELDING, kin, initial_state(YIELDING, kin, 1.0), loading, 5)
    before = deviatoric(kin, cauchy_stress(YIELDING, kin, state))
    # A whisker inside the yield surface, where rounding cannot push it out.
    state = state._replace(s=0.999999 * state.s)
    w = np.zeros((3, 3))
    w[1, 0] = np.pi / 2 / steps
    w -= w.T
    turned = after(YIELDING, kin, state, w, steps)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    stress = cauchy_stress(YIELDING, kin, turned)
    assert deviatoric(kin, stress) == pytest.approx(quarter @ before @ quarter.T, abs=1e-6)
    assert plastic_strain(YIELDING, kin, turned) == state.m.strength.ep > 0
    assert -tr(stress) / 3 == pytest.approx(K * (1 - jacobian(YIELDING, kin, turned)))


@every_kinematics
def test_work_is_stored_or_dissipated(kin):
    """Work = stored energy + Y ep; a strain of 0.005 leaves as much of it out (J)."""
    e, steps = 1e-5, 500
    state, work = initial_state(YIELDING, kin, 1.0), 0.0
    dl = np.diag([e, 0, 0])
    for _ in range(steps):
        before = kirchhoff_stress(YIELDING, kin, state)[0]
        state = after(YIELDING, kin, state, dl, 1)
        work += e * (before + kirchhoff_stress(YIELDING, kin, state)[0]) / 2
    stored = energy_density(YIELDING, kin, state)
    assert stored == pytest.approx(K * (steps * e) ** 2 / 2 + Y**2 / (6 * G), rel=6e-3)
    assert work == pytest.approx(stored + Y * plastic_strain(YIELDING, kin, state), rel=1e-2)


@every_kinematics
@every_law
@given(data=st.data())
def test_imposed_stress(law, kin, data):
    """The stress that is set is the stress there is; energy and strain are those of Hooke's law.

    Strains of 1/100 and less: J = 1 - p/K and ln J differ from 1 and -p/K by that.
    """
    stress = data.draw(symmetric_tensors(kin))
    state = with_stress(law, kin, initial_state(law, kin, 1.0), stress)
    assert cauchy_stress(law, kin, state) == pytest.approx(stress, abs=1e-12)
    full = symmetric_matrix(kin, stress)
    p, s = -np.trace(full) / 3, deviatoric(kin, stress)
    j = 1 - p / K
    assert jacobian(law, kin, state) == pytest.approx(j)
    assert kirchhoff_stress(law, kin, state) == pytest.approx(
        tuple(j * a for a in stress), abs=1e-12
    )
    energy = p * p / (2 * K) + j * np.sum(s * s) / (4 * G)
    assert energy_density(law, kin, state) == pytest.approx(energy, abs=1e-13)
    strain = symmetric_flat(kin, s / (2 * G) + np.log(j) / 3 * np.eye(3))
    assert elastic_strain(law, kin, state) == pytest.approx(strain, abs=1e-14)


@every_kinematics
def test_speed_is_the_slope_of_the_stress(kin):
    """rho c^2 = d(sigma_xx)/de along x, at any compression, while the point is elastic."""
    state = after(ELASTIC, kin, initial_state(ELASTIC, kin, 1.0), np.diag([-0.01, 0, 0]), 10)
    e = 1e-6
    ahead = cauchy_stress(ELASTIC, kin, after(ELASTIC, kin, state, np.diag([e, 0, 0]), 1))[0]
    back = cauchy_stress(ELASTIC, kin, after(ELASTIC, kin, state, np.diag([-e, 0, 0]), 1))[0]
    rho = RHO / jacobian(ELASTIC, kin, state)
    assert wave_speed_squared(ELASTIC, kin, state) * rho == pytest.approx((ahead - back) / (2 * e))


def test_the_deviator_stays_one():
    """Rounding errors of many steps do not give the deviatoric stress a trace."""
    kin, rng = Space(), np.random.default_rng(3)
    state = initial_state(YIELDING, kin, 1.0)
    for _ in range(300):
        state = after(YIELDING, kin, state, 1e-3 * rng.normal(size=(3, 3)), 1)
    assert abs(tr(state.s)) < 1e-15
    assert von_mises(state.s) <= Y * (1 + 1e-12)


# --- composed laws as a run has them ----------------------------------------------------------


def test_kinds_tell_compositions_apart():
    assert law_kind(ELASTIC) != law_kind(YIELDING)
    assert law_kind(YIELDING) == law_kind(EosStrength(LinearPressure(1.0, 2.0), Plastic(3.0, 4.0)))
    assert law_kind(ELASTIC.strength) == (Elastic,)


def test_tables_hold_the_laws():
    softer = EosStrength(LinearPressure(1 / RHO, K / 2), Plastic(G / 2, Y / 2))
    table = law_table([YIELDING, softer], np.float32)
    assert law_kind(table) == law_kind(softer)
    assert table.strength.G.dtype == np.float32
    for i, law in enumerate((YIELDING, softer)):
        assert record(table, i) == law_in(law, np.float32)


# --- scripts ----------------------------------------------------------------------------------

BLOCK = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -0.5, 1.5, 0, 1, 0.5)
region(box, block, 0, 1, 0, 1)
region(everywhere, block, INF, INF, INF, INF)
eos(bulk, linear, 2, 160)
strength(mild, plastic, 80, 0.4)
strength(hard, linear, 80)
material(steel, eos-strength, bulk, mild)
material(glass, eos-strength, bulk, hard)
"""

PULL = """
group(nodes, nodes, region, everywhere, all)
fix(pull, velocity_nodes, nodes, 0.01*x0, 0)
compute(worst, max_plastic_strain, all)
compute(Es, strain_energy, all)
dump(end, all, particle, 1000, end.*.LAMMPS, x, y, s11, s22, s33, s12, e11, ep, seq, volume)
log_modify(custom, step, time, worst_Epmax, Es)
set_output(1000)
set_dt(0.01)
run(50)
"""


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf"])
def test_a_block_pulled_beyond_yield(run_interpreted, scheme):
    """Uniform uniaxial strain of 0.005 in 50 steps, twice what yields: the same closed forms."""
    script = BLOCK + f"scheme({scheme})\nsolid(s, region, box, 1, steel, 0.5, 0)\n" + PULL
    result = run_interpreted(script)
    assert "will be 0" not in result.err
    last = result.dump("end.50.LAMMPS")
    steps = 49 if scheme == "usf" else 50  # strained up to where the last step began
    # By nodal velocities at the places after each step, where those before have (1 - 1e-4)^-1.
    increment = 1e-4 / (1 - 1e-4) if scheme == "usf" else 1e-4
    j, strain = (1 + increment) ** steps, steps * increment
    ep = 2 / 3 * (strain - Y / (2 * G))
    assert last.ep == pytest.approx(np.full(len(last.id), ep), rel=1e-7)
    assert last.seq == pytest.approx(np.full(len(last.id), Y), rel=1e-7)
    assert last.s11 == pytest.approx(np.full(len(last.id), K * (j - 1) + 2 / 3 * Y), rel=1e-7)
    assert last.s33 == pytest.approx(np.full(len(last.id), K * (j - 1) - Y / 3), rel=1e-7)
    assert result.log.worst_Epmax == pytest.approx([0, ep], rel=1e-7)
    energy = K / 2 * (j - 1) ** 2 + j * Y**2 / (6 * G)
    assert result.log.Es[-1] == pytest.approx(energy, rel=1e-7)


def test_two_compositions_in_one_scene(run_interpreted):
    """Each solid keeps the law of its own material; what cannot yield has no plastic strain."""
    script = BLOCK + (
        "region(left, block, 0, 0.5, 0, 1)\nregion(right, block, 0.5, 1, 0, 1)\n"
        "solid(a, region, left, 1, steel, 0.5, 0)\nsolid(b, region, right, 1, glass, 0.5, 0)\n"
    )
    last = run_interpreted(script + PULL).dump("end.50.LAMMPS")
    yields = last.type == 1
    assert last.ep[yields] == pytest.approx(np.full(2, 2 / 3 * (0.005 - Y / (2 * G))), rel=1e-7)
    assert last.ep[~yields].tolist() == [0] * 2
    assert last.seq[~yields] == pytest.approx(np.full(2, 2 * G * 0.005), rel=1e-7)


def test_compiled_is_the_same(run_script, run_interpreted):
    script = BLOCK + "solid(s, region, box, 1, steel, 0.5, 0)\n" + PULL
    compiled = run_script(script, folder="compiled").dump("end.50.LAMMPS")
    interpreted = run_interpreted(script, folder="interpreted").dump("end.50.LAMMPS")
    for name in ("s11", "s22", "ep", "e11", "x"):
        assert compiled[name] == pytest.approx(interpreted[name], rel=1e-9, abs=1e-12)


def test_single_precision(run_interpreted):
    script = "precision(single)\n" + BLOCK + "solid(s, region, box, 1, steel, 0.5, 0)\n" + PULL
    last = run_interpreted(script).dump("end.50.LAMMPS")
    assert last.ep == pytest.approx(np.full(len(last.id), 2 / 3 * 0.0025), rel=1e-3)


def test_check_names_the_parts(tmp_path, capsys):
    """karamelo-py check tells what a point carries: J, four of s, dissipated energy, ep."""
    script = tmp_path / "in.check"
    script.write_text(BLOCK + "solid(s, region, box, 1, steel, 0.5, 0)\nrun(1)\n")
    assert main(["check", str(script)]) == 0
    out = capsys.readouterr().out
    assert "a point of steel (eos-strength: linear, plastic)" in out
    assert re.search(r"^  state +7 +56$", out, re.M)


def test_values_of_a_replaced_compute_are_forgotten():
    values = Values()
    values.publish_vector("a", ("Epmax",))
    values.set("a_Epmax", 3)
    assert "a_x" not in values and values.get("a_Epmax") == 3
    slot = values.slot("a_Epmax")
    values.publish_vector("a", ("Epmax", "x"))
    assert values.slot("a_Epmax") == slot
    values.publish_vector("a", ("x",))
    assert "a_Epmax" not in values and "a_x" in values


@pytest.mark.parametrize(
    "line, says",
    [
        ("eos(bulk, linear, 2, 160)", "eos: ID 'bulk' is already used (line 6)"),
        ("eos(e, linear, 0, 160)", "'rho0' must be a number above 0, not 0"),
        ("eos(e, linear, 2, -1)", "'K' must be a number above 0, not -1"),
        ("eos(e, linear, 2)", "eos(ID, linear, rho0, K)"),
        ("eos(e, linaer, 2, 160)", "did you mean 'linear'?"),
        ("strength(s, plastic, 80, 0)", "'yield_stress' must be a number above 0, not 0"),
        ("strength(s, plastc, 80, 1)", "did you mean 'plastic'?"),
        ("strength(mild, linear, 80)", "strength: ID 'mild' is already used (line 7)"),
        ("material(m, eos-strength, bulc, mild)", "unknown eos 'bulc'"),
        ("material(m, eos-strength, bulc, mild)", "did you mean 'bulk'?"),
        ("material(m, eos-strength, bulk, mld)", "unknown strength 'mld'"),
        ("material(m, eos-strength, mild, bulk)", "one of bulk"),
        ("material(m, eos-strength, 3, mild)", "'3' is not the ID of an eos"),
        ("material(m, eos-strength, bulk)",
         "material(ID, eos-strength, eos, strength[, damage][, temperature][, strain="
         "logarithmic])"),
    ],
)  # fmt: skip
def test_mistakes(run_interpreted, line, says):
    assert says in run_interpreted(BLOCK + line + "\n", status=1).err


# --- a part of a kind that the law does not name ------------------------------------------------


class Swelling(NamedTuple):
    """A pressure that grows by `rate` per time."""

    rate: float


@initial_part.on(Swelling)
def _initial_part_swelling(part, like):
    return (real(0, like),)


@part_after.on(Swelling)
def _part_after_swelling(part, memory, law, step, memories):
    return (memory[0] + step.dt,)


@part_pressure.on(Swelling)
def _part_pressure_swelling(part, memory):
    return (part.rate * memory[0],)


@every_kinematics
@every_law
def test_parts_of_other_kinds_add_their_pressure(kin, law):
    """Two of them, beside the parts that the law names: their pressures add up."""
    swelling = law._replace(further=chained([Swelling(3.0), Swelling(5.0)]))
    full = np.diag([1e-4, 0, 0])
    plain = after(law, kin, initial_state(law, kin, 1.0), full, 4)
    state = after(swelling, kin, initial_state(swelling, kin, 1.0), full, 4)
    assert state.m.strength == plain.m.strength
    t = tuples.flat(state.m.further)
    assert t[0] == t[1] > 0
    more = tr(cauchy_stress(law, kin, plain)) - tr(cauchy_stress(swelling, kin, state))
    assert more / 3 == pytest.approx((3 + 5) * t[0])


def test_a_script_puts_a_part_of_another_kind_into_the_law():
    made = EosStrength.given(
        MaterialPart("eos", "linear", LinearPressure(1 / RHO, K)),
        MaterialPart("strength", "linear", Elastic(G)),
        MaterialPart("swelling", "even", Swelling(3.0)),
    )
    assert made == ELASTIC._replace(further=chained([Swelling(3.0)]))
    assert Swelling in law_kind(made)
