"""Results that do not depend on how they are computed: the same bits, or nearly so.

Nothing here compares with a formula; the other tests do.
"""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scenes import SCHEMES, TRANSFERS, block
from selection import parameters
from states import final_hub, same_bits, state_of

from karamelo_py.kernels.arrays import arrays_of
from karamelo_py.kernels.totals import WORK
from karamelo_py.run import tiles


@pytest.fixture(autouse=True)
def boxes(monkeypatch):
    """Compiled, too, points give to boxes of several tiles, as many points do."""
    monkeypatch.setattr(tiles, "DIRECT_UP_TO", 0)
    monkeypatch.setattr(tiles, "TILES", {1: 8, 2: 6, 3: 4})


# --- interpreted: every choice ----------------------------------------------------------------

MOVING = (
    "fix(v, initial_velocity_particles, all, 0.9+sin(40*x0), 0.5*cos(70*y0))",
    "log_modify(custom, step, time)",
    "set_output(1000)",
    "dt_factor(0.1)",
)
# What acts on points splits the step into its stages, also when it acts on no point.
STAGES = (
    "region(nowhere, block, 1.1, 1.15, 1.1, 1.15)",
    "group(none, particles, region, nowhere, all)",
    "fix(nothing, velocity_particles, none, 0, 0)",
)
WAYS = [
    *product(SCHEMES, ("FLIP", "APIC"), ("linear",)),
    *product(SCHEMES, ("PIC",), ("neo-hookean",)),
    ("musl", "FLIP 0.9", "rate=none"),
]
CHOSEN = [
    ("musl", "FLIP", "linear"), ("usl", "APIC", "linear"), ("usf", "PIC", "neo-hookean"),
    ("usavg", "APIC", "linear"), ("musl", "FLIP 0.9", "rate=none"),
]  # fmt: skip
every_combination = pytest.mark.parametrize(
    "scheme, transfer, law", parameters(CHOSEN, [way for way in WAYS if way not in CHOSEN])
)


@every_combination
def test_any_way_through_a_run(state_interpreted, scheme, transfer, law):
    """Runs in pieces, other outputs, stage by stage: all the same bits."""
    options = {"scheme": scheme, "transfer": transfer, "law": law, "size": (0.2, 0.2)}
    outputs = "set_output(2)", "dump(d, all, particle, 3, d.*.txt, x, s11)"
    whole, pieces, staged = (
        state_interpreted(block(2, *MOVING, *lines, **options), boxes=True)
        for lines in (
            ["run(9)"],
            [*outputs, "run(4)", "run(0)", "run(5)"],
            [*STAGES, "run(9)"],
        )
    )
    assert same_bits(whole, pieces)
    assert same_bits(whole, staged)


# --- compiled: threads ------------------------------------------------------------------------


def crossing(d: int, *lines: str, transfer="FLIP", scheme="musl", laws=("linear", "neo-hookean"),
             precision="double") -> str:  # fmt: skip
    """Two bodies that fly through each other's tiles: several tiles in each direction."""
    sizes = {2: (0.8, 1.0), 3: (0.4, 0.5, 0.3)}[d]
    far = ", ".join(f"{0.1 + 0.1 * k}, {0.1 + 0.1 * k + size}" for k, size in enumerate(sizes))
    near = ", ".join(f"{1.1 - 0.1 * k}, {1.1 - 0.1 * k + size}" for k, size in enumerate(sizes))
    domain = ", ".join(["0, 2.2"] * d)
    h = {2: 0.05, 3: 0.1}[d]
    kinds = {"linear": "linear, 2, 100, 0.3", "neo-hookean": "neo-hookean, 3, 80, 0.2"}
    fly = {2: "0.5*sin(7*x0)", 3: "0.5*sin(7*x0), 0.3*y0"}[d]
    return "\n".join(
        [
            f"method(ulmpm, {TRANSFERS[transfer]})",
            f"scheme({scheme})",
            f"precision({precision})",
            f"dimension({d}, {domain}, {h})",
            f"region(far, block, {far})",
            f"region(near, block, {near})",
            f"material(m1, {kinds[laws[0]]})",
            f"material(m2, {kinds[laws[-1]]})",
            f"solid(far, region, far, 2, m1, {h}, 0)",
            f"solid(near, region, near, 2, m2, {h}, 0)",
            "group(far, particles, region, far, solid, far)",
            "group(near, particles, region, near, solid, near)",
            f"fix(v1, initial_velocity_particles, far, 2, {fly})",
            f"fix(v2, initial_velocity_particles, near, -2, {fly})",
            "set_output(1000)",
            "dt_factor(0.4)",
            *lines,
        ]
    )


