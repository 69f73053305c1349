"""delete_particles and translate_particles, and the forms of 2020."""

import re

import numpy as np
import pytest
from scenes import block

HOLE = "region(hole, block, 0.4, 0.5, 0.3, 0.4)"  # one cell of the six: 4 of 24 points
RUN = ["log_modify(custom, step, time, c_x, c_y, Ek)", "set_dt(0.001)", "run(2)"]
MEASURED = ["compute(c, center_of_mass, all)", "compute(Ek, kinetic_energy, all)"]
TWO = [
    "region(other, block, 0.8, 1, 0.8, 1)",
    "solid(second, region, other, 2, rubber, 0.1, 0)",
]
DUMP = "dump(d, all, particle, 1, d.*.LAMMPS, x, y, mass)"


@pytest.mark.parametrize("solids", ["body", "all"])
def test_deleted_points_are_gone_and_the_others_numbered(run_interpreted, solids):
    result = run_interpreted(
        block(
            2, *TWO, HOLE, f"delete_particles({solids}, region, hole)",
            "group(g, particles, region, other, solid, second)", *MEASURED, DUMP,
            "fix(v, initial_velocity_particles, g, 1, 0)", *RUN,
        )
    )  # fmt: skip
    rows = result.dump("d.0.LAMMPS")
    assert list(rows.id) == list(range(1, 20 + 16 + 1))
    inside = (rows.x > 0.4) & (rows.x < 0.5) & (rows.y > 0.3) & (rows.y < 0.4)
    assert not inside.any()
    # The group of the second solid, made afterwards, has its 16 points of 2 * 0.0025.
    assert result.log.Ek[0] == pytest.approx(0.5 * 16 * 0.005, rel=1e-12)


def test_points_deleted_between_runs_keep_numbers_and_the_rest_goes_on(run_interpreted):
    """A block in free flight with v = 1: the rest of its points goes on as before."""
    result = run_interpreted(
        block(
            2, "fix(v, initial_velocity_particles, all, 1, 0)", HOLE, *MEASURED, DUMP, *RUN,
            "delete_particles(body, region, hole)", "run(2)",
        )
    )  # fmt: skip
    assert len(result.dump("d.2.LAMMPS").id) == 24
    left = result.dump("d.4.LAMMPS")
    assert len(left.id) == 20
    assert left.id.max() == 24
    assert left.x == pytest.approx(
        result.dump("d.0.LAMMPS").x[left.id.astype(int) - 1] + 0.004, rel=1e-6
    )
    assert result.log.Ek[-1] == pytest.approx(0.5 * 20 * 0.005, rel=1e-9)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["group(g, particles, region, box, all)", "delete_particles(body, region, hole)"],
         "group(g, ...) after delete_particles"),
        (["delete_particles(body, region, box)"], "no point of solid 'body' would be left"),
        (["delete_particles(bdy, region, hole)"], "did you mean 'body'?"),
        (["run(1)", "translate_particles(all, region, box, 0.1, 0)"], "before the first run"),
        (["translate_particles(all, region, box, 1, 0)"], "would leave the domain"),
        (["translate_particles(all, region, box, 0.1)"], "1 component in 2 dimensions"),
    ],
)  # fmt: skip
def test_what_cannot_be_changed(run_interpreted, lines, says):
    assert says in run_interpreted(block(2, HOLE, *lines), status=1).err


@pytest.mark.parametrize("method", ["ulmpm", "tlmpm"])
def test_translated_points(run_interpreted, method):
    """All by (0.1, -0.05), then the left half by x - 0.4: masses stay, the run starts there."""
    script = block(
        2, "translate_particles(all, region, box, 0.1, -0.05)",
        "region(left, block, INF, 0.549, -INF, INF)",
        "translate_particles(body, region, left, 0.1*(x - 0.4), NULL)",
        "group(g, particles, region, left, all)",
        "fix(v, initial_velocity_particles, all, 1, 0)", *MEASURED, DUMP, *RUN,
    )  # fmt: skip
    result = run_interpreted(script.replace("ulmpm", method))
    rows = result.dump("d.0.LAMMPS")
    x = np.repeat(0.325 + 0.05 * np.arange(6), 4) + 0.1
    y = np.tile(0.325 + 0.05 * np.arange(4), 6) - 0.05
    x = np.where(x < 0.549, x + 0.1 * (x - 0.4), x)
    assert np.sort(rows.x) == pytest.approx(np.sort(x), rel=1e-6)
    assert np.sort(rows.y) == pytest.approx(np.sort(y), rel=1e-6)
    assert result.log.c_x[-1] == pytest.approx(x.mean() + 0.002, rel=1e-9)
    assert result.log.Ek[0] == pytest.approx(0.06, rel=1e-12)


