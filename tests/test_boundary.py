"""boundary(error | delete | reflect): what happens to points that reach the edge of the domain."""

import re

import numpy as np
import pytest
from scenes import SCHEMES, TRANSFERS, block
from selection import few, parameters
from states import final_state, same_bits
from tensors import KINEMATICS

from comparisons.results import read_dump, read_log
from karamelo_py.points import transfers
from karamelo_py.points.grid import turned
from karamelo_py.points.transfers.quadratic import PolyPICQuadratic

SIZE = (0.3, 0.1, 0.1)
MASS = {1: 2 * 0.3, 2: 2 * 0.3 * 0.1, 3: 2 * 0.3 * 0.1 * 0.1}
COUNT = {1: 6, 2: 12, 3: 24}
# With steps of 0.001 no point lands on a node.
V = (9.7, 3.1, -2.1)
WATCH = (
    "dump(d, all, particle, 10, d.*.LAMMPS, x, y, z, vx, vy, vz, mass)",
    "log_modify(custom, step, time)",
    "set_output(1000)",
    "set_dt(0.001)",
)


def thrown(d: int, how: str, *lines: str, **options) -> str:
    """A soft block that flies over the edge x = 0.7; its points leave in steps 13 to 39."""
    velocity = ", ".join(map(str, V[:d]))
    fly = f"fix(v, initial_velocity_particles, all, {velocity})"
    options = {"law": "soft", "size": SIZE, **options}
    text = block(d, f"boundary({how})", fly, *WATCH, *lines, **options)
    return re.sub(rf"dimension\({d}, 0, [\d.]+", f"dimension({d}, 0, 0.7", text)


def single(d: int, how: str, *lines: str, transfer: str = "FLIP") -> str:
    """One force-free point that starts at 0.85 along each axis and flies out of the grid."""
    box = ", ".join(["0.8, 0.9"] * d)
    domain = ", ".join(["0, 1.2"] * d)
    velocity = ", ".join(map(str, V[:d]))
    return "\n".join(
        [
            f"method(ulmpm, {TRANSFERS[transfer]})",
            f"dimension({d}, {domain}, 0.1)",
            f"boundary({how})",
            f"region(box, block, {box})",
            "material(rubber, linear, 2, 1, 0.3)",
            "solid(body, region, box, 1, rubber, 0.1, 0)",
            f"fix(v, initial_velocity_particles, all, {velocity})",
            *WATCH,
            *lines,
        ]
    )


@pytest.mark.parametrize("d", [1, 2])
def test_error_is_the_default(run_interpreted, d):
    said = run_interpreted(thrown(d, "error", "run(35)"), status=1).err
    default = thrown(d, "error", "run(35)").replace("boundary(error)\n", "")
    assert (
        run_interpreted(default, status=1).err.replace(":12:", ":13:").splitlines()[0]
        == (said.splitlines()[0])
    )
    assert "leaves the domain" in said and "boundary(delete)" in said


def test_a_run_that_points_leave_resumes_with_them_deleted(run_interpreted):
    """With the command that the error gives; the arrays of error and delete are the same."""
    lost = run_interpreted(thrown(1, "error", "run(35)"), status=1)
    command, remark = re.search(r"resume: karamelo-py (.*?)  # (.*)", lost.err).groups()
    assert remark == "with boundary(delete)"
    words = command.split()[1:]
    resumed = run_interpreted(thrown(1, "delete", "run(35)"), *words)
    assert "deleted points" in resumed.out
    said = run_interpreted(thrown(1, "reflect", "run(35)"), *words, status=1).err
    assert "another scene: boundary error; here it is reflect" in said


def test_walls_of_grids_that_go_with_solids(run_interpreted):
    script = block(2, "boundary(reflect)", "run(1)").replace("ulmpm", "tlmpm")
    err = run_interpreted(script, status=1).err
    assert "no point can leave" in err and "fix(ID, contact/surface, all, region)" in err


