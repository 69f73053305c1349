"""Several processes that share a scene: the bits of one.

Here they are threads that talk as processes do, interpreted; the last tests start processes.
"""

from itertools import cycle
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from combinations import MESHED, scene, write_mesh
from going_on import CURVE, SCENES, same_files, with_files
from scenes import SCHEMES, block
from selection import few, parameters
from states import same_bits
from test_contact_points import bodies
from test_heat import HOT, slab
from test_restart import some_ways

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run import tiles
from karamelo_py.run.mpi.partition import SharedTiles, bisected, work_of
from karamelo_py.run.mpi.plan import bytes_of_node, plan
from karamelo_py.run.mpi.subdomain import Load
from karamelo_py.scene.hub import Hub

MOVING = (
    "fix(v, initial_velocity_particles, all, 0.9+sin(40*x0), 0.5*cos(70*y0))",
    "log_modify(custom, step, time)",
    "set_output(1000)",
    "dt_factor(0.4)",
)


def shared(state_interpreted, tmp_path, script: str, ranks: int = 2) -> bool:
    whole = state_interpreted(script, boxes=True, out="whole")
    parts = state_interpreted(script, boxes=True, ranks=ranks, out="parts")
    same_files(tmp_path / "whole", tmp_path / "parts")
    return same_bits(whole, parts)


WAYS = [*zip(SCHEMES, cycle(("FLIP", "APIC")), strict=False)]


# The others are in a way below.
@pytest.mark.parametrize("scheme, transfer", parameters([WAYS[0], WAYS[3]], WAYS[1:3]))
def test_schemes(state_interpreted, tmp_path, scheme, transfer):
    script = block(2, *MOVING, "run(13)", scheme=scheme, transfer=transfer, size=(0.3, 0.2))
    assert shared(state_interpreted, tmp_path, with_files(script, "restart(5, r.*.h5)\n"))


# Of these a sibling shows the same: in the other frame, by a formula, at an edge, in space.
SHOWN = {f"{part} in the total frame" for part in ("loads", "flow", "heat")}
SHOWN |= {"rigid by a formula", "rate of plastic strain", "reflected", "bench"}
SHOWN.add("flow with averaged volumes")


@pytest.mark.parametrize("name", few(SCENES, *(name for name in SCENES if name not in SHOWN)))
def test_every_part(state_interpreted, tmp_path, name):
    """Contact, heat, damage, edges, tools, computes that look back."""
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    # Without memory: both run in one process here.
    script = SCENES[name].replace("pumps.", "shoves.")
    assert shared(state_interpreted, tmp_path, with_files(script))


@pytest.mark.parametrize("way", some_ways(), ids=lambda way: " ".join(filter(None, way)))
def test_every_way(state_interpreted, tmp_path, way):
    """Methods, bases, transfers, schemes and kinematics; three ranks."""
    option = way[3]
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    script = with_files(scene(*way, mesh=mesh, steps=4))
    assert shared(state_interpreted, tmp_path, script, ranks=3)


DUMPS = (
    "dump(t, all, particle/gz, 6, t.gz, x, y, vx, s11)",
    "dump(b, all, particle/bin, 6, b.*.bin, x, y, x0, volume, type)",
    "dump(h, all, hdf5, 6, h.h5, x, y, seq)",
)


NODES = (
    "dump(g, all, grid, 5, g.*.txt, x, vx, fy, mass, vol, rigid, bx, by, ntypex, mask, T)",
    "dump(o, all, grid/hdf5, 5, o.h5, y, vy_update, vol, occupied=true)",
    "dump(v, all, grid/vtk, 5, v.*.vtu, vol, by, occupied=true)",
    "region(left, block, INF, 0.6, INF, INF)",
    "group(left, nodes, region, left, all)",
    "fix(n, force_nodes, left, 3, -1)",
    "fix(f, force_particles, all, 2, 1)",
)


@pytest.mark.parametrize("method", few(("ulmpm", "tlmpm", "ulmpm/contacts"), "ulmpm/contacts"))
def test_nodes_in_pieces(state_interpreted, tmp_path, method):
    """Also what points bring to nodes for a dump alone, and before the first step."""
    script = block(2, *NODES, *MOVING, "run(11)", size=(0.3, 0.2))
    script = script.replace("method(ulmpm,", f"method({method},")
    assert shared(state_interpreted, tmp_path, script, ranks=3)


