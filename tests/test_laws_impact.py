"""Laws of impact: crushed pores, ceramics, spall; each against its formulas, and a plate impact."""

from itertools import pairwise

import numpy as np
import pytest
from conftest import INPUTS
from laws import isochoric, mises, pressure_of, start, stress, stretched, worked
from tensors import flat as matrix

from karamelo_py.advice.choosing import eos_traits
from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.slopes import seeded, slopes_of
from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    columns_of,
    damage,
    damage_initiation,
    dissipated_energy,
    energy_density,
    jacobian,
    with_temperature,
)
from karamelo_py.points.laws.damages import JohnsonCookDamage, integrity
from karamelo_py.points.laws.eos import (
    LinearPressure,
    VolumeStep,
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    initial_energy,
    pressure,
)
from karamelo_py.points.laws.eos.by_formula import EosFormula, MieGrueneisen, StiffenedGas
from karamelo_py.points.laws.eos.p_alpha import PAlpha
from karamelo_py.points.laws.eos_strength import EosStrength, volume_energy
from karamelo_py.points.laws.formulas import with_numbers
from karamelo_py.points.laws.spall import CochranBanner, DamageFormula, TulerButcher
from karamelo_py.points.laws.strengths.ceramics import Concrete, JohnsonHolmquist2
from karamelo_py.points.laws.strengths.hardening import Plastic
from karamelo_py.points.laws.strengths.linear import Elastic
from karamelo_py.points.laws.strengths.mohr_coulomb import MohrCoulomb
from karamelo_py.points.laws.strengths.porous import CrushableFoam, CrushableFoamConstants, Gurson
from karamelo_py.points.laws.temperatures import PlasticWork

SPACE = Space()
K, ALPHA, PE, PS = 37.0, 1.25, 0.05, 1.2
ROCK = EosStrength(
    PAlpha(ALPHA / 2.65, LinearPressure(1 / 2.65, K), ALPHA, PE, PS, 2.0), Elastic(8.0)
)
SHRINK = -np.eye(3)


def on_crush_curve(p):
    """alpha and J at the pressure p: Herrmann (1969), with p alpha = K (1 - J alpha0/alpha)."""
    alpha = 1 + (ALPHA - 1) * ((PS - p) / (PS - PE)) ** 2
    return alpha, (1 - p * alpha / K) * alpha / ALPHA


@pytest.mark.parametrize("p", [0.06, 0.3, 0.9, 1.19])
@pytest.mark.parametrize("steps", [1, 20])
def test_pores_are_crushed_along_the_curve(p, steps):
    alpha, J = on_crush_curve(p)
    each = J ** (1 / (3 * steps)) - 1
    state = stretched(ROCK, SPACE, start(ROCK, SPACE), each * np.eye(3), steps)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(p, rel=1e-9)
    assert state.m.energy.alpha == pytest.approx(alpha, rel=1e-10)


def test_unloading_leaves_pores_closed():
    """Elastic at constant alpha: J = alpha/alpha0 at no pressure; work = stored + dissipated."""
    _, J = on_crush_curve(0.6)
    state, work = worked(ROCK, SPACE, start(ROCK, SPACE), (J ** (1 / 3000) - 1) * np.eye(3), 1000)
    lost, stored = (f(ROCK, SPACE, state) for f in (dissipated_energy, energy_density))
    assert stored + lost == pytest.approx(work, rel=2e-3)
    alpha = state.m.energy.alpha
    ratio = (alpha / ALPHA / jacobian(ROCK, SPACE, state)) ** (1 / 3) - 1
    state = stretched(ROCK, SPACE, state, ratio * np.eye(3), 1)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(0, abs=1e-9)
    assert state.m.energy.alpha == alpha
    assert dissipated_energy(ROCK, SPACE, state) == lost


def test_beyond_full_compaction_it_is_the_solid():
    memory = compressed(ROCK.eos, start(ROCK, SPACE).m.energy, VolumeStep(1.0, 0.75, 1.0), 0.0)
    assert memory.alpha == 1
    state = stretched(ROCK, SPACE, start(ROCK, SPACE), (0.75 ** (1 / 3) - 1) * np.eye(3), 1)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(K * (1 - 0.75 * ALPHA), rel=1e-9)


