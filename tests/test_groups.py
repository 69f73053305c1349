"""Groups of points and of nodes."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from hubs import SmallHub, arguments

from karamelo_py.commands.domain import group
from karamelo_py.points.basis.bernstein_quadratic import BernsteinQuadratic
from karamelo_py.points.basis.linear import Linear
from karamelo_py.scene.group import AnyGroup, NodeGroup, ParticleGroup
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.methods.base import Method
from karamelo_py.styles.methods.ulmpm import TLMPM
from karamelo_py.styles.methods.ulmpm_contacts import ULMPMContacts
from karamelo_py.styles.regions import BlockRegion, Cylinder, Difference


def scene():
    """Two squares of 4 x 4 points each in a unit square with cells of 0.1."""
    hub = SmallHub(2, 0, 1, 0.1)
    hub.solid("s1", hub.region("r1", BlockRegion, 0, 0.2, 0, 0.2))
    hub.solid("s2", hub.region("r2", BlockRegion, 0.5, 0.7, 0.5, 0.7))
    return hub


def test_points_by_reference_position():
    hub = scene()
    low = hub.region("low", BlockRegion, "INF", "INF", 0, 0.05)
    group(hub, "g", "particles", "region", low, "all")
    np.testing.assert_array_equal(hub.groups["g"].ids, [0, 2, 8, 10])
    assert hub.groups["g"].ids.dtype == np.int64
    assert not hub.groups["g"].all


def test_points_of_named_solids():
    hub = scene()
    everywhere = hub.region("e", BlockRegion, "INF", "INF", "INF", "INF")
    s1, s2 = hub.solids["s1"], hub.solids["s2"]
    group(hub, "second", "particles", "region", everywhere, "solid", s2)
    np.testing.assert_array_equal(hub.groups["second"].ids, np.arange(16, 32))
    group(hub, "both", "particles", "region", everywhere, "solid", s2, s1, s2)
    np.testing.assert_array_equal(hub.groups["both"].ids, np.arange(32))


def test_an_id_again_adds_members():
    hub = scene()
    s1, s2 = hub.solids["s1"], hub.solids["s2"]
    group(hub, "g", "particles", "region", hub.regions["r2"], "solid", s2)
    kept = hub.groups["g"]
    group(hub, "g", "particles", "region", hub.regions["r1"], "solid", s1)
    assert hub.groups["g"] is kept
    np.testing.assert_array_equal(kept.ids, np.arange(32))
    with pytest.raises(ScriptError, match="is a group of particles"):
        group(hub, "g", "nodes", "region", hub.regions["r1"], "all")


def test_points_made_later_are_no_members():
    hub = scene()
    group(hub, "g", "particles", "region", hub.region("e", BlockRegion, *["INF"] * 4), "all")
    hub.solid("s3", hub.region("r3", BlockRegion, 0.5, 0.7, 0, 0.2))
    kept, everyone = hub.groups["g"], ParticleGroup(hub, everything=True)
    ids = np.array([47, 31, 0, 32])
    assert kept.has(ids).tolist() == [False, True, True, False] and everyone.has(ids).all()
    assert len(kept) == 32 and len(everyone) == 48
    for some in (kept, everyone):
        bits = np.unpackbits(some.bits(70), bitorder="little")
        assert len(bits) == 128 and np.flatnonzero(bits[:48]).tolist() == some.ids.tolist()
    assert [kept.touches(solid) for solid in hub.solids.values()] == [True, True, False]


def test_a_group_is_a_bit_a_point():
    """Which of ten points of ten million are members takes a few bytes to say."""
    count = 10**7
    solid = SimpleNamespace(id="s", first_id=0, count=count)
    one = ParticleGroup.of(SimpleNamespace(solids={"s": solid}), solid)
    tracemalloc.start()
    assert one.has(np.arange(count - 5, count + 5)).tolist() == [True] * 5 + [False] * 5
    assert tracemalloc.get_traced_memory()[1] < 10_000
    assert len(one.bits(count)) == count / 8
    assert len(one) == count
    assert tracemalloc.get_traced_memory()[1] < count
    tracemalloc.stop()


def test_nodes_by_position():
    """A disc of radius 0.2, h = 0.05, centred on a node holds 49 nodes (reference, section 4.5)."""
    hub = SmallHub(2, -0.5, 0.5, 0.05)
    group(hub, "g", "nodes", "region", hub.region("d", Cylinder, 0.1, -0.1, 0.2), "all")
    assert len(hub.groups["g"]) == 49


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("exterior", [(), ("exterior",)])
def test_nodes_in_a_box_are_all_nodes_in_it(dimension, exterior):
    hub = SmallHub(dimension, 0, 1, 0.15)
    region = hub.region("r", BlockRegion, *[0.3, 0.75] * dimension, *exterior)
    group(hub, "g", "nodes", "region", region, "all")
    want = np.flatnonzero(region.inside(hub.lattices[0].positions()))
    np.testing.assert_array_equal(hub.groups["g"].nodes, want)
    assert len(want)


def test_open_ends_take_in_the_nodes_beyond_the_domain():
    hub = SmallHub(2, 0, 1, 0.3)  # the grid reaches to 1.2
    group(hub, "g", "nodes", "region", hub.region("r", BlockRegion, 0, 0, "INF", "INF"), "all")
    np.testing.assert_array_equal(hub.groups["g"].nodes, np.arange(5))


def test_nodes_far_away_are_none():
    hub = SmallHub(2, 0, 1, 0.1)
    for k, bounds in enumerate([(3, 4, 0, 1), (-5, -4, 0, 1), (0.01, 0.02, 0, 1)]):
        group(hub, f"g{k}", "nodes", "region", hub.region(f"r{k}", BlockRegion, *bounds), "all")
        assert len(hub.groups[f"g{k}"]) == 0
    assert len(hub.warnings) == 3


def test_all_is_everything_also_later():
    hub = scene()
    points = ParticleGroup.from_script(hub, arguments("all")[0])
    nodes = NodeGroup.from_script(hub, arguments("all")[0])
    assert points.all and nodes.all and AnyGroup.from_script(hub, arguments("all")[0]).all
    assert len(nodes.nodes) == 121
    assert len(points.ids) == 32
    hub.solid("s3", hub.region("r3", BlockRegion, 0.8, 0.9, 0.8, 0.9))
    assert len(points.ids) == 36


def test_points_made_later_do_not_join():
    hub = scene()
    group(hub, "g", "particles", "region", hub.regions["r1"], "all")
    hub.solid("s3", hub.regions["r1"])
    assert len(hub.groups["g"]) == 16


@pytest.mark.parametrize("method", [TLMPM, ULMPMContacts])
def test_nodes_of_grids_made_later_join(method):
    hub = SmallHub(2, 0, 1, 0.1)
    hub.use(method, Linear())
    r1 = hub.region("r1", BlockRegion, 0, 0.2, 0, 0.2)
    r2 = hub.region("r2", BlockRegion, 0.5, 0.7, 0.5, 0.7)
    group(hub, "g", "nodes", "region", r2, "all")
    s1 = hub.solid("s1", r1)
    group(hub, "one", "nodes", "region", r1, "solid", s1)
    before = hub.groups["one"].nodes
    hub.solid("s2", r2)
    both = np.concatenate([lattice.positions() for lattice in hub.lattices])
    np.testing.assert_array_equal(hub.groups["g"].nodes, np.flatnonzero(r2.inside(both)))
    np.testing.assert_array_equal(hub.groups["one"].nodes, before)
    assert len(hub.groups["g"]) and not hub.warnings


def test_nodes_of_the_grid_of_a_method_that_comes_later():
    """Functions with nodes in the middle of cells number the nodes in their own way."""
    hub = SmallHub(1, 0, 1, 0.25)
    hub.update.method = None
    group(hub, "g", "nodes", "region", hub.region("r", BlockRegion, 0.5, 1), "all")
    np.testing.assert_array_equal(hub.groups["g"].nodes, [2, 3, 4])
    hub.use(Method, BernsteinQuadratic())
    np.testing.assert_array_equal(hub.groups["g"].nodes, [4, 5, 6, 7, 8])


def test_groups_by_name():
    hub = scene()
    group(hub, "p", "particles", "region", hub.regions["r1"], "all")
    group(hub, "n", "nodes", "region", hub.regions["r1"], "all")
    assert ParticleGroup.from_script(hub, arguments("p")[0]) is hub.groups["p"]
    assert AnyGroup.from_script(hub, arguments("n")[0]) is hub.groups["n"]
    with pytest.raises(ScriptError) as caught:
        NodeGroup.from_script(hub, arguments("p")[0])
    assert "group 'p' is a group of particles" in str(caught.value)
    assert "a group of nodes" in caught.value.expected
    assert caught.value.hint == "all, or group(p_nodes, nodes, region, ...)"
    with pytest.raises(ScriptError) as caught:
        AnyGroup.from_script(hub, arguments("q")[0])
    assert caught.value.mark.column == 3


def test_empty_groups_are_warned_about():
    hub = SmallHub()
    group(hub, "g", "particles", "region", hub.region("r", BlockRegion, 0, 1, 0, 1), "all")
    assert "holds no particles" in hub.warnings[0]


@pytest.mark.parametrize(
    ("ID", "of", "solids", "says"),
    [
        ("all", "all", (), "cannot be changed"),
        ("g", "solid", (), "no solid is named"),
        ("g", "all", ("s1",), "nothing can follow 'all'"),
    ],
)
def test_wrong_groups(ID, of, solids, says):
    hub = scene()
    with pytest.raises(ScriptError, match=says):
        group(
            hub,
            ID,
            "particles",
            "region",
            hub.regions["r1"],
            of,
            *[hub.solids[s] for s in solids],
        )


def test_a_rehearsal_leaves_groups_alone():
    hub = scene()
    group(hub, "g", "particles", "region", hub.regions["r1"], "all")
    rehearsed = hub.rehearsal()
    group(rehearsed, "g", "particles", "region", hub.regions["r2"], "all")
    assert (len(hub.groups["g"]), len(rehearsed.groups["g"])) == (16, 32)


def test_results_that_a_rehearsal_does_not_have_pass_silently():
    hub = scene()
    hub.rehearsing = True
    regions = [hub.region("b", BlockRegion, 0, "nan", 0, 1), hub.region("c", Cylinder, 0, 0, "nan")]
    regions += [hub.region("e", Cylinder, "nan", 0, 1, "exterior")]
    regions += [hub.combine("d", Difference, hub.regions["r1"], regions[1])]
    for k, region in enumerate(regions):
        for kind in ("particles", "nodes"):
            group(hub, f"{kind}{k}", kind, "region", region, "all")
        assert hub.solid(f"new{k}", region).count == 0
    assert not hub.warnings
