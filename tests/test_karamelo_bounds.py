"""leq and geq in velocity_nodes, and fixes that hold the same nodes."""

import re

import numpy as np
import pytest
from scenes import SCHEMES, block
from selection import few

MASS = 0.12  # 0.3 x 0.2 with rho 2
EVERY = ["region(every, block, -INF, INF, -INF, INF)", "group(nodes, nodes, region, every, all)"]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("bound", "sign"), [("leq0.02", 1), ("geq-0.02", -1)])
def test_a_bound_acts_from_where_it_is_reached(run_interpreted, scheme, bound, sign):
    """v = 10 t up to 0.02 at the end of the second step; then the reaction is the weight."""
    log = run_interpreted(
        block(
            2, *EVERY, f"fix(wall, velocity_nodes, nodes, {bound}, NULL)",
            f"fix(g, body_force, all, {10 * sign}, 0)", "compute(v, average_velocity, all)",
            "log_modify(custom, step, v_x, wall_x)", "set_dt(0.001)", "run(6)",
            scheme=scheme,
        )
    ).log  # fmt: skip
    assert sign * log.v_x == pytest.approx([0, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02], abs=1e-9)
    reaction = -sign * np.array([0, 0, 0, 10, 10, 10, 10]) * MASS
    assert log.wall_x == pytest.approx(reaction, rel=1e-8, abs=1e-9)


def test_a_floor_lets_go_what_moves_up(run_interpreted):
    """geq of a formula: nodes of the floor at rest are carried up by time, others go their way."""
    log = run_interpreted(
        block(
            2, *EVERY, "v0 = 3", "fix(floor, velocity_nodes, nodes, NULL, geqv0 - time)",
            "fix(v, initial_velocity_particles, all, 0, 5)", "compute(v, average_velocity, all)",
            "log_modify(custom, step, v_y, floor_y)", "set_dt(0.001)", "run(3)",
        )
    ).log  # fmt: skip
    assert log.v_y[1:] == pytest.approx(np.full(3, 5), rel=1e-12)
    assert not log.floor_y.any()


def test_a_variable_of_such_a_name_is_a_variable(run_interpreted):
    log = run_interpreted(
        block(
            2, *EVERY, "leq1 = 7", "fix(f, velocity_nodes, nodes, leq1, 0)",
            "compute(v, average_velocity, all)", "log_modify(custom, step, v_x)", "set_dt(1e-4)",
            "run(2)", transfer="PIC",
        )
    ).log  # fmt: skip
    assert log.v_x[-1] == pytest.approx(7, rel=1e-9)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("fix(f, velocity_nodes, nodes, 0, leq0)", "fix(ID1, velocity_nodes, nodes, 0, NULL)"),
        ("fix(f, velocity_nodes, nodes, 0, leq0)", "fix(ID2, velocity_nodes, nodes, NULL, leq0)"),
        ("fix(f, velocity_nodes, nodes, leqq, 0)", "unknown name 'q'"),
        ("fix(f, velocity_nodes, nodes, leq, 0)", "there is nothing here"),
        ("a = leq0", "fix velocity_nodes"),
    ],
)  # fmt: skip
def test_bounds_that_cannot_be(run_interpreted, line, says):
    assert says in run_interpreted(block(2, *EVERY, line), status=1).err


@pytest.mark.parametrize(
    ("second", "warns"),
    [
        ("1, NULL", True), ("NULL, 0", False), ("leq1, NULL", False),
        ("x0*(0.1*time + 2)", False), ("(2 + time*0.1)*x0", False), ("x0*(0.1*time + 3)", True),
        ("x0*(0.1 - time + 2)", True),
    ],
)  # fmt: skip
def test_fixes_that_do_not_agree(run_interpreted, second, warns):
    """Of the block, 4 x 3 nodes have mass; all 13 x 13 belong to both groups.

    The same product or sum, written in another order, is no other velocity.
    """
    err = run_interpreted(
        block(
            2, *EVERY, "fix(one, velocity_nodes, nodes, x0*(0.1*time + 2), NULL)",
            f"fix(two, velocity_nodes, all, {second}{', NULL' * (',' not in second)})",
            "quit",
        )
    ).err  # fmt: skip
    assert ("gives 169 nodes of this group a different vx: this fix applies there" in err) == warns
    assert ("a different vx" in err) == warns


REBOUND = """
    method(ulmpm, FLIP, linear, 1)
    scheme({})
    dimension(1, 0, 2, 0.1)
    region(bar, block, 0.15, 0.65)
    region(low, block, INF, 0.01)
    material(m, neo-hookean, 1, 1, 0)
    solid(bar, region, bar, 2, m, 0.1, 0)
    group(low, nodes, region, low, all)
    fix(v, initial_velocity_particles, all, -0.05)
    fix(wall, velocity_nodes, low, geq0)
    compute(v, average_velocity, all)
    compute(Ek, kinetic_energy, all)
    compute(Es, strain_energy, all)
    E = Ek + Es
    set_output(1000)
    dt_factor(0.4)
    log_modify(custom, step, E, v_x)
    run_time(6)
"""


@pytest.mark.parametrize("scheme", few(SCHEMES, "musl", "usf"))
def test_a_bar_rebounds_from_a_bound(run_interpreted, scheme):
    """An elastic bar leaves a wall as fast as it came: it gained as much as its energy again.

    A wall at rest does no work: the run tells what kinetic and stored energy have lost. It tells
    the mean of the last looks, at equal times, to half a per cent. The work of nodes that are
    stopped was 1 (musl) and 5 % (usl).
    """
    result = run_interpreted(REBOUND.format(scheme))
    log = result.log
    kept = log.E[-1] / log.E[0]
    assert 0.85 < kept < 1.02
    assert log.v_x[-1] == pytest.approx(0.05, rel=0.08)
    told = re.search(r"^ +energy +(\S+) %", result.out, re.MULTILINE)
    assert float(told[1]) == pytest.approx(100 * (kept - 1), abs=0.6)


def test_a_wall_that_moves_does_work(run_interpreted):
    """A bar that a wall hits loses as much as one that hits the wall (Galilei).

    To 2 % of the energy, since velocities of half a step before the hit count in the first balance.
    Without the wall's own motion in its work, half of the energy seemed to come from nowhere.
    """
    lost = []
    for wall in (0, 0.05):
        text = REBOUND.format("musl").replace("ulmpm", "tlmpm").replace("INF, 0.01", "INF, 0.16")
        text = text.replace("all, -0.05", f"all, {wall} - 0.05").replace("geq0", f"geq{wall}")
        text = text.replace("output(1000)", "output(1)").replace("time(6)", "time(2)")
        result = run_interpreted(text, folder=str(wall))
        told = re.search(r"^ +energy +(\S+) %", result.out, re.MULTILINE)
        lost.append(-float(told[1]) / 100 * max(result.log.E))
    energy = 0.5 * 0.5 * 0.05**2  # of the bar, as the wall sees it
    assert lost[0] > 0.05 * energy
    assert lost[1] == pytest.approx(lost[0], abs=0.02 * energy)