def test_dumps_in_pieces(state_interpreted, tmp_path):
    """16 ids after another, with points that are not there any more: the bytes of all at once."""
    script = block(
        2, "boundary(delete)", *DUMPS, MOVING[0].replace("0.9", "12"), *MOVING[1:], "run(16)",
        ppc=3, size=(0.2, 0.2),
    ).replace("dimension(2, 0, 1.2", "dimension(2, 0, 0.8")  # fmt: skip
    assert shared(state_interpreted, tmp_path, script)
    with h5py.File(tmp_path / "parts" / "h.h5") as file:
        assert np.isnan(file["x"][-1]).any() and len(file["id"]) > 32


def test_what_is_asked_between_two_runs(state_interpreted, tmp_path):
    """All ask for points, and for a file."""
    script = block(
        2, MOVING[0], *MOVING[2:],
        "run(4)", "c = value(xcm(all, x))", "write_restart(between.h5)",
        "fix(w, initial_velocity_particles, all, c, 0)",
        "run(3)", size=(0.3, 0.2),
    )  # fmt: skip
    assert shared(state_interpreted, tmp_path, script)


@pytest.mark.parametrize("dimension", few((1, 2, 3), 2))
def test_pictures(state_interpreted, tmp_path, dimension):
    """From far to near, with the light of all points; 16 of them after others."""
    script = block(
        dimension, "dump(p, all, pyplot, 4, p.*.png, 2, 2, vx)", *MOVING[1:],
        "dump(q, all, pyplot, 4, q.svg, 2, 2, seq, vmin=0)", "dump(m, all, movie, 2, m.gif, 1, 1)",
        f"fix(v, initial_velocity_particles, all, 0.9+sin(40*x0){', 0' * (dimension - 1)})",
        "run(5)", size=(0.3, 0.2, 0.2)[:dimension],
    )  # fmt: skip
    assert shared(state_interpreted, tmp_path, script, ranks=3)


def test_state_of_another_run(state_interpreted, tmp_path):
    """Each process reads its own share between two runs, and can write it at once."""
    script = block(2, MOVING[0], *MOVING[3:], "set_output(2)", size=(0.3, 0.2))
    state_interpreted(script + "run(5)\nwrite_restart(w.h5)\n", boxes=True, out="first")
    (tmp_path / "w.h5").write_bytes((tmp_path / "first" / "w.h5").read_bytes())
    again = "read_restart(w.h5)\nwrite_restart(r.h5)\nrun(4)\n"
    assert shared(state_interpreted, tmp_path, with_files(script + again), ranks=3)


HALVED = (
    "fix(v, initial_velocity_particles, all, 0.05*sin(40*x0), 0.03*cos(30*y0))",
    "dt_factor(1.9)", "set_output(5)", "log_modify(custom, step, dt, time)",
    "dump(d, all, particle, 5, d.txt, x, vx)", "run(60, on_trouble=halve)",
)  # fmt: skip


# Two bodies that touch, of which usavg remembers what contact has done, in the place of one.
TOUCHING = {
    "method(ulmpm,": "method(ulmpm/contacts,",
    "region(box, block, 0.3, 0.6,": "region(right, block, 0.45, 0.6, 0.3, 0.5)\n"
    "region(box, block, 0.3, 0.45,",
    "sin(40*x0)": "sin(20*x0)",
    "solid(body,": "solid(other, region, right, 2, rubber, 0.1, 0)\nsolid(body,",
}


@pytest.mark.parametrize("changes", few(({}, TOUCHING), {}), ids=["one body", "contact"])
def test_a_step_that_is_halved(state_interpreted, tmp_path, changes):
    """Each process goes back to what it kept; files hold it, as those of one process do."""
    script = block(2, *HALVED, size=(0.3, 0.2), scheme="usavg" if changes else "musl")
    for old, new in changes.items():
        assert old in script
        script = script.replace(old, new)
    script = script.replace("run(60", "run(24")
    assert shared(state_interpreted, tmp_path, with_files(script, "restart(6, r.*.h5)\n"), ranks=3)
    with h5py.File(tmp_path / "parts" / "r.12.h5") as file:
        assert not changes or file["good/touched/rows"][()].any()
    log = (tmp_path / "parts" / "log.mpm").read_text(encoding="utf-8").split()
    assert float(log[-2]) < 0.6 * float(log[4])


