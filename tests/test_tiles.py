"""Boxes of tiles: no point gives to a node outside of them, and few nodes are there in vain.

Few points give straight to the nodes, which cannot go wrong: that is what boxes are held against.
"""

from itertools import product
from math import inf

import numpy as np
import pytest
from selection import few, parameters

from karamelo_py.kernels.hooks import POINT_STAGES
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.lower.memory import PAGE, bytes_in, nodes_in_use
from karamelo_py.run.tiles import ROUNDING, SHARES
from karamelo_py.scene.hub import Hub

# Two bodies that pass each other, at 0.7 of a cell per step and more: sorted at every other one.
PASSING = """
method({method})
scheme({scheme})
{more}
dimension(2, 0, 2, 0, 1, 0.1)
region(left, block, 0.2, 0.5, 0.2, 0.3)
region(right, block, 1.5, 1.8, 0.5, 0.6)
material(a, {law})
material(b, {other})
solid(left, region, left, 2, a, 0.1, {T})
solid(right, region, right, 2, b, 0.1, 0)
group(left, particles, region, left, solid, left)
group(right, particles, region, right, solid, right)
fix(v1, initial_velocity_particles, left, 70 + 3*sin(30*y0), 20)
fix(v2, initial_velocity_particles, right, -85 + 3*x0, -20)
set_dt(0.001)
set_output(1000)
run(6)
"""
WARM = {"law": "neo-hookean, 2, 100, 0.3, 2, 3", "T": 10}
KINDS = {
    "musl": {},
    "usl": {"scheme": "usl"},
    "usf": {"scheme": "usf", "method": "ulmpm, APIC, quadratic-spline"},
    "usavg": {"scheme": "usavg", "method": "ulmpm, FLIP, cubic-spline, 1"},
    "XPIC": {"method": "ulmpm, XPIC, quadratic-spline, 3"},
    "MLS": {"method": "ulmpm, MLS, quadratic-spline", "scheme": "usl"},
    "Bernstein": {"method": "ulmpm, FLIP, Bernstein-quadratic, 1"},
    "cpgimp": {"method": "ulmpm, FLIP, cpgimp, 1, stretch"},
    "corners": {"method": "ulcpdi, FLIP, linear, 1, Q4"},
    "averaged": {"more": "anti_volumetric_locking(true)"},
    "warm": {"method": "ulmpm, FLIP, linear, 1, thermo-mechanical", **WARM},
    "contact": {"method": "ulmpm/contacts, FLIP, linear, 1"},
    "two laws": {"other": "neo-hookean, 3, 80, 0.2"},
    "total": {"method": "tlmpm, FLIP, linear, 1"},
    "single": {"more": "precision(single)"},
}


IN_SPACE = {
    "dimension(2, 0, 2, 0, 1": "dimension(3, 0, 2, 0, 1, 0, 4",
    "0.2, 0.3)": "0.2, 0.3, 3, 3.4)",
    "0.5, 0.6)": "0.5, 0.6, 3, 3.4)",
    "left, 2, a": "left, 1, a",
    "right, 2, b": "right, 1, b",
    "y0), 20)": "y0), 20, 9*cos(30*z0))",
    "x0, -20)": "x0, -20, 5)",
}


def passing(method="ulmpm, FLIP, linear, 1", scheme="musl", law="linear, 2, 100, 0.3", **words):
    words = {"more": "", "T": 0, "other": law} | words
    return PASSING.format(method=method, scheme=scheme, law=law, **words)


# Where a point and its box end depends on the basis, and on what else is given to nodes.
ALIKE = {"usl", "XPIC", "MLS", "averaged", "two laws", "total", "single"}