@pytest.mark.parametrize(("last", "loose"), [(0.9, True), (0.6, False)])
def test_a_point_come_loose_from_its_solid_is_told(run_interpreted, last, loose):
    """Two points, 0.4 or 0.1 apart in cells of 0.1, fly over the edge at x = 1.2."""
    text = single(2, "error", "run(200)").replace(
        "region(box, block, 0.8, 0.9, 0.8, 0.9)",
        "region(near, block, 0.5, 0.6, 0.5, 0.6)\n"
        f"region(far, block, {last}, {last + 0.1:g}, 0.5, 0.6)\n"
        "region(box, union, near, far)",
    )
    said = run_interpreted(text, status=1).err
    assert "leaves the domain" in said
    assert ("numerical fracture" in said) == loose


@pytest.mark.parametrize("d", few((1, 2, 3), 1, 2))
def test_deleted_points_are_gone(run_interpreted, d):
    """Dumps show the other points under their ids; nodes have only the mass of those."""
    result = run_interpreted(
        thrown(d, "delete", "dump(g, all, grid, 10, g.*.LAMMPS, x, mass)", "run(28)")
    )
    left = result.dump("d.28.LAMMPS")
    before = result.dump("d.10.LAMMPS")
    assert len(before.id) == COUNT[d]
    assert 0 < len(left.id) < COUNT[d]
    assert set(left.id) < set(before.id)
    assert left.x.max() <= 0.7
    assert (before.x[~np.isin(before.id, left.id)] > 0.55).all()
    each = MASS[d] / COUNT[d]
    assert left.mass == pytest.approx(np.full(len(left.id), each))
    assert result.dump("g.28.LAMMPS").mass.sum() == pytest.approx(each * len(left.id), rel=1e-7)
    assert result.err.count("warning:") == 1 and "is deleted" in result.err
    assert f"deleted points    {COUNT[d] - len(left.id)}" in result.out


@pytest.mark.parametrize("d", few((1, 2, 3), 1, 2))
@pytest.mark.parametrize("transfer", ["FLIP", "PIC", "APIC"])
def test_a_reflected_point_is_a_mirror_image(run_interpreted, d, transfer):
    """x = 1.2 - |0.85 + v t - 1.2| and -v across the edge, exactly; other components unchanged."""
    last = run_interpreted(single(d, "reflect", "run(60)", transfer=transfer)).dump("d.60.LAMMPS")
    free = [0.85 + v * 0.06 for v in V[:d]]
    for k, name in enumerate("xyz"[:d]):
        expected = 2.4 - free[k] if free[k] > 1.2 else free[k]
        assert last[name] == pytest.approx([expected], abs=1e-8)
        sign = -1 if free[k] > 1.2 else 1
        assert last["v" + name] == pytest.approx([sign * V[k]], rel=1e-9)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_gradient_of_a_reflected_point_is_a_mirror_image(d):
    """The mirror image of the field v = L x is R v(R x)."""
    L, R = np.arange(1.0, d * d + 1).reshape(d, d), np.diag([-1.0, 1.0, -1.0][:d])
    mirror_image = [R @ L @ R @ x for x in np.eye(d)]
    tensor = KINEMATICS[d - 1].Tensor
    found = turned(tensor._make([L[place] for place in tensor.places]), tuple(np.diag(R)))
    image = np.array(mirror_image).T
    assert list(found) == [image[place] for place in tensor.places]
    assert turned((), tuple(np.diag(R))) == ()


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_curvature_of_a_reflected_point_is_a_mirror_image(d):
    """The mirror image of the field v = c x_i x_j is R c (R x)_i (R x)_j."""
    kin, signs = KINEMATICS[d - 1], (-1.0, 1.0, -1.0)[:d]
    zero = transfers.zero_moment(PolyPICQuadratic(), kin, 0.0)
    c = np.arange(1.0, 1 + d * len(zero.curved)).reshape(-1, d)
    found = turned(zero._replace(curved=tuple([kin.Vector._make(of) for of in c])), signs)
    x = np.array([0.3, -0.7, 1.1][:d])

    def field(curved, x):
        pairs = [(i, j) for i in range(d) for j in range(i, d)]
        return sum(np.array(of) * x[i] * x[j] for of, (i, j) in zip(curved, pairs, strict=True))

    assert field(found.curved, x) == pytest.approx(signs * field(c, signs * x))


