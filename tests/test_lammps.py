"""Scripts of LAMMPS: each line is told at once, and what is said to be written is right."""

import re

import pytest

from karamelo_py.language import registry
from karamelo_py.script.errors import table
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
    12: "fix(v_all, initial_velocity_particles, all, 0.1, 0, 0)",
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
    assert " in 2D, region(box, block, 0, 1, 0, 1, 0, 1) in 3D" in hints["5"]
    # And these lines run.
    run_interpreted(OURS.format(*["", *(WRITTEN.get(k, "") for k in range(1, 23))]), folder="ours")


LENGTHS = ", with numbers in units of length, not of a lattice"
# What stands in this table is the whole hint; lines in it are run.
HINTS = {
    "timestep 0.001": "set_dt(0.001)",
    "thermo 100": "set_output(100)",
    "thermo 0": "set_output(1000000000): the first and the last state are logged in any case",
    "region r block 0 1 0 1 -1 1": "region(r, block, 0, 1, 0, 1) in 2D, "
    "region(r, block, 0, 1, 0, 1, -1, 1) in 3D" + LENGTHS,
    "region r block 0 1 0 1 INF INF units box": "region(r, block, 0, 1, 0, 1) in 2D, "
    "region(r, block, 0, 1, 0, 1, INF, INF) in 3D",
    "region 7 block 0 1 0 1 EDGE EDGE side out units box": "region(n7, block, 0, 1, 0, 1, "
    "exterior) in 2D, region(n7, block, 0, 1, 0, 1, INF, INF, exterior) in 3D",
    "region r block 0 1 0 1 1 2 units box": "region(r, block, 0, 1, 0, 1, 1, 2) in 3D",
    "region r sphere 0 1 0 3 side in": "region(r, cylinder, 0, 1, 3) in 2D, "
    "region(r, sphere, 0, 1, 0, 3) in 3D" + LENGTHS,
    "region r sphere 0 1 2 3 units box": "region(r, sphere, 0, 1, 2, 3) in 3D",
    "region r cylinder z 1 2 3 0 4 units box": "region(r, cylinder, 1, 2, 3) in 2D, "
    "region(r, cylinder, z, 1, 2, 3, 0, 4) in 3D",
    "region r cylinder x 1 2 3 EDGE 4 units box": "region(r, cylinder, x, 1, 2, 3, INF, 4) in 3D",
    "region r union 2 box 1": "region(r, union, box, n1)",
    "region r intersect 2 box 1": "region(r, intersection, box, n1)",
    "group g region 1": "group(g, particles, region, n1, all)",
    "fix g all gravity 2 vector 3 0 4": "fix(g, body_force, all, 1.2, 0, 1.6) in 3D",
    "fix g all gravity 9.80665 vector 0 -1 0": "fix(g, body_force, all, 0, -9.80665, 0)",
    "fix g all gravity 1.23456789 vector -1 0 0": "fix(g, body_force, all, -1.23456789, 0, 0)",
    "fix 2 lower move linear NULL -0.1 0": "fix(n2, velocity_particles, lower, NULL, -0.1, 0)"
    + LENGTHS,
    "fix m lower move linear 0 1 0 units box": "fix(m, velocity_particles, lower, 0, 1, 0)",
    "velocity all set 1 0 0 units box": "fix(v_all, initial_velocity_particles, all, 1, 0, 0)",
    "velocity lower set NULL 2 NULL": "fix(vy_lower, initial_velocity_particles, lower, NULL, 2, "
    "NULL)" + LENGTHS,
    "velocity lower set 1 2 NULL units box": "fix(vxy_lower, initial_velocity_particles, lower, "
    "1, 2, NULL)",
    "dump d all atom 5 d.txt": "dump(d, all, particle, 5, d.txt, x, y, z)",
    "dump d all custom 5 d.*.gz id type x vx": "dump(d, all, particle/gz, 5, d.*.gz, x, vx)",
    "dump 1 lower custom 5 d.* id x xs fx c_1 v_a": "dump(n1, all, particle, 5, d.*, x), without "
    "xs fx c_1 v_a, of all points",
    "dump 1 all custom 5 d.* id c_1[2]": "dump(n1, all, particle, 5, d.*, x, y, z), without c_1[2]",
    "unfix 3": "delete_fix(n3)",
    "uncompute Ek": "delete_compute(Ek)",
    "undump old": "delete_dump(old)",
    "variable r index 3": "r = 3",
    "variable r equal 2*v_conv_rate": "r = 2*conv_rate",
    "variable r equal log(v_conv_rate)+ln(2)": "r = log10(conv_rate)+log(2)",
    'variable r equal "2 * sqrt(v_conv_rate^2 + 1e-3)"': "r = 2*sqrt(conv_rate^2+1e-3)",
    "variable r equal -v_conv_rate*2^-1": "r = -conv_rate*2^-1",
    "variable r equal time<2*dt&&v_conv_rate>1": "r = time < 2*dt && conv_rate > 1",
    "variable r atom atan2(y,x)*PI": "r = atan2(y, x)*PI",
}
SCENE = """\
method(ulmpm, FLIP, linear, 1)
dimension({d}, {domain}, 0.5)
region(box, block, {box})
region(n1, block, {box})
material(rubber, linear, 1000, 1e6, 0.3)
solid(body, region, box, 1, rubber, 0.5)
group(lower, particles, region, box, all)
conv_rate = 3
fix(n3, local_damping, all, 0.1)
compute(Ek, kinetic_energy, all)
dump(old, all, particle, 10, old.*, x, y, z)
"""