@pytest.mark.parametrize("kind", few([*KINDS, "space"], *({*KINDS, "space"} - ALIKE)))
def test_fast_points_give_to_their_boxes(state_interpreted, kind):
    """What would be given outside a box would be missing, or at a node of another.

    Sums are grouped by boxes: the same to round-off, which grows by the steps.
    """
    script = passing(**KINDS.get(kind, {}))
    if kind == "space":  # one point per cell, in long tiles
        for line, other in IN_SPACE.items():
            assert line in script
            script = script.replace(line, other)
    straight, by_boxes = (state_interpreted(script, boxes=boxes) for boxes in (False, True))
    share = 1e-3 if kind == "single" else 1e-11  # of 1, the size of the domain
    assert straight["x"][:, 0].min() > 0.5  # the left one began at 0.2
    assert np.abs(straight["x"] - by_boxes["x"]).max() < share
    assert np.abs(straight["v"] - by_boxes["v"]).max() < 100 * share
    assert by_boxes["nodal mass"] == pytest.approx(straight["nodal mass"], rel=share)


LEAPING = """
method({method})
scheme({scheme})
dimension(2, 0, 4, 0, 3, 0.1)
region(low, block, 0.2, 0.4, 0.2, 0.3)
region(high, block, 3.4, 3.6, 2.5, 2.6)
material(m, neo-hookean, 2, 100, 0.3)
solid(low, region, low, 2, m, 0.1, 0)
solid(high, region, high, 2, m, 0.1, 0)
group(low, particles, region, low, solid, low)
group(high, particles, region, high, solid, high)
fix(v1, initial_velocity_particles, low, 70, 20)
fix(v2, initial_velocity_particles, high, -85, -5)
fix(leap, python, low, leaps.leap, {moment})
fix(weight, python, all, leaps.push, initial_integrate)
set_dt(0.001)
set_output(1000)
run(6)
"""
LEAPS = """
def leap(points):
    points.position[:] += {by}

def push(points):
    points.force[:] += points.mass[:, None] * points.velocity
"""


METHODS = [
    ("ulmpm, FLIP, linear, 1", "musl"), ("ulmpm, MLS, quadratic-spline", "usl"),
    ("ulmpm, APIC, cubic-spline", "usavg"), ("ulcpdi, FLIP, linear, 1, Q4", "usf"),
]  # fmt: skip
LEAPS_OF = [(*way, moment) for way in METHODS for moment in POINT_STAGES]
BY_TURNS = [(*METHODS[k % len(METHODS)], moment) for k, moment in enumerate(POINT_STAGES)]


@pytest.mark.parametrize(
    "method, scheme, moment", parameters(BY_TURNS, [way for way in LEAPS_OF if way not in BY_TURNS])
)
def test_points_that_python_moves_in_a_step_are_sorted(
    state_interpreted, tmp_path, method, scheme, moment
):
    """Beyond their boxes, by three cells per step where it begins and ends, between as far as
    points may go. Forces that grow as speeds act on all alike: dv/dt = v, and bodies stay rigid.
    """
    by = (0.31, 0.17) if moment.endswith("integrate") else (0.025, 0.075)
    (tmp_path / "leaps.py").write_text(LEAPS.format(by=by))
    script = LEAPING.format(method=method, scheme=scheme, moment=moment)
    before, after = (
        state_interpreted(script.replace("run(6)", end), boxes=True) for end in ("run(0)", "run(6)")
    )
    low = (before["x"][:, 0] < 2)[:, None]
    v = np.where(low, [70, 20], [-85, -5])
    factors = 1.001 ** np.arange(1, 7)  # of speeds, after each step
    moved = 0.001 * factors.sum() * v + np.where(low, 6 * np.array(by), 0)
    assert (after["x"] - before["x"])[:, :2] == pytest.approx(moved, abs=1e-12)
    assert after["v"] == pytest.approx(factors[-1] * v, rel=1e-11)
    assert after["nodal mass"] == pytest.approx(2 * 0.04, rel=1e-12)