LARGE_STEPS = (
    "fix(v, initial_velocity_particles, all, 4)", "fix(g, body_force, all, 5)", "set_dt(0.008)",
    "set_output(1000)", "run(500)",
)  # fmt: skip
LOW = (0.3, 0.1)
FAILING = {
    "fix g gets NaN from sqrt(0.02 - time)": block(
        2, "fix(g, body_force, all, sqrt(0.02-time), 0)", "set_dt(0.005)", "run(9)", size=LOW
    ),
    "fix g gets inf at (0.5, 0.3) from": block(
        2, "fix(g, body_force, all, if(time < 0.02, 0, 1/(x-0.5)), 0)", "set_dt(0.005)",
        "run(9)", size=LOW,
    ),
    "fix g gets NaN at (0.": block(
        2, "fix(g, force_particles, all, if(time < 0.02, 0, sqrt(0.4-x0)), 0)", "set_dt(0.005)",
        "run(9)", size=LOW,
    ),
    "leaves the domain at (1.2": block(
        2, "fix(v, initial_velocity_particles, all, 10+3*y0, 0)", "set_dt(0.004)",
        "run(20)", size=LOW,
    ),
    "is turned inside out": block(
        2, "fix(v, velocity_nodes, all, -100*(x0-0.35), 0)", "set_dt(0.02)", "run(5)",
        size=(0.1, 0.2),
    ),
    'last_good.5.h5" -out "of 1"\n': block(
        2, "fix(v, initial_velocity_particles, all, 0.4*sin(30*x0), 0)", "set_dt(0.002)", "run(5)",
        "set_dt(0.04)", "run(500)", size=LOW,
    ),
    "the stability limit, which has fallen to": block(1, *LARGE_STEPS, size=(0.2,)).replace(
        "0, 1.2", "0, 120"
    ),
    "domain of point": block(
        2, "fix(v, initial_velocity_particles, all, 3*sin(17*y0), 3*sin(13*x0))", "run(50)",
        law="soft", size=LOW,
    ).replace("(ulmpm, FLIP, linear, 1", "(ulcpdi, FLIP, linear, 1, Q4"),
    "less than a millionth of the first": block(
        1, "fix(push, velocity_nodes, all, -8*(x0-0.3))", "set_output(1000)", "run_time(1/8)",
        law="soft", size=(0.2,),
    ).replace("(ulmpm", "(tlmpm").replace("linear, 2", "neo-hookean, 2"),
}  # fmt: skip


# What is told of a step that has become too large is in test_failures.py, too.
LARGE = "the stability limit, which has fallen to", "less than a millionth of the first"


@pytest.mark.parametrize("says", few(FAILING, *(says for says in FAILING if says not in LARGE)))
def test_what_went_wrong(state_interpreted, tmp_path, says):
    """Each process looks at its own points: message, log and last good state are those of one."""
    script = FAILING[says] + "\n"
    one, three = (
        state_interpreted(script, boxes=True, ranks=ranks, out=f"of {ranks}", fails=True)
        for ranks in (1, 3)
    )
    there = one.replace("of 1/", "of 3/").replace('"of 1"', '"of 3"')
    assert says in one and there == three
    same_files(tmp_path / "of 1", tmp_path / "of 3")


COMPUTES = """\
region(left, block, INF, 0.55, INF, INF)
group(left, particles, region, left, all)
compute(P, linear_momentum, all)
compute(L, angular_momentum, left, 0.3, 0.2)
compute(V, average_velocity, left)
compute(s, average_stress, left)
compute(T, average_temperature, all)
compute(c, center_of_mass, left)
group(low, nodes, region, left, all)
compute(n, center_of_mass, low)
compute(q, position_quantile, all, 0.37)
compute(m, max_position, left)
compute(e, max_plastic_strain, all)
compute(e1, error, left, velocity, 0.9, x0*time, L1)
compute(e2, error, all, stress, 0, 0, y, L2, relative)
compute(em, error, all, ux, 0.9*time, max)
compute(r, reference, all, ../curve.csv, vx, relative)
compute(rm, reference, left, ../curve.csv, vx, max)
compute(p, probe, left, s11, volume)
compute(p3, probe, left, vx, point=3)
compute(at, probe, all, vy, x=0.52, y=0.41)
fix(F, force_particles, left, 3, -1)
fix(check, check_solution, left, 0.1*time*x0, 0)
pull = external_force(left, x)
log_modify(custom, step, P_x, P_drift, L_z, L_drift, V_x, s_11, s_12, T, c_x, c_y, n_x, n_y, q_x, &
           q_y, m_x, m_y, e_Epmax, e1, e1_max, e2, e2_history, em, em_history, r, r_curve, rm, &
           p_s11, p_volume, p3, at, check_s, check_z, pull, xcm(left, y))
set_output(3)
"""