def lines_in(hint: str, d: int) -> list[str]:
    """The lines to be written in `d` dimensions."""
    if regions := re.findall(r"(region\([^()]*\)) in (\d)D", hint):
        return [line for line, of in regions if of == str(d)]
    if hint.endswith("in 3D") and d == 2:
        return []
    return re.findall(r"^(?:\w+ = .*|\w+\([^()]*\))", hint)


@pytest.mark.parametrize("line", HINTS)
def test_what_a_line_is_here(run_interpreted, line):
    said = run_interpreted(f"{line}\nrun 1\n", status=1).err
    hint = re.search(r":1:\d+: error: [^\n]*\n(?:.*\n){2,3}?hint: ([^\n]*)", said)[1]
    assert hint == HINTS[line]
    ran = 0
    for d in (2, 3):
        head = SCENE.format(d=d, domain=", ".join(["-1, 2"] * d), box=", ".join(["0, 1"] * d))
        for ours in lines_in(hint, d):
            run_interpreted(f"{head}{ours}\nset_dt(1e-4)\nrun(1)\n", folder=f"in_{d}")
            ran += 1
    assert ran


def test_the_table_writes_commands_that_there_are():
    for rule in table()["line"]:
        for command in re.findall(r"(\w+)\(", rule["here"]):
            assert registry.knows("command", command), rule


def test_lines_for_velocities_do_not_replace_each_other():
    lines = ["all set 1 0 0", "lower set 2 0 0", "all set NULL 3 NULL", "y_all set 2 0 0"]
    made = [line_of("velocity", line.split()).split(",")[0] for line in lines]
    assert len(set(made)) == len(lines)


def test_the_logarithm_of_lammps_is_that_of_base_10(run_interpreted):
    ours = line_of("variable", ["a", "equal", "log(100)+ln(exp(3))+v_b"])
    assert "a = 6\n" in run_interpreted(f'b = 1\n{ours}\nprint("sum", a)\n').out


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("region r block 0 1 0 1 0 1 units lattice", "in units of length, not of a lattice"),
        ("region r block 0 ${L} 0 1 0 1", "region(ID, block, "),
        ("region r sphere 0 0 0 v_a", "region(ID, block, "),
        ("region r sphere 0 0 0 1 move v_a NULL NULL", "region(ID, block, "),
        ("region r prism 0 1 0 1 0 1 0 0 0", "region(ID, block, "),
        ("region r union 2 a", "region(ID, union, regionID, regionID)"),
        ("group g type 1", "group(ID, particles, region, regionID, all)"),
        ("dump d all image 10 d.jpg type type", "dump(ID, all, pyplot, every, file, ...)"),
        ("dump d all custom 0 d.txt x", "dump(ID, all, particle, every, file, ...)"),
        ("dump d all custom ${n} d.txt x", "dump(ID, all, particle, every, file, ...)"),
        ("dump d all custom 10 d.bin x", "dump(ID, all, particle, every, file, ...)"),
        ("boundary p p f", "no end is periodic here; leave it out"),
    ],
)
def test_of_what_is_not_the_same_the_form_is_told(line, said):
    name, *words = line.split()
    assert said in line_of(name, words)


@pytest.mark.parametrize(
    "line",
    ["region r block 0 1 0 1", "fix g all gravity v_a vector 0 1 0", "fix s all setforce 0 0 0",
     "fix g all gravity 9.81 chute 20", "fix g all gravity 9.81 vector 0 0 0", "dump d",
     "velocity all create 300 4711", "thermo v_n", "timestep", "timestep 0", "unfix", "unfix ${a}",
     "boundary reflect", "velocity all set ${L} 0 0", "velocity all set v_a 0 0",
     "velocity all set 1 0 0 units lattice", "velocity all set 1 0 0 sum yes",
     "fix m all move linear ${L} 0 0", "fix m all move linear v_a 0 0",
     "fix m all move linear 1 0 0 units lattice", "fix m all move wiggle 1 0 0 2"],
)  # fmt: skip
def test_where_more_has_to_be_known_nothing_is_made_up(line):
    name, *words = line.split()
    assert line_of(name, words) is None


@pytest.mark.parametrize(
    "formula",
    ["c_1[2]", "${b}", "xcm(all,x)", "ramp(0,1)", "step", "ke", "bound(all,xmax)", "x", "vol",
     "random(0,1,5)", "round(v_a)", "v_a%2", "!v_a", "-v_a^2", "2^3^2", "-sqrt(v_a)^2", "v_a==1<2",
     "atan2(v_a v_b)", "2*v_dt", "2**3", "2*", "(2", "2)", "sqrt(2,3)", "v_a|^v_b", "f_1"],
)  # fmt: skip
def test_a_formula_that_may_not_be_the_same_is_not_copied(formula):
    assert line_of("variable", ["a", "equal", *formula.split()]) is None


@pytest.mark.parametrize("name", ["dt", "x", "PI", "run", "sqrt", "and", "NULL"])
def test_a_name_that_is_taken_is_not_assigned(name):
    assert line_of("variable", [name, "equal", "3"]) is None


@pytest.mark.parametrize(("wrong", "more"), [(43, ""), (201, ""), (202, "1 more mistake behind")])
def test_of_a_long_script_every_line_is_told_or_how_many_more_there_are(
    run_interpreted, wrong, more
):
    said = run_interpreted("".join(f"unfix {k}\n" for k in range(wrong)), status=1).err
    assert len(re.findall(r":\d+:\d+: error: ", said)) == min(wrong, 201)
    assert f"error: and {more}" in said if more else "more mistake" not in said
