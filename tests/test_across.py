"""Generalised plane strain: a prescribed strain across a 2D scene, against exact solutions."""

import json
from math import log

import numpy as np
import pytest
from going_on import ELASTIC, FLOWS, goes_on, of_laws, with_files
from scipy.optimize import brentq
from selection import few

from karamelo_py.points.laws.parameters import lame_parameters

BLOCK = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.5)
    SCHEME
    plane_strain(ezz=0.01*time)
    region(all, block, 0, 1, 0, 1)
    region(left, block, 0, 0, INF, INF)
    region(bottom, block, INF, INF, 0, 0)
    LAW
    solid(s, region, all, 2, m, 0.5)
    group(left, nodes, region, left, all)
    group(bottom, nodes, region, bottom, all)
    fix(l, velocity_nodes, left, 0, NULL)
    fix(b, velocity_nodes, bottom, NULL, 0)
    compute(a, average_stress, all)
    compute(Es, strain_energy, all)
    log_modify(custom, time, a_11, a_22, a_33, Es)
    RUN
"""
LINEAR = "material(m, linear, 1000, 1e6, 0.3)"
STEPS = "set_dt(0.5)\n    run(2)"


def block(law=LINEAR, scheme="scheme(quasi-static)", run=STEPS, ezz="0.01*time"):
    script = BLOCK.replace("SCHEME", scheme).replace("LAW", law)
    return script.replace("RUN", run).replace("0.01*time", ezz)


def free_stretch(a, lam, G):
    """The contraction c of a neo-Hookean bar of stretch a: G (c^2 - 1) + lam ln(a c^2) = 0."""
    return brentq(lambda c: G * (c * c - 1) + lam * log(a * c * c), 0.5, 1.5, xtol=1e-15)


@pytest.mark.parametrize("bar", ["", "anti_volumetric_locking(true)"])
@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_a_free_block_of_rubber_has_uniaxial_stress(run_interpreted, bar, nu):
    """Bonet & Wood 2008, section 6.4.3: J s_33 = G (a^2 - 1) + lam ln J, and no stress in plane."""
    done = run_interpreted(block(f"material(m, neo-hookean, 1000, 1e6, {nu})\n    {bar}"))
    lam, G = lame_parameters(1e6, nu)
    c = free_stretch(1.01, lam, G)
    J = 1.01 * c * c
    exact = (G * (1.01**2 - 1) + lam * log(J)) / J
    assert done.log["a_33"][-1] == pytest.approx(exact, rel=1e-8)
    assert abs(done.log["a_11"][-1]) < 1e-8 * exact


def test_linear_and_plastic_blocks_have_their_uniaxial_stress(run_interpreted):
    """Hooke's E ln(1 + ezz) of the true stress; then the yield stress (Hill 1950, chapter 2)."""
    done = run_interpreted(block())
    assert done.log["a_33"][-1] == pytest.approx(1e6 * log(1.01), rel=1e-9)
    law = "strength(y, plastic, 1e6/2.6, 400)\n    eos(b, linear, 1000, 1e6/1.2)\n    "
    done = run_interpreted(block(law + "material(m, eos-strength, b, y)"), folder="plastic")
    assert done.log["a_33"][-1] == pytest.approx(400, rel=1e-6)
    assert abs(done.log["a_11"][-1]) < 1e-6 * 400


def test_a_slow_ramp_in_explicit_steps_balances_its_energy(run_interpreted):
    """E ln(1 + ezz), and its work, E V ezz^2 / 2, is stored."""
    slow = block(scheme="", run="log(100)\n    run_time(1)", ezz="0.005*(1 - cos(PI*time))")
    done = run_interpreted(slow)
    e = log(1.01)
    assert done.log["a_33"][-1] == pytest.approx(1e6 * e, rel=0.002)
    assert abs(done.log["a_11"][-1]) < 0.002 * 1e6 * e
    assert done.log["Es"][-1] == pytest.approx(1e6 * e * e / 2, rel=0.005)
    record = json.loads((done.folder / "run.json").read_text())
    assert abs(record["runs"][-1]["energy_change_percent"]) < 1