def test_translation_around_an_axis_keeps_the_density(run_interpreted):
    """A ring carried from the radius r to 2 r has twice the mass."""
    rings = block(2, "translate_particles(all, region, box, x, 0)", DUMP, *MEASURED, *RUN)
    rows = run_interpreted(rings.replace("region(box", "axisymmetric(true)\nregion(box")).dump(
        "d.0.LAMMPS"
    )
    assert rows.mass == pytest.approx(2 * 0.0025 * rows.x, rel=1e-5)


def test_materials_as_in_2020(run_interpreted):
    """material(ID, eosID, strengthID) is material(ID, eos-strength, eosID, strengthID)."""
    parts = ["eos(e, linear, 2, 100)", "strength(s, linear, 40)"]
    move = ["fix(v, initial_velocity_particles, all, 0.1*x0, 0)", "compute(Es, strain_energy, all)",
            "log_modify(custom, step, Es)", "set_dt(0.001)", "run(5)"]  # fmt: skip
    logs = []
    for form in ("e, s", "eos-strength, e, s"):
        text = block(2, *move)
        material = "\n".join([*parts, f"material(rubber, {form})"])
        logs.append(
            run_interpreted(text.replace("material(rubber, linear, 2, 100, 0.3)", material)).log
        )
    assert (logs[0].Es == logs[1].Es).all()
    assert logs[0].Es[-1] > 0


def test_solids_as_in_2020(run_interpreted):
    """solid(ID, regionID, ppc, material, h) fills the region, whatever it is called."""
    logs = [
        run_interpreted(
            block(2, *MEASURED, *RUN).replace("solid(body, region, box, 2, rubber, 0.1, 0)", line)
        ).log
        for line in (
            "solid(body, region, box, 2, rubber, 0.1)",
            "solid(body, box, 2, rubber, 0.1)",
            "solid(body, rectangle, box, 2, rubber, 0.1)",
        )
    ]
    assert [log.c_x[0] for log in logs] == pytest.approx([0.45] * 3, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("method_modify(FLIP, 0.99)", "method(ulmpm, FLIP, linear, 0.99), instead of line 1"),
        ("method_modify(0.98)", "method(ulmpm, FLIP, linear, 0.98), instead of line 1"),
        ("method_modify(tlmpm)", "method(tlmpm, FLIP, linear"),
        ("method_modify(PIC, cubic-spline)", "method(ulmpm, PIC, cubic-spline), instead of"),
        ("solid(s, block, 0, 1, 0, 2*H, 2, rubber, 0.1)", "region(box, block, 0, 1, 0, 2*H), and"),
        ("solid(s, cylinder, 0.5, 0, 0.1, 2, rubber, 0.1)", "region(box, cylinder, 0.5, 0, 0.1), "),
        ("solid(s, rectangle, 0, 1, 0, 1, 2, m, 0.1)", "and solid(s, region, box, 2, m, 0.1)"),
        ("solid(s, sphere)", "solid(ID, region, box, ppc"),
        ("solid(s, block, box, 9, 6, rubber, 0.1)", "solid(s, region, box, 1, rubber, 0.1), or"),
        ("strength(s, JC, 1, 2, 3, 4, 5, 6)",
         "strength(s, johnson_cook, 1, 2, 3, 4, 5, 6, 0, 0, 1)"),
        ("fix(f, indent, all, sphere, 9, 0, 1, 2, 3)",
         "fix(f, indent, all, sphere, 9, 3, 0, 1, 2)"),
        ("damage(d, damage_johnson_cook, 1, 2, 3, 4, 5, 6, 7)", "1, 2, 3, 4, 0, 5, 6, 7)"),
        ("region(r, block, INF, INF, 0.5, INF, INF, INF)", "too many in 2D"),
        ("region(r, block, 0, H, INF, INF, op)", "hint: region(r, block, 0, H, INF, INF)"),
        ("region(r, block, 0, 1, 0, 1, 0, 1)", "3D; here region(r, block, 0, 1, 0, 1)"),
        ("partition_domain(nodes)", "method(ulmpm, FLIP, linear, 1), instead of"),
        ("eos(e, shock, 2, 100, 10, 1.5, 2, 1)", "eos(ID, shock, rho0, K, c0, S, Gamma, cv, Tr"),
        ("strength(s, johnson_cook, 1, 1, 1, 1, 1, 1)", "johnson_cook, G, A, B, n, epsdot0, C, m"),
    ],
)  # fmt: skip
def test_words_of_2020_say_what_to_write(run_interpreted, line, says):
    result = run_interpreted(block(2, line), status=1)
    assert says in result.err
    assert "did you mean" not in result.err