@pytest.mark.parametrize("d", few((1, 2, 3), 1, 2))
def test_a_single_point_is_deleted_or_reflected_at_the_lower_edge(run_interpreted, d):
    script = single(d, "reflect", "run(100)").replace("all, 9.7", "all, -9.7")
    last = run_interpreted(script).dump("d.100.LAMMPS")
    assert last.x == pytest.approx([0.12], abs=1e-8)
    assert last.vx == pytest.approx([9.7], rel=1e-9)
    said = run_interpreted(single(d, "delete", "run(100)"), status=1).err
    assert "all points have left the domain" in said and "step 37," in said


@pytest.mark.parametrize("d", few((1, 2, 3), 1, 2))
def test_a_reflected_drop(run_interpreted, d):
    """Mass and momentum along the edge are conserved, and no point leaves."""
    result = run_interpreted(thrown(d, "reflect", "run(35)"))
    last = result.dump("d.35.LAMMPS")
    assert len(last.id) == COUNT[d]
    assert last.mass.sum() == pytest.approx(MASS[d])
    assert last.x.max() <= 0.7
    for k, name in enumerate(("vx", "vy", "vz")[:d]):
        momentum = last.mass @ last[name]
        if k:
            assert momentum == pytest.approx(V[k] * MASS[d], rel=1e-6)
        else:
            assert momentum < 0
    assert result.err.count("warning:") == 1 and "were reflected" in result.err
    assert "reflections" in result.out


def test_a_body_pressed_to_a_reflecting_edge_gains_energy(run_interpreted):
    """A block of rubber falls on the edge: the warning names the cause and a fix."""
    said = run_interpreted("""
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 0.12, 0, 0.12, 0.02)
        boundary(reflect)
        region(block, block, 0.04, 0.08, 0.02, 0.06)
        material(rubber, neo-hookean, 1000, 1e6, 0.3)
        solid(block, region, block, 2, rubber, 0.02, 0)
        fix(v, initial_velocity_particles, all, 0, -8)
        run(60)
    """).err
    assert "energy balance: spurious gain" in said
    assert "pressed against an edge of the domain" in said and "fix velocity_nodes" in said


# A fix on points splits a step into separate stages, even if its group is empty.
STAGES = (
    "region(nowhere, block, 1.1, 1.15, 1.1, 1.15)",
    "group(none, particles, region, nowhere, all)",
    "fix(nothing, velocity_particles, none, 0, 0)",
)


DELETED = [("delete", scheme) for scheme in SCHEMES]
REFLECTED = [("reflect", scheme) for scheme in SCHEMES]


@pytest.mark.parametrize(
    "how, scheme", parameters([DELETED[0], REFLECTED[0]], [*DELETED[1:], *REFLECTED[1:]])
)
def test_the_same_bits_in_pieces(state_interpreted, how, scheme):
    """In one run, in several with outputs, and in separate stages, while points leave."""
    options = {"scheme": scheme, "law": "linear"}
    whole = state_interpreted(thrown(2, how, "run(28)", **options))
    assert (how == "delete") == bool((whole["mass"] == 0).any())
    cut = ("run(13)", "run(5)", "run(3)", "run(1)", "run(6)")
    cut = ("dump(e, all, particle, 3, e.*.LAMMPS, x)", *cut)
    assert same_bits(whole, state_interpreted(thrown(2, how, *cut, **options)))
    assert same_bits(whole, state_interpreted(thrown(2, how, *STAGES, "run(28)", **options)))


