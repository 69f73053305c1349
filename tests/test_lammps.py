"""Scripts of LAMMPS: each line is told at once, and what is said to be written is right."""

import re

import pytest

SCRIPT = """\
units           si
dimension       2
boundary        f f p
atom_style      sphere
region          box block 0 1 0 1 0 1
create_box      1 box
lattice         sq 0.1
create_atoms    1 region box
mass            1 1.0
pair_style      lj/cut 2.5
pair_coeff      1 1 1.0 1.0 2.5
velocity        all set 0.1 0 0
group           lower region box
fix             1 all nve
fix             2 all gravity 9.81 vector 0 -1 0
fix             3 lower move linear 0 -0.1 0
variable        rate equal 2*v_speed
timestep        0.001
thermo          100
dump            1 all custom 100 d.*.LAMMPS id type x y z
unfix           3
run             10  # steps
"""
# What of it the hints have.
WRITTEN = {
    3: "boundary(f, f, p)",
    5: "region(box, block, 0, 1, 0, 1, 0, 1)",
    7: "solid(ID, region, regionID, ppc, material, h, 0)",
    10: "material(ID, linear, rho, E, nu)",
    12: "fix(ID, initial_velocity_particles, group, vx, vy, vz)",
    13: "group(lower, particles, region, box, all)",
    14: "leave it out",
    15: "fix(ID, body_force, all, 0, -9.81)",
    16: "fix(ID, velocity_particles, group, vx, vy)",
    17: "name = expression",
    18: "set_dt(0.001)",
    19: "set_output(100)",
    20: "dump(n1, all, particle, 100, d.*.LAMMPS, id, type, x, y, z)",
    21: "delete_fix(n3)",
    22: "run(10)",
}


def test_every_line_is_told_at_once_with_what_to_write(run_interpreted):
    said = run_interpreted(SCRIPT, status=1).err
    hints = dict(re.findall(r":(\d+):\d+: error: [^\n]*\n(?:.*\n){2,3}?hint: ([^\n]*)", said))
    assert [int(line) for line in hints] == list(range(1, SCRIPT.count("\n") + 1))
    for line, written in WRITTEN.items():
        assert written in hints[str(line)], line


@pytest.mark.parametrize(
    ("wrong", "more"), [(43, ""), (201, ""), (202, "1 more mistake after these")]
)
def test_of_a_long_script_every_line_is_told_or_how_many_more_there_are(
    run_interpreted, wrong, more
):
    said = run_interpreted("".join(f"unfix {k}\n" for k in range(wrong)), status=1).err
    assert len(re.findall(r":\d+:\d+: error: ", said)) == min(wrong, 201)
    assert f"error: and {more}" in said if more else "more mistake" not in said
