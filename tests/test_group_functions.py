"""Centre of mass, forces of groups, mean stress and reactions, against sums by hand."""

import numpy as np
import pytest
from scenes import block

# 2D block of 0.3 x 0.2 at 0.3 with rho 2 and 24 points: mass 0.12, centre (0.45, 0.4).
MASS = 0.12


def test_centre_of_mass_falls_as_a_point_does(run_interpreted):
    """Positions of the scheme sum to dt^2 b n(n+1)/2; nodes have the centre of the points."""
    log = run_interpreted(
        block(
            2, "fix(g, body_force, all, 0, -3)", "group(nodes, nodes, region, box, all)",
            "region(half, block, 0.3, 0.45, 0.3, 0.5)", "group(part, particles, region, half, all)",
            "compute(c, center_of_mass, all)", "height = xcm(all, y)",
            "log_modify(custom, step, c_x, c_y, height,"
            " xcm(part, x), 2*xcm(nodes, x), xcm(all, z))",
            "set_dt(0.001)", "run(10)",
        )
    ).log  # fmt: skip
    step, c_x, c_y, height, part, twice_nodes, z = log.values()
    fall = 3e-6 * step * (step + 1) / 2
    assert c_x == pytest.approx(np.full(11, 0.45), rel=1e-12)
    assert c_y == pytest.approx(0.4 - fall, rel=1e-12)
    assert height == pytest.approx(c_y, rel=1e-15)
    assert part == pytest.approx(np.full(11, 0.375), rel=1e-12)
    assert twice_nodes[0] == pytest.approx(0.9, rel=1e-12)
    assert not z.any()


def test_external_force_of_nodes_and_rate_of_momentum(run_interpreted):
    """A free body: no internal force in all, the weight outside, and m a = the weight."""
    log = run_interpreted(
        block(
            2, "region(every, block, -INF, INF, -INF, INF)",
            "group(nodes, nodes, region, every, all)", "fix(g, body_force, all, 5, -3)",
            "fix(v, initial_velocity_particles, all, 0, 0.1*(y0 - 0.4))",
            "log_modify(custom, step, external_force(nodes, x), external_force(nodes, y),"
            " internal_force(nodes, y), internal_force(all, x), internal_force(all, y))",
            "set_dt(0.001)", "run(5)",
        )
    ).log  # fmt: skip
    _, outer_x, outer_y, inner_y, rate_x, rate_y = (column[1:] for column in log.values())
    assert outer_x == pytest.approx(np.full(5, 5 * MASS), rel=1e-9)
    assert outer_y == pytest.approx(np.full(5, -3 * MASS), rel=1e-9)
    assert inner_y == pytest.approx(np.zeros(5), abs=1e-12)
    assert rate_x == pytest.approx(np.full(5, 5 * MASS), rel=1e-9)
    assert rate_y == pytest.approx(np.full(5, -3 * MASS), rel=1e-9)


def test_reaction_and_internal_force_of_a_support(run_interpreted):
    """All nodes held against gravity: the reaction is the weight, shared or conflicting or not."""
    log = run_interpreted(
        block(
            2, *NODES,
            "fix(hold, velocity_nodes, nodes, 0, 0)", "fix(more, velocity_nodes, low, 0, 0)",
            "fix(g, body_force, all, NULL, -9)", "compute(R, reaction, nodes)",
            "compute(Rall, reaction, all)",
            "log_modify(custom, step, R_y, Rall_y, external_force(nodes, y), hold_y, more_y)",
            "set_dt(0.001)", "run(4)",
        )
    ).log  # fmt: skip
    assert log.R_y[1:] == pytest.approx(np.full(4, 9 * MASS), rel=1e-9)
    assert (log.Rall_y == log.R_y).all()
    # Of the three rows of nodes those at the faces have half the mass of that between them.
    assert log.more_y[1:] == pytest.approx(np.full(4, 0.75 * 9 * MASS), rel=1e-9)
    assert log.hold_y[1:] == pytest.approx(np.full(4, 0.25 * 9 * MASS), rel=1e-9)


NODES = [
    line
    for name, box in {
        "nodes": "INF, INF, INF, INF", "low": "INF, INF, INF, 0.41", "up": "INF, INF, 0.41, INF",
        "left": "INF, 0.41, INF, INF", "right": "0.41, INF, INF, INF",
        "rest": "0.41, INF, INF, 0.41",
    }.items()
    for line in (f"region({name}, block, {box})", f"group({name}, nodes, region, {name}, all)")
]  # fmt: skip