# Compiled, points are reflected in test_lanes.py.
@pytest.mark.parametrize("how", few(("delete", "reflect"), "delete"))
@pytest.mark.xdist_group("boundary")
def test_the_same_bits_on_two_threads(tmp_path, monkeypatch, how):
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "in.script"
    # Wide enough for several tiles in each direction.
    text = thrown(2, how, "run(28)", law="linear", size=(0.3, 0.6), ppc=3)
    script.write_text(
        text.replace("1.2, 0.1)", "1.2, 0.05)").replace("rubber, 0.1", "rubber, 0.05")
    )
    assert same_bits(final_state(script, threads=1), final_state(script, threads=2))


def test_what_is_deleted_stays_so(run_interpreted):
    """Adding a solid, which rebuilds the arrays, brings no deleted point back."""
    lines = (
        "run(25)",
        "region(late, block, 0.1, 0.2, 0.1, 0.2)",
        "solid(late, region, late, 2, rubber, 0.1, 0)",
        "run(1)",
    )
    result = run_interpreted(thrown(2, "delete", *lines))
    before, after = result.dump("d.25.LAMMPS"), result.dump("d.26.LAMMPS")
    assert set(after.id) == set(before.id) | {13, 14, 15, 16}
    assert list(after.type[-4:]) == [2] * 4


def test_a_fix_that_remembers_counts_each_step_once(run_interpreted, tmp_path):
    """Steps are repeated after points are deleted."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "counting.py").write_text(
        "remembers = ('steps',)\nsteps = 0\n\n\n"
        "def count(points):\n    global steps\n    steps += 1\n    return steps\n"
    )
    lines = ("fix(c, python, all, counting.count)", "log_modify(custom, step, c)", "run(28)")
    log = run_interpreted(thrown(2, "delete", *lines, "set_output(7)")).log
    assert log.c[-1] == log.Step[-1] == 28


def test_groups_and_computes_go_on_without_the_deleted(run_interpreted):
    result = run_interpreted(
        thrown(
            2,
            "delete",
            "compute(v, average_velocity, all)",
            "compute(far, max_position, all)",
            "compute(near, min_position, all)",
            "compute(Ek, kinetic_energy, all)",
            "log_modify(custom, step, v_x, far_x, near_x, Ek)",
            "set_output(10)",
            "run(28)",
        )
    )
    log, last = read_log(result.folder / "log.mpm"), result.dump("d.28.LAMMPS")
    assert log.v_x[-1] == pytest.approx(last.vx.mean(), rel=1e-8)
    assert log.far_x[-1] == pytest.approx(last.x.max(), rel=1e-8)
    assert log.near_x[-1] == pytest.approx(last.x.min(), rel=1e-8)
    energy = 0.5 * last.mass @ (last.vx**2 + last.vy**2)
    assert log.Ek[-1] == pytest.approx(energy, rel=1e-8)
    assert len(read_dump(result.folder / "d.28.LAMMPS")) == 1


SPLASH = """
    method(ulmpm/contacts, FLIP, linear, 1)
    dimension(1, 0, 10, 0.01)
    boundary(delete)
    region(block, block, 1.6, 1.7)
    region(bullet, block, 1, 1.02)
    region(splash, block, 9.325, 9.335)
    material(heavy, neo-hookean, 100, 10000, 0)
    material(light, neo-hookean, 1, 1, 0)
    solid(block, region, block, 2, heavy, 0.01, 0)
    solid(bullet, region, bullet, 2, light, 0.01, 0)
    solid(splash, region, splash, 1, light, 0.01, 0)
    group(block, particles, region, block, solid, block)
    group(bullet, particles, region, bullet, solid, bullet)
    group(splash, particles, region, splash, solid, splash)
    fix(vb, initial_velocity_particles, bullet, 50)
    fix(vc, initial_velocity_particles, splash, {v})
    compute(a, average_velocity, block)
    compute(b, average_velocity, bullet)
    compute(c, average_velocity, splash)
    log_modify(custom, step, a_x, b_x, c_x)
    set_dt(0.00015)
    set_output(1000)
    run(99)