def test_computes_by_shares(state_interpreted, tmp_path):
    """Sums without rounding, largest values, and values at a point."""
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    script = block(2, COMPUTES.replace("&\n", ""), MOVING[0], *MOVING[3:], "run(6)",
                   transfer="APIC", size=(0.3, 0.2))  # fmt: skip
    # With a temperature, whose mean is shown.
    script = script.replace(
        "material(rubber, linear, 2, 100, 0.3)", "material(rubber, linear, 2, 100, 0.3, 1, 0.1)"
    )
    assert "0.3, 1, 0.1" in script
    assert shared(state_interpreted, tmp_path, script, ranks=3)
    log = (tmp_path / "parts" / "log.mpm").read_text(encoding="utf-8")
    assert "nan" not in log and len(log.split()) > 100


def test_nobody_asks_for_the_whole(state_interpreted, tmp_path):
    """Dumps, computes, fixes and files take share after share: what gathers the scene is gone."""
    lines = (
        "compute(p, linear_momentum, all)", "compute(m, max_position, all)",
        "compute(e, error, all, ux, 0.1*time)", "compute(at, probe, all, s11, x=0.4)",
        "group(n, nodes, region, box, all)", "compute(c, center_of_mass, n)",
        "compute(E, energy_balance, all)",
        "fix(s, python, all, shoves.sway_alone, final_integrate)",
        "fix(f, force_particles, all, 3, sin(9*x0))", "fix(a, edge_pressure, all, box, 2)",
        "dump(d, all, particle, 3, d.txt, x, vx, s11)", "dump(v, all, vtk, 3, v.*.vtu, seq)",
        "dump(g, all, grid, 3, g.*.txt, vx, mass, vol)", "dump(h, all, grid/hdf5, 3, h.h5, mass)",
        "dump(p, all, pyplot, 3, p.*.png, 3, 3, vx)", "restart(3, r.*.h5)",
        "region(two, block, 0.59, 0.69, 0.3, 0.5)", "solid(two, region, two, 2, rubber, 0.1, 0)",
        "fix(h, contact/hertz, body, two)",
        "log_modify(custom, step, E_drift, p_x, m_x, e, at, c_y, f_y, a_x, s_x, h_x)",
    )  # fmt: skip
    script = block(2, *lines, MOVING[0], *MOVING[3:], "run(6)", size=(0.3, 0.3))
    said = state_interpreted(script, boxes=True, ranks=2, out="parts", fails=True)
    assert "error" not in said and (tmp_path / "parts" / "r.6.h5").exists()


@pytest.mark.parametrize("parts", [2, 3, 4, 8])
def test_tiles_are_cut_in_halves(parts):
    """A ball of tiles of equal work: each part has its share of them, but for the halves of tiles
    that three cuts leave; of eight each has an octant.
    """
    places = np.argwhere(np.ones((12, 12, 12), bool)) * 8.0
    work = (((places - 44) ** 2).sum(axis=1) < 32**2).astype(np.int64)
    part = bisected(places, work, parts)
    shares = np.bincount(part, work)
    assert len(shares) == parts and np.abs(shares - work.sum() / parts).max() <= 1.5
    if parts == 8:
        for k in range(8):
            assert np.ptp(places[(part == k) & (work > 0)], axis=0).max() <= 24


def test_a_bar_is_cut_in_its_length():
    """Of places of 8 x 8 x 128 cells, 3 x 3 x 2: the face has 24 x 24 cells, not 24 x 256."""
    places = np.argwhere(np.ones((3, 3, 2), bool)) * (8.0, 8.0, 128.0)
    part = bisected(places, np.ones(18, np.int64), 2)
    assert set(places[part == 0, 2]) == {0.0} and set(places[part == 1, 2]) == {128.0}


@pytest.mark.parametrize(("length", "across"), [(6, 0), (12, 0), (36, 2)])
def test_rows_of_nodes_are_cut_in_long_bars_only(length, across):
    """Cubes, and bars twice as long in the last direction, are cut across the first."""
    places = np.argwhere(np.ones((6, 6, length), bool)) * 8.0
    part = bisected(places, np.ones(len(places), np.int64), 2, rows=4)
    assert places[part == 0, across].max() < places[part == 1, across].min()