def test_a_domain_without_a_size_is_told_with_that_of_the_block(run_interpreted):
    script = "L = 1\ndimension(3)\nregion(b, block, 0, L, 0, 2*L, 0, 1)\n"
    err = run_interpreted(script + "method_modify(FLIP, cubic-spline)\n", status=1).err
    assert "dimension(3, 0, L, 0, 2*L, 0, 1, h) is as large as this block" in err
    script = "dimension(3)\nregion(b, cylinder, y, 1, 2, R, -L, L)\n"
    err = run_interpreted(script, status=1).err
    assert "dimension(3, 1 - R, 1 + R, -L, L, 2 - R, 2 + R, h) is as large as this cyl" in err
    err = run_interpreted("dimension(2, 0, L, 0, 1)\n", status=1).err
    assert "hint: dimension(2, 0, L, 0, 1, h)" in err


def test_one_method_where_the_script_has_none(run_interpreted):
    script = "dimension(1, 0, 1, 0.1)\nsolid(s, r, 1, m, 0.1)\nmethod_modify(FLIP, cubic-spline)\n"
    for text in (script, script.split("\n")[2]):
        err = run_interpreted(text, status=1).err
        assert "method(tlmpm, FLIP, cubic-spline, 0.99), before the first solid" in err


FREE = ["fix(v, initial_velocity_particles, all, 1, 0)", *MEASURED, DUMP, "set_dt(0.001)"]


@pytest.mark.parametrize("kind", ["ulmpm", "tlmpm"])
def test_eroded_points_are_counted_with_their_mass_and_energy(run_interpreted, kind):
    """A block in free flight: 4 of 24 points are left of x = 0.39 or so; m v^2 / 2 of each goes.

    In the total frame, where no point leaves its cell, the others were not sorted anew, and a
    compiled run read beyond them.
    """
    result = run_interpreted(
        block(
            2, *FREE, "compute(m, probe, all, mass)",
            "fix(e, erosion, all, x - time < 0.38 && mass > 0, every=10)",
            "log_modify(custom, step, Ek, e_points, e_mass, e_energy)", "set_output(5)", "run(45)",
        ).replace("ulmpm", kind)
    )  # fmt: skip
    log, first, last = result.log, result.dump("d.0.LAMMPS"), result.dump("d.45.LAMMPS")
    gone = first.x < 0.38
    assert 0 < gone.sum() < len(gone)
    assert list(log.e_points) == [0, 0, *[gone.sum()] * 8]
    assert set(last.id) == set(first.id[~gone])
    assert log.e_mass[-1] == pytest.approx(first.mass[gone].sum(), rel=1e-12)
    assert log.e_energy[-1] == pytest.approx(log.Ek[0] - log.Ek[-1], rel=1e-9)
    assert f"deleted points    {gone.sum()}" in result.out
    # What they took is work: the balance closes.
    assert re.search(r"energy +[+-]0.00 % of the largest", result.out)


@pytest.mark.parametrize(("kind", "low"), [("ulmpm", "y < 0.4"), ("tlmpm", "part")])
def test_points_are_deleted_where_a_condition_holds(run_interpreted, kind, low):
    lines = (
        "region(low, block, 0, 1, 0, 0.4)", "group(part, particles, region, low, all)",
        "run(1)", f"delete_particles(body, where, x > 0.5 && {low})", "run(1)",
    )  # fmt: skip
    result = run_interpreted(block(2, *FREE, *lines).replace("ulmpm", kind))
    first, last = result.dump("d.0.LAMMPS"), result.dump("d.2.LAMMPS")
    gone = (first.x + 0.001 > 0.5) & (first.y < 0.4)
    assert set(last.id) == set(first.id[~gone]) and gone.any()
    mass = first.mass[gone].sum()
    assert f"with a mass of {mass:.6g} and an energy of {mass / 2:.6g}" in result.out


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["delete_particles(body, where, x > 0.5)"], "or a run before"),
        (["run(1)", "delete_particles(body, where, x > -5)"], "no point would be left"),
        (["fix(e, erosion, all, x > -5, every=1)", "run(1)"], "no point would be left"),
        (["fix(e, erosion, all, 3)"], "has no column of dump particle"),
        (["fix(e, erosion, all, damag > 1)"], "did you mean 'damage'?"),
    ],
)
def test_what_cannot_be_eroded(run_interpreted, lines, says):
    assert says in run_interpreted(block(2, *FREE, *lines), status=1).err
