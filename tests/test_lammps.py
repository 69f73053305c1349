"""Scripts of LAMMPS: each line is told at once, and what is said to be written is right."""

import re

import pytest

from karamelo_py.script.lammps import line_of

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
# What of it a whole line can be said for.
WRITTEN = {
    5: "region(box, block, 0, 1, 0, 1)",
    12: "fix(v, initial_velocity_particles, all, 0.1, 0, 0)",
    13: "group(lower, particles, region, box, all)",
    15: "fix(n2, body_force, all, 0, -9.81, 0)",
    16: "fix(n3, velocity_particles, lower, 0, -0.1, 0)",
    17: "rate = 2*speed",
    18: "set_dt(0.001)",
    19: "set_output(100)",
    20: "dump(n1, all, particle, 100, d.*.LAMMPS, x, y, z)",
    21: "delete_fix(n3)",
    22: "run(10)",
}
OURS = """\
units(m, kg, s)
method(ulmpm, FLIP, linear, 1)
dimension(2, -1, 2, -1, 2, 0.5)
{5}
material(rubber, linear, 1000, 1e6, 0.3)
solid(body, region, box, 1, rubber, 0.5)
{13}
{12}
{15}
{16}
speed = 1
{17}
{18}
{19}
{20}
{21}
{22}
"""


def test_every_line_is_told_at_once_with_what_to_write(run_interpreted):
    said = run_interpreted(SCRIPT, status=1).err
    hints = dict(re.findall(r":(\d+):\d+: error: [^\n]*\n(?:.*\n){2,3}?hint: ([^\n]*)", said))
    assert [int(line) for line in hints] == list(range(1, SCRIPT.count("\n") + 1))
    for line, written in WRITTEN.items():
        assert written in hints[str(line)], line
    assert hints["5"].endswith(" in 2D, region(box, block, 0, 1, 0, 1, 0, 1) in 3D")
    # And these lines run.
    run_interpreted(OURS.format(*["", *(WRITTEN.get(k, "") for k in range(1, 23))]), folder="ours")


@pytest.mark.parametrize(
    ("line", "ours"),
    [
        ("region r sphere 0 1 2 3", "region(r, sphere, 0, 1, 2, 3) in 3D"),
        ("region r sphere 0 1 2 3", "region(r, cylinder, 0, 1, 3) in 2D, "),
        ("region r cylinder z 1 2 3 0 4", "region(r, cylinder, 1, 2, 3) in 2D, "),
        ("region 7 block 0 1 0 1 EDGE EDGE side out", "region(n7, block, 0, 1, 0, 1, exterior)"),
        ("region r block 0 1 0 1 INF INF units box", "block, 0, 1, 0, 1, INF, INF) in 3D"),
        ("fix g all gravity 2 vector 3 0 4", "fix(g, body_force, all, 1.2, 0, 1.6)"),
        ("dump d all atom 5 d.txt", "dump(d, all, particle, 5, d.txt, x, y, z)"),
        ("variable r index 3", "r = 3"),
    ],
)
def test_what_a_line_is_here(line, ours):
    name, *words = line.split()
    assert ours in line_of(name, words)


@pytest.mark.parametrize(
    "line",
    ["region r block 0 1 0 1", "fix g all gravity v_a vector 0 1 0", "fix s all setforce 0 0 0",
     "fix g all gravity 9.81 chute 20", "variable a equal c_1[2]", "variable a equal ${b}",
     "velocity all create 300 4711", "dump d all image 10 d.jpg type type", "dump d",
     "thermo v_n", "timestep", "unfix", "region r union 2 a b", "boundary reflect"],
)  # fmt: skip
def test_where_more_has_to_be_known_nothing_is_made_up(line):
    name, *words = line.split()
    assert line_of(name, words) is None