"""


# Closer together: a fifth of the cells and a quarter of the steps.
NEARER = {
    "0, 10, 0.01": "1.4, 2.5, 0.01", "block, 1, 1.02": "block, 1.5, 1.52",
    "9.325, 9.335": "2.345, 2.355", "run(99)": "run(25)",
}  # fmt: skip


@pytest.mark.parametrize("nearer", few((NEARER, {}), NEARER))
def test_going_back_leaves_no_contact_behind(run_interpreted, nearer):
    """The splash leaves some steps after the impact, and the run goes back to before the impact.

    Nodes must retain nothing of the discarded steps. A group without points shows 0.
    """
    text = SPLASH
    for old, new in nearer.items():
        assert old in text
        text = text.replace(old, new)
    stays = run_interpreted(text.format(v=0), folder="stays").log
    leaves = run_interpreted(text.format(v=50), folder="leaves").log
    assert stays.b_x[-1] < 0  # the bullet has hit
    assert (leaves.a_x[-1], leaves.b_x[-1]) == (stays.a_x[-1], stays.b_x[-1])
    assert leaves.c_x[0] == 50 and leaves.c_x[-1] == 0


def test_nan_is_no_edge(run_interpreted):
    """A point at NaN is not deleted: the run ends with an error."""
    lines = ("fix(g, body_force, all, sqrt(0.02-time), 0)", "run(200)")
    assert "not a number" in run_interpreted(thrown(2, "delete", *lines), status=1).err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("method(ulmpm, FLIP, linear, 1)", "method(tlmpm, FLIP, linear, 1)", "grid of its solid"),
        ("method(ulmpm, FLIP, linear, 1)", "method(ulcpdi, FLIP, linear, 1, mechanical, Q4)",
         "boundary(reflect) does not support Q4 domains"),
        ("boundary(reflect)", "boundary(bounce)", "must be one of error, delete, reflect"),
    ],
)  # fmt: skip
def test_what_is_refused(run_interpreted, old, new, says):
    script = thrown(2, "reflect", "run(10)").replace(old, new)
    said = run_interpreted(script, status=1).err
    assert says in said and re.search(r"^ +\d+ \| (boundary|method)\(", said, re.M)


def test_points_in_contact_may_be_deleted(state_interpreted):
    """The other points stay in contact, on one process and on two."""
    lines = (
        "region(two, block, 0.6, 0.7, 0.3, 0.4)",
        "solid(two, region, two, 2, rubber, 0.1, 0)",
        "fix(push, contact/hertz, body, two)",
        "run(30)",
    )
    script = thrown(2, "delete", *lines)
    whole = state_interpreted(script, boxes=True)
    assert same_bits(whole, state_interpreted(script, boxes=True, ranks=2))
    assert not whole["mass"].all()  # that of what is not there is 0


TWO_BODIES = (
    "region(two, block, 0.1, 0.2, 0.3, 0.4)",
    "material(neo, neo-hookean, 2, 100, 0.3)",
    "solid(two, region, two, 2, neo, 0.1, 0)",
    "run(42)",
)


def test_the_last_points_of_a_law_leave(state_interpreted):
    """Loops over the points of a law may become empty, also on a process that has no others."""
    script = thrown(2, "delete", *TWO_BODIES).replace(
        "velocity_particles, all", "velocity_particles, b"
    )
    script = script.replace("fix(v,", "group(b, particles, region, box, solid, body)\nfix(v,")
    whole = state_interpreted(script, boxes=True)
    assert 0 < np.count_nonzero(whole["mass"]) < len(whole["mass"])
    assert same_bits(whole, state_interpreted(script, boxes=True, ranks=2))