def test_a_periodic_cell_has_no_strain_but_across(run_interpreted):
    """s11 = lam e and s33 = (lam + 2 G) e, the constrained modulus; nothing is said of rest."""
    slow = block(scheme="", run="log(200)\n    run_time(1)", ezz="0.005*(1 - cos(PI*time))")
    slow = slow.replace("0, 1, 0.5)", "0, 1, 0.5)\n    boundary(periodic, x, y)", 1)
    slow = slow.replace("tlmpm", "ulmpm").replace("    fix(", "    # fix(")
    done = run_interpreted(slow)
    lam, G = lame_parameters(1e6, 0.3)
    e = log(1.01)
    exact = (lam * e, (lam + 2 * G) * e)
    assert (done.log["a_11"][-1], done.log["a_33"][-1]) == pytest.approx(exact, rel=1e-3)
    assert "nothing moves" not in done.err


# Flow without ezz goes on in test_restart.py.
@pytest.mark.parametrize("laws", few((FLOWS, ELASTIC), ELASTIC))
def test_every_law_goes_on_with_the_same_bits(run_interpreted, laws):
    script = of_laws("ulmpm, FLIP, linear, 1", laws)
    script = script.replace("plane_stress(false)", "plane_strain(ezz=2*time)")
    goes_on(run_interpreted, with_files(script))


def test_boxes_and_ranks_have_the_same_bits(state_interpreted):
    law = "strength(y, plastic, 1e6/2.6, 400)\n    eos(b, linear, 1000, 1e6/1.2)\n    "
    law += "material(m, eos-strength, b, y)"
    script = block(law, "", "run(12)", ezz="0.1*time^2")
    whole = state_interpreted(script, "x", "v", "thickness", "s33")
    assert whole["thickness"].max() > 1.0005
    for how in ({"boxes": True}, {"ranks": 2}):
        other = state_interpreted(script, "x", "v", "thickness", "s33", **how)
        assert all(np.array_equal(whole[name], other[name]) for name in whole)


FIRST = "method(ulmpm, FLIP, linear, 1)\n"
PLANE = "dimension(2, 0, 1, 0, 1, 0.25)\n"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("dimension(1, 0, 1, 0.25)\nplane_strain(ezz=time)", "the scene is 1D"),
        ("dimension(3, 0, 1, 0, 1, 0, 1, 0.25)\nplane_strain(ezz=time)", "the scene is 3D"),
        (PLANE + "axisymmetric(true)\nplane_strain(ezz=time)", "the scene is axisymmetric"),
        (PLANE + "plane_strain(ezz=time)\naxisymmetric(true)", "prescribes the strain across"),
        (PLANE + "plane_stress(true)\nplane_strain(ezz=time)", "has plane stress"),
        (PLANE + "plane_strain(ezz=time)\nplane_stress(true)", "prescribes the strain across"),
        (PLANE + "plane_strain(ezz=time)\nplane_strain(ezz=time)", "prescribed already"),
        (PLANE + f"{LINEAR}\nplane_strain(ezz=time)", "before the first material"),
        (PLANE + "plane_strain(ezz=time + 1)", "ezz is 1 at the start"),
        (PLANE + "plane_strain(ezz=0/time)", "ezz is nan at the start"),
        (PLANE + "plane_strain(ezz=x)", "depends on x"),
    ],
)
def test_what_has_no_strain_across_is_refused(run_interpreted, lines, says):
    assert says in run_interpreted(f"{FIRST}{lines}\n", status=1).err


@pytest.mark.parametrize(
    ("ezz", "law", "says"),
    [
        ("-2*time", LINEAR, "ezz is -1 at time 0.5"),
        ("sqrt(0 - time)", LINEAR, "ezz is nan at time 0.5"),
        ("0*time", LINEAR + "\n    pore_water(m, n=0.4, permeability=1)", "pore_water"),
    ],
)
def test_what_cannot_run_is_refused(run_interpreted, ezz, law, says):
    assert says in run_interpreted(block(law, ezz=ezz), status=1).err


def test_points_that_enter_late_and_gpus_are_refused(run_interpreted):
    late = block() + "solid(t, region, all, 2, m, 0.5)\n"
    assert "after a run would get all of ezz" in run_interpreted(late, status=1).err
    assert "no --gpu" in run_interpreted(block(), "--gpu", status=1).err