def hub_in_tiles(monkeypatch, *lines: str) -> Hub:
    """A scene in 1D in tiles of 4 cells, sorted."""
    monkeypatch.setattr(tiles, "TILES", {1: 4})
    monkeypatch.setattr(tiles, "DIRECT_UP_TO", 0)
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    head = ("method(ulmpm, FLIP, linear, 1)", "dimension(1, 0, 3.6, 0.1)")
    hub.interpreter.run_text("\n".join([*head, *lines]), "bar")
    hub.simulation.sort()
    return hub


def test_what_two_pass_on(monkeypatch):
    """A bar from cell 4 to 20 in tiles of 4 cells, two points per cell, linear functions.

    The last point before the border is at 11.75 cells, and may go one further: it sees node 13 at
    most. The first one behind it, at 12.25, sees node 11 at least. Three nodes are in use by both.
    """
    hub = hub_in_tiles(
        monkeypatch, "region(bar, block, 0.4, 2)", "material(a, linear, 1, 1, 0.3)",
        "solid(bar, region, bar, 2, a, 0.1, 0)",
    )  # fmt: skip
    first, second = plan(hub.simulation, 2)
    assert (first.points, first.tiles, first.others) == (16, 2, 1)
    assert first.sent == second.sent == 3 * bytes_of_node(hub.simulation)


def test_tiles_are_cut_by_work(monkeypatch):
    """Four tiles of one law, then four of another, eight points each.

    Where those of the first take 3 each, all take 16: the cut is at 8, in the third, and a tile is
    of the one that has its middle. With 7 for the others it is at 16 of 32, in the sixth.
    """
    hub = hub_in_tiles(
        monkeypatch, "region(a, block, 0, 1.6)", "region(b, block, 1.6, 3.2)",
        "material(a, linear, 1, 1, 0.3)", "material(b, neo-hookean, 1, 1, 0.3)",
        "solid(a, region, a, 2, a, 0.1, 0)", "solid(b, region, b, 2, b, 0.1, 0)",
    )  # fmt: skip
    method, blocks = hub.update.method, hub.simulation.setup.blocks
    two = SharedTiles(
        SimpleNamespace(rank=0, size=2), method.lattices(hub), method.basis, 128, False,
        one_space=False,
    )  # fmt: skip
    of_first = {(1, 1, 0): 4, (3, 1, 0): 3, (1, 1, 1000): 4, (1, 7, 0): 6}
    for costs, count in of_first.items():
        two.share_out(work_of(two.loads(blocks), np.array(costs)))
        assert np.count_nonzero(two.owner[:8] == 0) == count, costs


@pytest.mark.parametrize("scheme", few(("usf", "usavg"), "usf"))
def test_touching_bodies_on_their_way(state_interpreted, tmp_path, scheme):
    """What contact remembers of a node goes with it from process to process."""
    script = f"""
method(ulmpm/contacts, FLIP, linear, 1)
scheme({scheme})
dimension(2, 0, 2, 0, 2, 0.1)
region(a, block, 0.3, 0.5, 0.2, 0.4)
region(b, block, 0.5, 0.7, 0.2, 0.4)
material(m, neo-hookean, 1, 100, 0)
solid(a, region, a, 2, m, 0.1, 0)
solid(b, region, b, 2, m, 0.1, 0)
group(a, particles, region, a, solid, a)
group(b, particles, region, b, solid, b)
fix(va, initial_velocity_particles, a, 45, 60)
fix(vb, initial_velocity_particles, b, 40, 60+20*y0)
set_dt(0.001)
set_output(1000)
run(12)
"""
    assert shared(state_interpreted, tmp_path, with_files(script), ranks=3)


@pytest.mark.parametrize("method", few(("ulmpm", "ulmpm/contacts"), "ulmpm/contacts"))
def test_points_moved_by_python(state_interpreted, tmp_path, method):
    """At the start of a step, in each of them: others have the points then."""
    script = block(
        2, "fix(c, python, all, shoves.carry)", *DUMPS, *MOVING, "run(14)", ppc=3, size=(0.3, 0.1)
    ).replace("method(ulmpm,", f"method({method},")
    assert shared(state_interpreted, tmp_path, with_files(script, "restart(5, r.*.h5)\n"), ranks=3)