# Loads on all nodes, and on some by formula; walls that meet, one of them rough.
AT_NODES = (
    "region(left, block, -1, 0.16, INF, INF)",
    "region(base, block, INF, INF, -1, 0.21)",
    "group(left, nodes, region, left, all)",
    "group(base, nodes, region, base, all)",
    "fix(load, body_force, all, 0.3*cos(3*y)*time, -0.5)",
    "fix(left, velocity_nodes, left, 0, NULL)",
    "fix(base, velocity_nodes, base, NULL, 0, mu=0.3)",
)
# Points that are led, and what leads them told in the log.
AT_POINTS = ("fix(lead, velocity_particles, far, 2 + 0.1*sin(7*x0)*cos(time), NULL)",)


@pytest.fixture
def state(tmp_path, monkeypatch):
    """The exact state at the end of a script, compiled."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "in.script"

    def run(script, threads=1):
        path.write_text(script, encoding="utf-8")
        hub = final_hub(path, threads)
        totals = {"values": hub.values.array.copy(), "work": hub.simulation.control.totals[WORK]}
        return state_of(hub) | totals

    return run


@pytest.mark.parametrize(
    "d, transfer, scheme, laws",
    [
        (2, "FLIP", "musl", ("linear", "neo-hookean")),
        pytest.param(2, "PIC", "usl", ("linear",), marks=pytest.mark.full),
        pytest.param(3, "APIC", "usf", ("neo-hookean",), marks=pytest.mark.full),
    ],
)
@pytest.mark.xdist_group("identical")
def test_one_thread_or_two(state, d, transfer, scheme, laws):
    """Sums at the nodes are made in one order; sorting sets in several times."""
    # USL needs small steps where bodies reach nodes with next to no mass (benchmark C6).
    factor = "dt_factor(0.05)" if scheme == "usl" else "dt_factor(0.4)"
    acting = {"FLIP": AT_NODES, "PIC": (*AT_NODES, *AT_POINTS), "APIC": ()}[transfer]
    factor += "\ncompute(lost, transfer_loss, all)"
    script = crossing(d, *acting, factor, "run(60)", transfer=transfer, scheme=scheme, laws=laws)
    assert same_bits(state(script), state(script, threads=2))


OPTIMISED = """
import sys
from pathlib import Path
import numpy as np
from karamelo_py.compiler.code import machine
from karamelo_py.run import tiles
from states import final_state
assert machine.LEVEL == 3
tiles.DIRECT_UP_TO, tiles.TILES = 0, {1: 8, 2: 6, 3: 4}
np.savez("optimised.npz", **final_state(Path("in.script")))
"""


@pytest.mark.xdist_group("identical")
def test_optimisation_changes_no_bit(state):
    """LLVM's passes, which other tests leave out."""
    plain = state(crossing(2, *AT_NODES, "run(60)"))
    environment = {**os.environ, "KARAMELO_PY_OPTIMISATION": "3"}
    environment["PYTHONPATH"] += os.pathsep + str(Path(__file__).parent)
    subprocess.run([sys.executable, "-c", OPTIMISED], env=environment, check=True)
    with np.load("optimised.npz") as optimised:
        assert same_bits({name: plain[name] for name in optimised}, dict(optimised))