@pytest.mark.parametrize("steps", [50, 400])
def test_pores_of_soil_are_crushed_as_without_shear(steps):
    """Without dilatancy plastic flow leaves the volume, and pressure, to the crush curve."""
    law = ROCK._replace(strength=MohrCoulomb.given(8.0, 0.02, 30.0))
    alpha, J = on_crush_curve(0.3)
    ratio = J ** (1 / steps) - 1
    state, work = worked(law, SPACE, start(law, SPACE), np.diag([ratio, 0, 0]), steps)
    assert state.m.strength.ep > 0.04
    assert state.m.strength.Jp == pytest.approx(1, abs=1e-9)
    assert pressure_of(law, SPACE, state) == pytest.approx(0.3, rel=1e-6)
    assert state.m.energy.alpha == pytest.approx(alpha, rel=1e-7)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    assert lost + stored == pytest.approx(work, rel=1e-2)


# Alumina AD-995: Johnson & Holmquist 1993; Cronin et al. 2003, table 1.
ALUMINA = JohnsonHolmquist2(90.16, 0.93, 0.6, 0.31, 0.6, 0.0, 1.0, 0.2, 2.79, 1.46, 0.005, 1.0)
BULK = 130.95
CERAMIC = EosStrength(LinearPressure(1 / 3.7, BULK), ALUMINA)


def test_a_plane_wave_yields_at_the_hugoniot_elastic_limit():
    """The published constants agree with each other: sHEL (A (1 + T*)^N) is 3/2 (HEL - PHEL)."""
    state, before = start(CERAMIC, SPACE), None
    while state.m.strength.ep == 0:
        before, state = state, stretched(CERAMIC, SPACE, state, np.diag([-1e-5, 0, 0]), 1)
    assert -stress(CERAMIC, SPACE, before)[0, 0] == pytest.approx(2.79, rel=0.02)
    assert pressure_of(CERAMIC, SPACE, before) == pytest.approx(1.46, rel=0.02)


