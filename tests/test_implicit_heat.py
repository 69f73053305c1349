"""Heat in implicit steps: conduction by large steps, and heating by plastic work."""

from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.special import erfc

from comparisons.results import read_dump

INPUTS = Path(__file__).parent.parent / "inputs"


def slab(kind: str = "ulmpm") -> str:
    """in.heat_slab in load steps: a body at rest, as stiff as copper is."""
    text = (INPUTS / "in.heat_slab").read_text()
    scheme = "scheme(quasi-static)\nsteps = 30\nset_dt(3/steps)"
    for old, new in (
        ('kind   = "ulmpm"', f'kind   = "{kind}"'),
        ("1, thermo-mechanical)", f"1, thermo-mechanical)\n{scheme}"),
        ("124,", "1.24e11,"),
        (
            "group(face, ",
            "region(every, block, -INF, INF)\ngroup(every, nodes, region, every, all)\n"
            "fix(rest, velocity_nodes, every, 0)\ngroup(face, ",
        ),
        ("set_output(100)", "set_output(1)"),
        ("run_time(3)", "run(steps)"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def test_heat_is_kept_in_the_total_frame(run_interpreted):
    """What the face is given is what the slab has, and it flows as in the updated frame."""
    logs = [
        run_interpreted(slab(kind), "-var", "steps", "4", "-var", "refine", "0.2", folder=kind).log
        for kind in ("ulmpm", "tlmpm")
    ]
    assert np.allclose(np.cumsum(logs[1]["face_s"][1:]) * 3 / 4, logs[1]["heat"][1:], rtol=1e-9)
    assert np.allclose(logs[0]["heat"], logs[1]["heat"], rtol=1e-9)


@pytest.mark.parametrize("kind", ["ulmpm", pytest.param("tlmpm", marks=pytest.mark.full)])
def test_heat_flows_into_a_slab(run_script, kind):
    """T = erfc(x / (2 sqrt(a t))), by steps of 15 times the stable one; the rule is of order 1."""
    errors = []
    for steps in (30, 60):
        words = "-var", "steps", str(steps)
        result = run_script(slab(kind), *words, folder=f"run{steps}")
        log_of = result.log
        heat = log_of["heat"]
        # What the face is given is what the slab has.
        assert np.allclose(np.cumsum(log_of["face_s"][1:]) * 3 / steps, heat[1:], rtol=1e-9)
        errors.append(abs(heat[-1] / log_of["exact"][-1] - 1))
        points = read_dump(result.folder / f"heat_slab.{steps}.LAMMPS")[-1]
        exact = 300 + 100 * erfc(points["x"] / (2 * sqrt(401 / 8960 / 385 * 3)))
        assert np.abs(points["T"] - exact).max() < 60 / steps
    assert errors[0] < 5e-3 and errors[1] < 0.6 * errors[0]


def test_plastic_work_heats(run_interpreted):
    """T0 + chi/(rho cp) (Y ep + H ep^2/2): in.shear_heating where heat could flow."""
    text = (INPUTS / "in.shear_heating").read_text()
    for old, new in (
        ("basis, 1)", "basis, 1, thermo-mechanical)\nscheme(quasi-static)\nset_dt(shear/rate/40)"),
        ("fix(start, initial_velocity_particles, all, rate*y0, 0)", ""),
        ("dt_factor(0.5)", ""),
        ("dump(frames", "# dump(frames"),
        ("run_time(shear/rate)", "run(40)"),
    ):
        assert old in text
        text = text.replace(old, new)
    log_of = run_interpreted(text, "-var", "refine", "0.25", "-var", "ppc", "1").log
    assert log_of["T"][-1] - 298 == pytest.approx(log_of["exact"][-1] - 298, rel=5e-3)
    assert max(log_of["worst_Tmax"]) == pytest.approx(log_of["T"][-1], rel=1e-3)


BAR = """
    axial = "NULL"
    method(ulmpm, FLIP, linear, 1, thermo-mechanical)
    scheme(quasi-static)
    dimension(2, 0, 3, 0, 4, 1)
    axisymmetric(true)
    region(b, block, 0, 2, 0, 2)
    material(m, linear, 1, 1, 0.3, 2, 1e-3, 1e-5)
    solid(b, region, b, 2, m, 1, 20)
    region(low, block, -INF, INF, -INF, 0)
    region(top, block, -INF, INF, 2, INF)
    group(low, nodes, region, low, all)
    group(top, nodes, region, top, all)
    fix(low, velocity_nodes, low, NULL, 0)
    fix(top, velocity_nodes, top, NULL, pull)
    HEAT
    compute(s, average_stress, all)
    compute(T, average_temperature, all)
    log_modify(custom, step, s_11, s_22, s_33, T, parts)
    run(1)
    """


def test_a_bar_between_walls_is_warmed_in_one_step(run_interpreted):
    """-E alpha dT along the bar and nothing across it, in the step that warms it."""
    heat = "fix(warm, temperature_particles, all, 120)"
    log_of = run_interpreted(BAR.replace("pull", "0").replace("HEAT", heat)).log
    assert log_of["T"][-1] == pytest.approx(120, rel=1e-12)
    assert log_of["s_22"][-1] == pytest.approx(-1e-5 * 100, rel=1e-9)
    assert abs(log_of["s_11"][-1]) < 1e-12 and abs(log_of["s_33"][-1]) < 1e-12


def test_a_step_in_parts_warms_once(run_interpreted):
    """A part without equilibrium takes its heat back: the rise is that of the faces, which grow.

    Sides of cubes of the points' volumes grow at most by the root of the stretch, as the bar gets
    thinner; parts of 1 and 1/2 of the step that kept their heat would add as much again, and half.
    """
    heat = """region(end, block, 0, INF, 0, 0.4)
    group(end, particles, region, end, solid, b)
    fix(warm, heat_flux_particles, end, 6)"""
    text, rises = BAR.replace("HEAT", heat).replace("parts)", "parts, warm_s)"), []
    for pull, parts in (0, 1), (1.5, 3):
        log_of = run_interpreted(text.replace("pull", str(pull)), folder=str(pull)).log
        assert log_of["parts"][-1] == parts
        rises.append(log_of["T"][-1] - 20)
        if not pull:
            mass, cp = 2 * 2**2 / 2, 2
            assert rises[0] == pytest.approx(log_of["warm_s"][-1] / (mass * cp), rel=1e-12)
    assert rises[0] < rises[1] < (1 + 1.5 / 2) ** 0.5 * rises[0]