@pytest.mark.parametrize(
    ("together", "apart"),
    [
        (["nodes, 0, 0", "low, 0.2*time, NULL"],
         ["1: up, 0, NULL", "1: nodes, NULL, 0", "2: low, 0.2*time, NULL"]),
        (["low, 0.2*time, NULL", "nodes, 0, 0"], ["2: nodes, 0, 0"]),
        (["nodes, 0, 0", "low, 0.2*time, NULL", "left, NULL, 0.1"],
         ["1: up, 0, NULL", "1: right, NULL, 0", "2: low, 0.2*time, NULL", "3: left, NULL, 0.1"]),
        (["nodes, 0, 0", "low, 5, 0", "left, 1, NULL", "nodes, 0.3, NULL"],
         ["4: nodes, 0.3, NULL", "1: up, NULL, 0", "2: low, NULL, 0"]),
        (["nodes, NULL, 0", "low, NULL, geq0.05", "left, NULL, leq1"],
         ["1: up, NULL, 0", "2: low, NULL, geq0.05"]),
        (["low, NULL, 0, mu=0.1", "left, NULL, geq0.02, mu=0.2"],
         ["1: rest, NULL, 0, mu=0.1", "2: left, NULL, geq0.02, mu=0.2"]),
        (["low, NULL, 0, mu=0.1", "left, 0.1, NULL"],
         ["1: rest, NULL, 0, mu=0.1", "1: lowleft, NULL, 0", "2: left, 0.1, NULL"]),
    ],
)  # fmt: skip
def test_the_fix_that_decides_has_the_reaction(run_interpreted, together, apart):
    """As if each fix had the nodes and directions alone in which it is the last to hold."""
    nodes = [*NODES, "region(lowleft, block, INF, 0.41, INF, 0.41)"]
    nodes.append("group(lowleft, nodes, region, lowleft, all)")

    def reactions(fixes):
        names = [f"f{k}_{axis}" for k in range(len(fixes)) for axis in "xy"]
        lines = [f"fix(f{k}, velocity_nodes, {fix})" for k, fix in enumerate(fixes)]
        log = run_interpreted(
            block(
                2, *nodes, "fix(g, body_force, all, 4, -9)", *lines, "compute(R, reaction, all)",
                f"log_modify(custom, step, R_x, R_y, {', '.join(names)})",
                "set_dt(0.001)", "run(3)",
                transfer="PIC",
            )
        ).log  # fmt: skip
        columns = np.array([log[name][1:] for name in ["R_x", "R_y", *names]])
        return columns.reshape(1 + len(fixes), 2, 3)

    owners, alone = zip(*(line.split(": ") for line in apart), strict=True)
    total, *each = reactions(together)
    expected, *parts = reactions(alone)
    size = np.abs(expected).max()
    assert total == pytest.approx(expected, abs=1e-9 * size)
    for k, reaction in enumerate(each, 1):
        own = sum((p for p, owner in zip(parts, owners, strict=True) if owner == str(k)), 0 * total)
        assert reaction == pytest.approx(own, abs=1e-9 * size)


def test_reaction_of_a_part_of_a_fix_is_refused(run_interpreted):
    """A fix on nodes of the group and others has one reaction, which is not that of the group."""
    err = run_interpreted(
        block(
            2, "region(low, block, INF, INF, INF, 0.41)", "group(foot, nodes, region, low, all)",
            "fix(hold, velocity_nodes, all, 0, 0)", "compute(R, reaction, foot)",
            "log_modify(custom, step, R_y)", "run(1)",
        ),
        status=1,
    ).err  # fmt: skip
    assert "fix 'hold' holds nodes inside and outside of group 'foot'" in err


def test_mean_stress_of_a_given_state(run_interpreted):
    """Half of the body at s11 = 4, all at s12 = -1: the mean over equal volumes is 2 and -1."""
    log = run_interpreted(
        block(
            2, "region(half, block, 0.3, 0.5, 0.3, 0.4)", "region(rest, block, 0.3, 0.6, 0.3, 0.5)",
            "group(part, particles, region, half, all)",
            "fix(s0, initial_stress, all, if(y0 < 0.4, 4, 0), NULL, NULL, NULL, NULL, -1)",
            "compute(s, average_stress, all)", "compute(p, average_stress, part)",
            "log_modify(custom, step, s_11, s_12, s_23, p_11)", "set_dt(1e-9)", "run(1)",
        )
    ).log  # fmt: skip
    assert log.s_11 == pytest.approx([2, 2], rel=1e-6)
    assert log.s_12 == pytest.approx([-1, -1], rel=1e-6)
    assert log.p_11 == pytest.approx([4, 4], rel=1e-6)
    assert not log.s_23.any()


def test_forces_of_groups_in_conditions(run_interpreted):
    """run_until follows the centre: v = 1 covers 0.01 in ten steps of 0.001."""
    log = run_interpreted(
        block(
            2, "fix(v, initial_velocity_particles, all, 1, 0)", "set_dt(0.001)",
            "log_modify(custom, step)", "run_until(xcm(all, x) > 0.4595)",
        )
    ).log  # fmt: skip
    assert log.Step[-1] == 10