# Pressure and von Mises stress read from the published figures of one element, crushed by 5 % and
# released: first loading, the point where it is broken, the end, the release (Johnson & Holmquist
# 1993; Cronin, Bui, Kaufmann, McIntosh & Berstad 2003; digitised in tests of BAM's comfe).
# A: no strength when broken, at once; B: by a failure strain; C: with a strength when broken.
PUBLISHED = {
    "A": ("0, 0, 0, 0", [(0.644, 0.885), (1.158, 1.546), (4.529, 0), (7.459, 0)]),
    "B": (
        "0, 0, 0.005, 1",
        [(0.721, 0.960), (1.354, 1.829), (1.721, 2.073), (2.277, 2.112), (3.040, 1.986),
         (3.853, 1.622), (4.674, 1.059), (5.183, 0.638), (5.708, 0.132), (5.837, 0), (7.574, 0)],
    ),
    "C": (
        "0.31, 0.6, 0.005, 1",
        [(0.688, 0.960), (1.419, 1.919), (1.812, 2.124), (2.450, 2.226), (2.927, 2.248),
         (3.598, 2.189), (4.438, 2.011), (5.286, 1.736), (6.031, 1.450), (6.542, 1.526),
         (7.129, 1.596), (7.555, 1.650), (6.936, 0.868), (6.274, 0), (5.820, 0.615),
         (5.325, 1.337), (4.346, 1.197), (3.052, 0.965), (1.595, 0.652), (0.666, 0.383)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", PUBLISHED)
def test_a_ceramic_is_crushed_and_released_as_published(run_interpreted, case):
    """Within 0.05 GPa of the figures; the largest pressure within 0.5 %."""
    constants, points = PUBLISHED[case]
    B, M, D1, D2 = map(float, constants.split(", "))
    script = f"""
        eos(k, formula, 3.7, K1*(1/J - 1), K1={BULK})
        strength(s, johnson-holmquist-2, 90.16, .93, .6, {B}, {M}, 0, 1, .2, 2.79, 1.46, {D1}, {D2})
        material(alumina, eos-strength, k, s)
        load_path(press, 400, exx=400*(0.95^(1/400) - 1))
        load_path(back, 400, exx=0)
        element(e, alumina, press, back, kinematics=1D)"""
    t = np.genfromtxt(run_interpreted(script).folder / "element_e.txt", names=True)
    path = np.array([t["p"], t["q"]]).T
    # distance of each published point from the segments of the path
    ends, ways = path[:-1], np.diff(path, axis=0)
    for point in points:
        along = ((point - ends) * ways).sum(1) / np.maximum((ways**2).sum(1), 1e-30)
        nearest = ends + np.clip(along, 0, 1)[:, None] * ways
        assert np.hypot(*(nearest - point).T).min() < 0.05
    assert t["p"].max() == pytest.approx(max(points)[0], rel=5e-3)
    # An intact point has q = 2 G ln(1/J), up to sHEL A (P* + T*)^N; broken, sHEL B P*^M.
    whole = t["ep"] == 0
    whole[401:] = False
    assert np.allclose(t["q"][whole], 2 * 90.16 * np.log(1 / t["J"][whole]), rtol=2e-4)
    p = t["p"][400]
    assert t["damage"][400] == 1
    assert t["q"][400] == pytest.approx(1.995 * B * (p / 1.46) ** M, rel=1e-3)
    # What the shear energy has added to the pressure remains at the initial volume.
    assert t["p"][-1] == pytest.approx(p + BULK * (1 / t["J"][-1] - 1 / t["J"][400]), rel=1e-3)


def test_a_ceramic_that_breaks_at_once_turns_its_shear_energy_into_pressure():
    """dp = -p + sqrt(p^2 + 2 K U) with U = q^2/(6 G) (Johnson & Holmquist 1993)."""
    for beta in (1.0, 0.0):
        broken = ALUMINA._replace(B=0.0, M=0.0, D1=0.0, D2=0.0, beta=beta)
        law = CERAMIC._replace(strength=broken)
        state, work = start(law, SPACE), 0.0
        while not state.m.strength.damage:
            before = state
            state, more = worked(law, SPACE, state, np.diag([-2e-5, 0, 0]), 1)
            work += more
        p, q = pressure_of(law, SPACE, before), mises(law, SPACE, before)
        added = -p + np.sqrt(p**2 + 2 * beta * BULK * q**2 / (6 * law.strength.G))
        state, more = worked(law, SPACE, state, np.diag([-2e-5, 0, 0]), 2000)
        assert state.m.strength.bulking == pytest.approx(added, rel=5e-3, abs=1e-12)
        assert (added > 0.3) == (beta > 0)
        assert pressure_of(law, SPACE, state) == pytest.approx(
            BULK * (1 - state.J) + added, rel=1e-3
        )
        lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
        assert stored + lost == pytest.approx(work + more, rel=5e-3)


def test_broken_ceramic_opens_without_tension_and_closes_before_it_presses():
    law, state = CERAMIC, start(CERAMIC, SPACE)
    state = stretched(law, SPACE, state, isochoric(2e-3), 40)
    assert state.m.strength.damage == 1
    state = stretched(law, SPACE, state, 1e-3 * np.eye(3), 50)
    assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
    assert state.m.strength.opened > 1.1
    state = stretched(law, SPACE, state, -1e-3 * np.eye(3), 30)
    assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
    state = stretched(law, SPACE, state, -1e-3 * np.eye(3), 40)
    assert state.m.strength.opened == 1
    assert pressure_of(law, SPACE, state) > 1


def test_broken_warm_ceramic_opens_at_no_pressure_and_stores_nothing():
    """Thermal pressure acts on the elastic part of the volume; the gaps store no energy."""
    law = CERAMIC._replace(temperature=PlasticWork(0.0, 1.0, 0.0, 0.01, 300.0, 2000.0))
    state = stretched(law, SPACE, start(law, SPACE), isochoric(2e-3), 40)
    state = with_temperature(law, SPACE, state, 350.0)
    for n in (50, 100):
        state = stretched(law, SPACE, state, 1e-3 * np.eye(3), n)
        assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
        volume = volume_energy(law, state.J, state.m)
        assert volume == pytest.approx(-0.5 * 0.5**2 / BULK, rel=1e-6)


# Concrete of 48 MPa: Holmquist, Johnson & Cook 1993, table 1.
CONCRETE = Concrete(14.86, 0.79, 1.6, 0.61, 0.0, 1.0, 0.048, 0.004, 7.0, 0.04, 1.0, 0.01)


def test_concrete_yields_and_breaks_by_its_published_strength():
    """q = fc (A (1 - D) + B P*^N); D = sum of plastic strain over D1 (P* + T*)."""
    law = EosStrength(LinearPressure(1 / 2.44, 17.0), CONCRETE)
    state = stretched(law, SPACE, start(law, SPACE), 0.1 / 17 / 3 * SHRINK, 1)
    damages = 0.0
    for _ in range(40):
        before = state.m.strength
        state = stretched(law, SPACE, state, isochoric(-5e-4), 1)
        p, now = pressure_of(law, SPACE, state), state.m.strength
        intact = 0.048 * (0.79 + 1.6 * (p / 0.048) ** 0.61)
        lost = (now.ep - before.ep) / max(0.04 * (p + 0.004) / 0.048, 0.01)
        damages = min(damages + lost, 1)
        if now.ep > before.ep:
            exact = intact - damages * 0.048 * 0.79
            assert mises(law, SPACE, state) == pytest.approx(exact, rel=1e-9)
    assert now.damage == pytest.approx(damages, rel=1e-9) and 0.1 < damages < 1


def test_crushed_pores_break_concrete():
    rock = PAlpha(1.1 / 2.64, LinearPressure(1 / 2.64, 30.0), 1.1, 0.016, 0.8, 2.0)
    law = EosStrength(rock, CONCRETE)
    state = stretched(law, SPACE, start(law, SPACE), 1e-4 * SHRINK, 60)
    memory, alpha = state.m.strength, state.m.energy.alpha
    assert memory.ep == 0 and alpha < 1.1
    # In small pressures over efmin, then over D1 (P* + T*).
    assert 0 < memory.damage <= np.log(1.1 / alpha) / 0.01
    p = pressure_of(law, SPACE, state)
    assert memory.damage >= np.log(1.1 / alpha) / (0.04 * (p + 0.004) / 0.048)


FOAM = CrushableFoamConstants(0.4, 1.7e-3, 0.1, 1e-3, 5e-3, 1.8, 4.0).checked()


@pytest.mark.parametrize("steps", [1, 50])
def test_foam_is_on_its_yield_surface(steps):
    """sqrt((q^2 + alpha^2 p^2)/(1 + alpha^2/9)) = Y + H ep + a ln(1/(1 - (ep/e)^beta)) (2000)."""
    law = EosStrength(LinearPressure(1 / 0.25, 0.4), FOAM)
    each = np.diag([-0.3, 0.05, 0.02]) / steps
    state, work = worked(law, SPACE, start(law, SPACE), each, steps)
    q, p, ep = mises(law, SPACE, state), pressure_of(law, SPACE, state), state.m.strength.ep
    Y = 1.7e-3 + 1e-3 * ep - 5e-3 * np.log(1 - (ep / 1.8) ** 4)
    squared = 4.5 * 0.8 / 1.1
    assert np.sqrt((q * q + squared * p * p) / (1 + squared / 9)) == pytest.approx(Y, rel=1e-10)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    if steps > 1:
        assert lost + stored == pytest.approx(work, rel=2e-2)


@pytest.mark.parametrize(
    ("strength", "sides"),
    [(FOAM, -0.2), (MohrCoulomb.given(4.0, 1e-3, 30, 30), 0.6)],
)
def test_volume_energy_is_what_unloading_gives_back(strength, sides):
    """Jp K (1 - Je)^2/2: the pressure works on the volume that plastic flow has left."""
    K = 0.9
    law = EosStrength(LinearPressure(4.0, K), strength)
    F = 1e-3 * np.diag([-1.0, sides, sides])
    state, work = worked(law, SPACE, start(law, SPACE), F, 300)
    Jp = state.J / (1 - pressure_of(law, SPACE, state) / K)
    exact = Jp * 0.5 * pressure_of(law, SPACE, state) ** 2 / K
    assert abs(Jp - 1) > 0.02
    assert volume_energy(law, state.J, state.m) == pytest.approx(exact, rel=1e-9)
    known = energy_density(law, SPACE, state) + dissipated_energy(law, SPACE, state)
    assert known == pytest.approx(work, rel=2e-3)


def test_foam_is_pressed_with_its_plastic_poissons_ratio(run_interpreted):
    script = """eos(f, linear, 0.25, 0.4)
strength(f, crushable-foam, 0.4, 1.7e-3, 0.1, 1e-3)
material(f, eos-strength, f, f)
load_path(c, 40, exx=-0.2, syy=0, szz=0)
element(f, f, c)"""
    t = np.genfromtxt(run_interpreted(script).folder / "element_f.txt", names=True)
    flow = -(t["eyy"][-1] - t["eyy"][20]) / (t["exx"][-1] - t["exx"][20])
    assert flow == pytest.approx(0.1, rel=0.02)
    assert -t["sxx"][-1] == pytest.approx(1.7e-3 + 1e-3 * t["ep"][-1], rel=1e-6)


def test_voids_of_gurson_grow_in_tension():
    """On the surface at the state before; (1 - f) Jp is constant; f = 0 is von Mises."""
    part = Gurson(80.0, 0.4, 5e-3, 0.1, 0.02)
    law, way = EosStrength(LinearPressure(1 / 7.8, 160.0), part), np.diag([2e-4, 1e-4, 1e-4])
    state = start(law, SPACE)
    for _ in range(100):
        before, state = state.m.strength, stretched(law, SPACE, state, way, 1)
        Y = 0.4 * (1 + before.ep / 5e-3) ** 0.1
        q, p = mises(law, SPACE, state), pressure_of(law, SPACE, state)
        c = 1.5 * before.f
        if state.m.strength.ep > before.ep:
            surface = (q / Y) ** 2 + 2 * c * np.cosh(1.5 * p / Y) - 1 - c * c
            assert surface == pytest.approx(0, abs=1e-10)
    assert state.m.strength.f > 0.03
    assert (1 - state.m.strength.f) * state.m.strength.Jp == pytest.approx(0.98, rel=1e-9)
    _, work = worked(law, SPACE, start(law, SPACE), way, 100)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    assert lost + stored == pytest.approx(work, rel=1e-2)
    whole = EosStrength(law.eos, part._replace(f0=0.0))
    state = stretched(whole, SPACE, start(whole, SPACE), way, 50)
    hard = 0.4 * (1 + state.m.strength.ep / 5e-3) ** 0.1
    assert mises(whole, SPACE, state) == pytest.approx(hard, rel=2e-2)
    assert state.m.strength.Jp == pytest.approx(1, abs=1e-12)


def test_closed_voids_leave_dense_metal():
    """(1 - f) Jp is constant until f = 0; then pressure does not yield, and q = Ym."""
    part = Gurson(45.0, 0.2, 5e-3, 0.1, 1e-2)
    law = EosStrength(LinearPressure(1 / 8.9, 138.0), part)
    for steps in (3, 100):
        ratio = 0.86 ** (1 / (3 * steps)) - 1
        state, work = worked(law, SPACE, start(law, SPACE), ratio * np.eye(3), steps)
        memory = state.m.strength
        assert memory.f == pytest.approx(0, abs=1e-12)
        assert memory.Jp == pytest.approx(0.99, rel=1e-9)
        assert pressure_of(law, SPACE, state) == pytest.approx(138 * (1 - 0.86 / 0.99), rel=1e-9)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    assert lost + stored == pytest.approx(work, rel=2e-2)
    state = stretched(law, SPACE, state, isochoric(-1e-3), 50)
    hard = 0.2 * (1 + state.m.strength.ep / 5e-3) ** 0.1
    assert mises(law, SPACE, state) == pytest.approx(hard, rel=1e-2)
    whole = law._replace(strength=part._replace(f0=0.0))
    state = stretched(whole, SPACE, start(whole, SPACE), 0.01 * np.eye(3), 5)
    assert state.m.strength == (0.0, 0.0, 1.0)


def test_foam_without_pores_is_elastic():
    """At ep = e, as many moduli as the material has carry further strain."""
    law = EosStrength(LinearPressure(1 / 0.25, 0.4), FOAM._replace(e=0.5))
    state = stretched(law, SPACE, start(law, SPACE), np.diag([-1e-3, 0, 0]), 900)
    assert state.m.strength.ep == pytest.approx(0.5, rel=1e-4)
    assert -stress(law, SPACE, state)[0, 0] > 20 * 5e-3


HOT = MieGrueneisen(8.94, 3.933, 1.5, 2.0).checked()["eos"]


@pytest.mark.parametrize(
    ("eos", "strength", "way"),
    [
        (HOT, Gurson(45.0, 0.2, 5e-3, 0.1, 0.05), np.diag([1e-3, 0, 0])),
        (HOT, CrushableFoamConstants(45.0, 0.2, 0.1).checked(), np.diag([-1e-3, 0, 0])),
        (HOT, MohrCoulomb.given(45.0, 0.2, 30.0, 10.0), np.diag([-1e-3, 1.2e-3, 0])),
        (ROCK.eos, Gurson(8.0, 0.2, 5e-3, 0.1, 0.01), np.diag([-5e-4, 0, 0])),
    ],
    ids=lambda x: type(x).__name__,
)
def test_plastic_volume_conserves_energy(eos, strength, way):
    """Work is stored or dissipated, although heat (Gamma > 0) or pores change the pressure."""
    law = EosStrength(eos, strength)
    state, work = worked(law, SPACE, start(law, SPACE), way, 250)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    assert lost > 0.2 * work
    assert lost + stored == pytest.approx(work, rel=1e-2)


def test_voids_join_until_the_metal_fails():
    part = Gurson(80.0, 0.4, 5e-3, 0.1, 1e-3, 1.5, 1.0, 0.05, 0.15, 0.04, 0.05, 0.02)
    law = EosStrength(LinearPressure(1 / 7.8, 160.0), part)
    state = stretched(law, SPACE, start(law, SPACE), np.diag([4e-3, -1e-3, -1e-3]), 200)
    assert state.m.strength.f > 0.15
    assert mises(law, SPACE, state) < 1e-2 and -pressure_of(law, SPACE, state) < 1e-2


@pytest.mark.parametrize("strength", [FOAM, Gurson(80.0, 0.4, 5e-3, 0.1, 0.02)])
def test_tangents_of_porous_solids(strength):
    """Against differences of fourth order."""
    foam = isinstance(strength, CrushableFoam)
    law = EosStrength(LinearPressure(1 / 2.0, 0.4 if foam else 160.0), strength)
    way, h = np.diag([-0.02, 0.002, 0.001]) * (1 if foam else -1), 1e-4
    state = stretched(law, SPACE, start(law, SPACE), way, 2)

    def after(e):
        return stress(law, SPACE, stretched(law, SPACE, state, way + np.diag([e, 0, 0]), 1))

    def stress_of(dl):
        return cauchy_stress(law, SPACE, advance(law, SPACE, state, dl, 1.0))

    slope = np.diag(8 * (after(h) - after(-h)) - after(2 * h) + after(-2 * h)) / (12 * h)
    exact = [slopes_of(x, 9)[0] for x in on_numbers(stress_of)(seeded(matrix(SPACE, way)))]
    assert exact[:3] == pytest.approx(slope, abs=1e-8 * 300)


@pytest.mark.parametrize("J", [0.7, 0.9, 1.2])
def test_a_stiffened_gas_follows_its_isentrope(J):
    """p + p0 is proportional to J^-gamma (Menikoff & Plohr 1989); waves to (p + p0) gamma."""
    gas, n = StiffenedGas(1.0, 4.4, 6.0, p=0.1).checked()["eos"], 400
    memory = initial_energy(gas, 1.0)
    ends = J ** (np.arange(n + 1) / n)
    for before, after in pairwise(ends.tolist()):
        memory = compressed(gas, memory, VolumeStep(before, after, 1.0), 0.0)
    p = pressure(gas, J, memory, ())
    assert p == pytest.approx(6.1 * J**-4.4 - 6.0, rel=1e-4)
    assert bulk_modulus(gas, J, memory, ()) == pytest.approx(4.4 * (p + 6), rel=1e-12)
    work = 6.1 / 3.4 * (J**-3.4 - 1) - 6.0 * (1 - J)
    assert compression_energy(gas, J, memory) == pytest.approx(work, rel=1e-4)
    there, memory = at_pressure(gas, 1.0, initial_energy(gas, 1.0), 0.5, ())
    assert there == pytest.approx((6.5 / 6.1) ** (-1 / 4.4), rel=1e-4)
    assert pressure(gas, there, memory, ()) == pytest.approx(0.5, rel=1e-12)


def test_pressure_by_formula_has_temperature_and_energy():
    """p = K (1 - J) + a (T - T0); stored K x^2/2 + a (T - T0) x at constant T, x = 1 - J."""
    formula = with_numbers("160*(1 - J) + 0.01*(T - 300)")
    made = EosFormula(8.0, formula, T=300.0).checked()["eos"]
    heat = PlasticWork(0.0, 1.0, 0.0, 0.0, 300.0, 2000.0)
    law = EosStrength(made, Elastic(80.0), temperature=heat)
    state = with_temperature(law, SPACE, start(law, SPACE), 400.0)
    state, work = worked(law, SPACE, state, 1e-3 * SHRINK, 30)
    x = 1 - state.J
    assert pressure_of(law, SPACE, state) == pytest.approx(160 * x + 1, rel=1e-9)
    stored = energy_density(law, SPACE, state)
    assert stored == pytest.approx(80 * x * x + x, rel=1e-9)
    assert work == pytest.approx(stored, rel=1e-3)


def test_a_shock_in_one_step_is_on_the_hugoniot():
    """rho0 c0^2 x/(1 - S x)^2 with the heat of the shock, E = p x/2 (Meyers 1994)."""
    copper = MieGrueneisen(8.94, 3.933, 1.5, 1.99).checked()["eos"]
    memory = compressed(copper, initial_energy(copper, 1.0), VolumeStep(1.0, 0.8, 1.0), 0.0)
    exact = 8.94 * 3.933**2 * 0.2 / (1 - 1.5 * 0.2) ** 2
    assert pressure(copper, 0.8, memory, ()) == pytest.approx(exact, rel=1e-12)
    assert pytest.approx(0.1 * exact, rel=1e-12) == memory.E
    assert eos_traits(EosStrength(copper, Elastic(8.0))).of_solids


FORMULAS = (
    (TulerButcher(1.2, 2.0, 0.01), "max(s1 - 1.2, 0)^2/0.01", 1e30),
    (JohnsonCookDamage(0.01, 0.4, -1.5, 0.0, 0.0, 1.0, 0.0, 1.0), "epdot/(0.01 + 0.4*exp(-1.5*t))",
     10.0),
)  # fmt: skip


@pytest.mark.parametrize(("built_in", "formula", "brittleness"), FORMULAS)
def test_damage_by_formula_is_the_built_in(built_in, formula, brittleness):
    by_formula = DamageFormula.given(with_numbers(formula), brittleness=brittleness)
    found = []
    for part in (built_in, by_formula):
        law = EosStrength(LinearPressure(1 / 8.9, 140.0), Plastic(48.0, 1.0), damage=part)
        state = stretched(law, SPACE, start(law, SPACE), np.diag([0.003, 0, 0]), 60, 1e-4)
        found.append([damage(law, SPACE, state), damage_initiation(law, SPACE, state)])
        assert {"damage", "damage_init"} < columns_of(law).keys()
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[0][0] > 0 and found[0][1] > 0.5


def test_cracks_of_cochran_and_banner_open_along_their_curve():
    """Tension sigma0 (1 - (w/D0)^(2/3)), w the volume strain since, times the cell size."""
    part = CochranBanner(1.2, 0.05, 0.5)
    law = EosStrength(LinearPressure(1 / 8.9, 140.0), Elastic(48.0), damage=part)
    state = stretched(law, SPACE, start(law, SPACE), 1e-5 * np.eye(3), 2000)
    w = np.log(state.J / (1 + 1.2 / 140)) * 0.5 / 0.05
    assert damage_initiation(law, SPACE, state) == pytest.approx(w, rel=5e-3)
    assert -pressure_of(law, SPACE, state) == pytest.approx(1.2 * (1 - w ** (2 / 3)), rel=5e-3)
    state = stretched(law, SPACE, state, 1e-4 * np.eye(3), 500)
    assert damage(law, SPACE, state) == 1
    state = stretched(law, SPACE, state, -1e-3 * np.eye(3), 100)
    assert pressure_of(law, SPACE, state) > 1


def test_spall_takes_the_time_of_tuler_and_butcher():
    """At the tension s fails after K/(s - sigma0)^n; then only pressure is left."""
    law = EosStrength(
        LinearPressure(1 / 8.9, 140.0), Elastic(48.0), damage=TulerButcher(1.2, 2.0, 0.01)
    )
    e = 0.02
    state = stretched(law, SPACE, start(law, SPACE), np.diag([e, 0, 0]), 1, 1e-9)
    tension = stress(law, SPACE, state)[0, 0]
    time, n = 0.01 / (tension - 1.2) ** 2, 100
    for part, broken in ((0.98, 0), (0.04, 1)):
        state = stretched(law, SPACE, state, np.zeros((3, 3)), n, part * time / n)
        assert damage(law, SPACE, state) == broken
        left = integrity(law.damage, state.m.damage)
        assert left == 1 - broken and isinstance(left, float)  # an integer cannot be taken in lanes
    assert np.allclose(stress(law, SPACE, state), 0)
    state = stretched(law, SPACE, state, 0.03 * SHRINK, 1, 1e-9)
    assert pressure_of(law, SPACE, state) > 1


SCENE = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 4, 0, 1, 0.5)
    eos(solid, linear, 2.65, 37)
    eos(rock, p-alpha, solid, 1.25, 0.05, 1.2)
    eos(hard, linear, 3.7, 131)
    strength(soft, plastic, 8, 0.05)
    strength(hard, johnson-holmquist-2, 90, 1, 0.6, 0.3, 0.6, 0.01, 1, 0.2, 2.79, 1.46, 0.005, 1)
    strength(metal, linear, 48)
    damage(spall, tuler-butcher, 0.5, 1, 0.001)
    material(a, eos-strength, rock, soft)
    material(b, eos-strength, hard, hard)
    material(c, eos-strength, hard, metal, spall)
    region(a, block, 0, 1, 0, 1)
    region(b, block, 1.5, 2.5, 0, 1)
    region(c, block, 3, 4, 0, 1)
    solid(a, region, a, 1, a, 0.5)
    solid(b, region, b, 1, b, 0.5)
    solid(c, region, c, 1, c, 0.5)
    fix(v, initial_velocity_particles, all, 2*sin(2*y0) - 2*(x0 - 0.5), -y0)
    dump(d, all, particle, 10, d.*.txt, p, s11, damage, alpha, dissipated, opened)
    log_modify(custom, step, time)
    set_dt(1e-2)
    run(10)
"""


def test_compiled_they_have_the_same_numbers(run_script, run_interpreted):
    found = []
    for name, run in (("compiled", run_script), ("interpreted", run_interpreted)):
        folder = run(SCENE, folder=name).folder
        found.append(np.loadtxt(folder / "d.10.txt", skiprows=11))
    assert np.allclose(found[0], found[1], rtol=1e-9, atol=1e-9)
    assert 0 < found[0][found[0][:, 8] > 0, 8].min() < 1.25 and found[0].shape == (12, 11)


def test_a_flyer_spalls_a_plate(run_script):
    """in.flyer: Rankine-Hugoniot pressure, and pull-back 2 tension/(rho0 c0) (Antoun 2003)."""
    done = run_script((INPUTS / "in.flyer").read_text("utf-8"))
    log, rho, c0, S, v = done.log, 8.93, 3.94, 1.489, 0.4
    flat = log.u_x[(log.Time > 1.1) & (log.Time < 1.5)].mean()
    low = log.u_x[log.Time > 1.95].mean()
    assert flat == pytest.approx(v, rel=0.01)
    assert flat - low == pytest.approx(2 * 1.2 / (rho * c0), rel=0.04)
    x, _, _, _, p = np.loadtxt(done.folder / "flyer.200.LAMMPS", skiprows=11)[:, 2:].T
    behind = p[(x > 0.2) & (x < 2)].mean()
    assert behind == pytest.approx(0.5 * rho * (c0 + 0.5 * S * v) * v, rel=0.01)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("eos(r, p-alpha, solid, 0.9, 1, 2)", "a distension of 0.9 leaves no pores"),
        ("eos(r, p-alpha, solid, 1.2, 3, 2)", "all pores are closed at ps = 2, but crushing"),
        ("eos(r, p-alpha, gas, 1.2, 1, 2)", "eos 'gas' is not an equation of state of a solid"),
        ("strength(c, crushable-foam, 1, 1)\nmaterial(m, eos-strength, gas, c)",
         "pressure makes strength 'c' flow, which a gas cannot do"),
        ("strength(c, crushable-foam, 1, 1, 0.5)", "the plastic volume cannot change"),
        ("strength(c, gurson, 1, 1, 1, 1, 0.7)", "the metal has failed from the start"),
        ("strength(c, gurson, 1, 1, 1, 1, 0.1, 1.5, 1, 0.2, 0.1)", "not above fc = 0.2"),
        ("strength(c, hjc, 1, -1, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1)", "above 0"),
        ("eos(r, formula, 1, 3*J)", "the bulk modulus -3"),
        ("eos(r, formula, 1, 3*x)", "the pressure cannot depend on x"),
        ("eos(r, formula, 1, log(J - 1))", "the pressure at rest is"),
        ("eos(r, formula, 1, atan(1 - J))", "atan is not possible in a law"),
        ("eos(r, stiffened-gas, 1, 1, 6)", "gamma = 1 is impossible"),
        ("damage(d, formula, log(-s1))", "not a number in uniaxial tension"),
        ("damage(d, formula, s2/3)", "unknown name 's2'"),
        ("damage(d, formula, floor(s1))", "floor is not possible in a law"),
        ("strength(c, johnson-holmquist-2, 9, 1, 1, 1, 1, 0, 1, 1, 2, 3, 1, 1)",
         "the elastic limit 2 is not above its pressure 3"),
        ("strength(c, johnson-holmquist-2, 9, 1, 1, 1, 1, 0, 1, 1, 3, 2, 1, 1, 2)",
         "a fraction of 2 is not possible"),
    ],
)  # fmt: skip
def test_constants_that_are_not_possible(run_interpreted, line, says):
    start = "eos(solid, linear, 1, 9)\neos(gas, ideal-gas, 1, 1.4, p=1)\n"
    said = run_interpreted(start + line, status=1).err
    assert says in said and "^" in said