DISK = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -{side}, {side}, -{side}, {side}, 0.1)
region(disk, cylinder, 0.011, 0.003, 2.82)
material(rubber, neo-hookean, 2, 100, 0.3)
solid(disk, region, disk, 2, rubber, 0.1, 0)
"""


def sorted_scene(side):
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(DISK.format(side=side))
    simulation = hub.simulation
    simulation.begin(inf)
    simulation.sort()
    return simulation


@pytest.mark.xdist_group("disks")
def test_few_nodes_are_visited_in_vain():
    """Of a disk of 10 000 points at most 1.5 times the nodes that have mass, in any domain.

    Nodes with mass are the corners of cells with points, for hats.
    """
    simulation = sorted_scene(side=4)
    assert simulation.count == pytest.approx(10_000, rel=0.01)
    cells = np.floor(simulation.hub.fields.position / 0.1).astype(int)
    corners = [cells + (i, j) for i in (0, 1) for j in (0, 1)]
    with_mass = len(np.unique(np.concatenate(corners), axis=0))
    used = nodes_in_use(simulation.setup)
    assert with_mass < used < 1.5 * with_mass
    far = sorted_scene(side=40)
    assert nodes_in_use(far.setup) < 1.05 * used
    assert far.tiles.occupied <= 1.5 * simulation.tiles.occupied


BAR = """
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, 1, 0, 1, 0, 20, 0.1)
region(bar, block, 0.2, 0.8, 0.2, 0.8, 1, 19)
material(rubber, linear, 1000, 1e6, 0.3)
solid(bar, region, bar, 1, rubber, 0.1, 0)
"""


# The same bar on a foot of four times its width.
FOOT = (
    BAR.replace("0, 1, 0, 1, 0, 20", "0, 3, 0, 3, 0, 20").replace(
        "block, 0.2, 0.8, 0.2, 0.8", "block, 1.2, 1.8, 1.2, 1.8"
    )
    + """
region(foot, block, 0.3, 2.7, 0.3, 2.7, 0.5, 1)
solid(foot, region, foot, 1, rubber, 0.1, 0)
"""
)


def test_long_tiles_reach_no_more_nodes_than_their_points():
    """Above the foot, beside the bar, its tiles have nodes in their boxes that nothing reaches.

    What points reach until the next sort are the corners of the cells that they may be in then.
    """
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(FOOT)
    simulation = hub.simulation
    simulation.begin(inf)
    simulation.sort()
    drift = simulation.control.motion[0].drift_limit + ROUNDING
    assert 0 < drift < 1
    ends = list(product((-drift, drift), repeat=3))
    cells = np.concatenate(
        [np.floor(simulation.hub.fields.position / 0.1 + end) for end in ends]
    ).astype(int)
    corners = np.concatenate([cells + corner for corner in product((0, 1), repeat=3)])
    assert nodes_in_use(simulation.setup) == len(np.unique(corners, axis=0))
    boxes = [block.tiling.box[: block.tiling.count[0]] for block in simulation.setup.blocks]
    sizes = [np.prod(box[:, 3:] - box[:, :3] + 1, axis=1).sum() for box in boxes]
    assert nodes_in_use(simulation.setup) < 0.5 * sum(sizes)


@pytest.mark.parametrize("threads", [1, 2])
def test_memory_of_nodes_is_gone_through_without_gaps(threads):
    """A bar of 180 cells in tiles of 128: its rows of nodes are whole, and one thread takes them
    all in the order of their numbers.
    """
    hub = Hub(Console(quiet=True))
    hub.settings.threads = threads
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(BAR)
    simulation = hub.simulation
    simulation.begin(inf)
    simulation.sort()
    ranges = simulation.setup.ranges
    rows = np.concatenate([ranges[begin:end] for begin, end in ranges[:SHARES]])
    assert (rows[:, 1] - rows[:, 0]).min() > 180
    assert (rows[:, 1] - rows[:, 0]).sum() == nodes_in_use(simulation.setup)
    assert threads > 1 or (np.diff(rows[:, 0]) > 0).all()


@pytest.mark.parametrize("rows", [1000, 200_000])
def test_large_arrays_take_large_pages(rows):
    """Rows of 64 bytes: those alone in a small array, in a large one the pages that they lie in,
    counted one by one.
    """
    spans = np.array([[0, 10], [20, 30], [500, 900], [901, 1000]]) * rows // 1000
    used = np.concatenate([np.arange(*span) for span in spans])
    pages = {row * 64 // PAGE for row in used}
    expected = 64 * len(used) if rows == 1000 else PAGE * len(pages)
    assert bytes_in(spans, np.zeros((rows, 8))) == expected