@pytest.mark.xdist_group("identical")
def test_few_points_give_straight_to_the_nodes(state, monkeypatch):
    """On one thread or two the same; other groups of the same sums, so to round-off as by boxes.

    Round-off of 60 steps: 1e-12 of places of order 1 is 5000 times that of one operation.
    """
    script = crossing(2, "run(60)")
    by_boxes = state(script)
    monkeypatch.setattr(tiles, "DIRECT_UP_TO", 10**6)
    straight = state(script)
    assert same_bits(straight, state(script, threads=2))
    assert np.abs(straight["x"] - by_boxes["x"]).max() < 1e-12


@pytest.mark.xdist_group("identical")
def test_any_way_through_a_compiled_run(state):
    """As above, compiled, where products and sums contract."""
    whole = state(crossing(2, "run(100)"))
    assert same_bits(whole, state(crossing(2, "run(50)", "run(50)")))
    assert same_bits(whole, state(crossing(2, "dump(d, all, particle, 7, d.*.txt, x)", "run(100)")))


@pytest.mark.xdist_group("identical")
def test_order_of_points(tmp_path):
    """The order within tiles follows from places and ids, not from the order before: so restarts
    go on as if nothing had been."""
    path = tmp_path / "in.script"
    path.write_text(crossing(2, "run(50)"), encoding="utf-8")
    simulation = final_hub(path).simulation
    orders = []
    for seed in (1, 2):
        for one in simulation.setup.blocks:
            shuffled = np.random.default_rng(seed).permutation(one.points.id.size)
            for _, array in arrays_of(one.points):
                array[:] = array[..., shuffled]
        simulation.sort()
        orders.append([one.points.id.copy() for one in simulation.setup.blocks])
    assert all(np.array_equal(a, b) for a, b in zip(*orders, strict=True))
    assert simulation.tiles.sorts > 3


@pytest.mark.full
def test_compiled_stages(state):
    """Fused and staged, each compiled into one piece, give the same bits."""
    stages = [line.replace("1.1, 1.15", "2.1, 2.15") for line in STAGES]
    whole = state(crossing(2, "run(100)"))
    assert same_bits(whole, state(crossing(2, *stages, "run(100)")))


# --- single precision -------------------------------------------------------------------------


@pytest.mark.xdist_group("single")
def test_single_precision(state):
    """Numbers are single (everywhere: the next test), and close to those in double.

    Each of 40 steps rounds to 6e-8; stress comes from differences of velocities over a cell and is
    rounded to 6e-8 E (= 6e-6), so velocities of order 2 differ by dt f/m of that: below 1e-4. Where
    a point crosses into a cell without others, one step earlier or later, more may differ. Those of
    transfers with moments: test_bench.py.
    """
    # Of a given size: one that points choose may end its longer beginning a step earlier.
    lines = ("set_dt(1.5e-3)", "run(40)")
    double = state(crossing(2, *lines, laws=("linear",)))
    single = state(crossing(2, *lines, laws=("linear",), precision="single"))
    for name in ("x", "v"):
        assert single[name].dtype == np.float32
        assert double[name].dtype == np.float64
    assert np.abs(single["x"] - double["x"]).max() < 1e-5
    assert np.abs(single["v"] - double["v"]).max() < 1e-3


@pytest.mark.xdist_group("single")
def test_single_precision_arrays(tmp_path, monkeypatch):
    """Half the memory: no field of a point or a node is double."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "in.script"
    script = crossing(2, "run(1)", laws=("linear",), precision="single")
    path.write_text(script, encoding="utf-8")
    setup = final_hub(path).simulation.setup
    *nodes, own = setup.nodes
    arrays = [*nodes, *(array for kind in own for array in kind)]
    for one in setup.blocks:
        arrays += [array for _, array in arrays_of(one.points)] + [*one.laws]
    real = [array for array in arrays if array.dtype.kind == "f"]
    assert len(real) > 7
    assert {array.dtype for array in real} == {np.dtype(np.float32)}