SWAYING = """\
region(everywhere, block, INF, INF, INF, INF)
group(nodes, nodes, region, everywhere, all)
fix(a, python, nodes, shoves.sway, post_particles_to_grid)
fix(b, python, nodes, shoves.sway, post_velocities_to_grid)
fix(c, python, all, shoves.sway, post_grid_to_point)
fix(d, python, all, shoves.sway, post_advance_particles)
fix(e, python, all, shoves.sway, final_integrate)
log_modify(custom, step, a_x, b_y, c_x, d_y, e_x)
"""
# What looks at each point on its own, at moments at which others act on the whole.
BESIDE = (
    "fix(f, python, nodes, shoves.sway_alone, post_particles_to_grid)",
    "fix(g, python, all, shoves.sway_alone, final_integrate)",
)
WARMING = """
    fix(a, python, end, shoves.warm, post_heat_to_grid)
    fix(b, python, end, shoves.warm, post_update_grid_heat)
    fix(c, python, all, shoves.warm, supply_heat)
"""


@pytest.mark.parametrize("script", ["sways", "warms", "sways alone"])
def test_python_at_every_moment(state_interpreted, tmp_path, script):
    scripts = {
        "sways": block(2, SWAYING, *BESIDE, MOVING[0], *MOVING[3:], "set_output(3)", "run(7)",
                       size=(0.3, 0.2)),
        "sways alone": block(2, SWAYING.replace("sway,", "sway_alone,"), MOVING[0], *MOVING[3:],
                             "set_output(3)", "run(7)", size=(0.3, 0.2)),
        "warms": slab(HOT.format(301) + WARMING, ", hot_s", "run(6)"),
    }  # fmt: skip
    assert shared(state_interpreted, tmp_path, with_files(scripts[script]), ranks=3)


@pytest.mark.parametrize(
    "function, says",
    [
        ("is_silent", "is_silent returns 1.0 on one process and None on another"),
        ("asks", "reaches its end on one process, and a total on another"),
        ("differs", "differs returns 0.1 on one process and 1.1 on another"),
    ],
)
def test_a_function_answers_otherwise_on_one_process(state_interpreted, function, says):
    lines = f"fix(f, python, all, shoves.{function}, final_integrate)", "set_output(1)", "run(9)"
    script = block(2, MOVING[0], *lines, size=(0.2, 0.2))
    assert says in state_interpreted(script, boxes=True, ranks=2, fails=True)
    assert state_interpreted(script, boxes=True)["time"][1] == 9  # alone it is well


@pytest.mark.parametrize("beside", [(), ("fix(p, python, all, shoves.push)",)])
def test_points_that_touch(state_interpreted, tmp_path, beside):
    """The pairs lie on several processes; also where all points are at one already."""
    contact = "contact/minimize_penetration, a, b, 0.2"
    lines = "log_modify(custom, step, c_x, c_y)", "set_output(1)", "set_dt(0.002)", "run(9)"
    script = bodies(-0.01, contact, *beside, *lines, d=2, n=2)
    assert shared(state_interpreted, tmp_path, with_files(script), ranks=3)
    assert np.loadtxt(tmp_path / "parts" / "log.mpm", skiprows=1)[:, 1].min() < 0


def test_a_load_by_a_reaction(state_interpreted, tmp_path):
    """What a fix publishes is read within the next step; other sums wait for the end of the run."""
    lines = (
        "region(low, block, INF, INF, 0.25, 0.35)", "group(low, nodes, region, low, all)",
        "fix(wall, velocity_nodes, low, NULL, 0)", "fix(g, body_force, all, 0, 3*wall_y - 9)",
        "log_modify(custom, step, wall_y, g_y)", "set_output(3)", "dt_factor(0.4)", "run(12)",
    )  # fmt: skip
    script = block(2, *lines, size=(0.3, 0.2))
    assert shared(state_interpreted, tmp_path, with_files(script), ranks=3)
    log = (tmp_path / "parts" / "log.mpm").read_text(encoding="utf-8")
    assert float(log.split()[-2]) != 0


def test_costs_are_measured(monkeypatch):
    """Ten steps of 3 points at 100 ns, 10 at 50 ns and 4 nodes at 10 ns, and a pause."""
    now = 0
    monkeypatch.setattr("time.perf_counter_ns", lambda: now)
    work = Load(2)
    for _ in range(10):
        work.resume(0)
        for taken in (300, 500):
            now += taken
            work.note()
            work.next_block()
        work.resume()
        now += 40
        work.note()
    work.pause()
    now += 10**9
    work.note()
    work.done([3, 10, 4], 10)
    work.learn(SimpleNamespace(allreduce=lambda numbers: numbers))
    assert work.costs.tolist() == [100, 50, 10]
