"""Domain, regions, solids and groups as a script makes them, and what it gets wrong."""

import pytest
from hubs import SmallHub

from karamelo_py.language.help import describe
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.script.errors import ScriptError

SCENE = """
D = 2
L = 1
h = L/20
dimension(D, -L/2, L/2, -L/2, L/2, h)
R = 0.2
region(disk1, cylinder, -0.3, -0.3, R)
region(disk2, cylinder, 0.3, 0.3, R)
region(left, block, -0.5, 0, INF, +INF)
"""


def run(text, hub=None):
    hub = hub or SmallHub(dimension=0)
    Interpreter(hub).run_text(text)
    return hub


def message(text):
    """What the user sees for a script that is wrong in its last line."""
    with pytest.raises(ScriptError) as caught:
        run(text)
    error = caught.value
    assert error.mark is not None
    assert error.mark.line == text.rstrip().count("\n") + 1
    return error.render()


def marked(text):
    """The word that is marked."""
    with pytest.raises(ScriptError) as caught:
        run(text)
    place = caught.value.mark
    return place.text[place.column - 1 : place.column - 1 + place.length]


def test_two_disks():
    hub = run(
        SCENE
        + """
solid(s1, region, disk1, 2, steel, h, 0)
solid(s2, region, disk2, 2, steel, L/20)
group(g1, particles, region, disk1, solid, s1)
group(g2, particles, region, disk2, all)
group(bc, nodes, region, left, all)
group(one, particles, region, left, solid, s1, s2)
"""
    )
    assert [solid.count for solid in hub.solids.values()] == [208, 208]
    assert len(hub.groups["g1"]) == len(hub.groups["g2"]) == len(hub.groups["one"]) == 208
    assert len(hub.groups["bc"]) == 11 * 21


def test_keywords_of_solids():
    hub = run(
        SCENE
        + """
solid(s1, region, disk1, 3, steel, h, 0, points=gauss)
solid(s2, region, disk2, 2, steel, h, 0, GlueToSolid=s1)
"""
    )
    assert len(set(hub.solids["s1"].volume0)) > 1
    assert hub.solids["s2"].glued_to is hub.solids["s1"]


def test_the_older_form():
    hub = run(
        """dimension(2)
create_domain(-0.5, 0.5, -0.5, 0.5, 0.05)
region(box, block, -0.5, 0.5, -0.5, 0.5, exterior)
region(left, block, EDGE, 0, -INF, INF)
region(u, union, box, left)
region(i, intersection, box, left, u)
region(d, difference, u, box)
"""
    )
    assert list(hub.regions) == ["box", "left", "u", "i", "d"]
    assert hub.regions["box"].exterior


def test_the_axis_of_a_cylinder_is_a_word():
    hub = run(
        "dimension(3, 0, 1, 0, 1, 0, 1, 0.1)\n"
        "region(rod, cylinder, x, 0.5, 0.5, 0.2, INF, 0.5)\n"
        "region(ball, sphere, 0.5, 0.5, 0.5, 0.2)\n"
    )
    assert hub.regions["rod"].across == (1, 2)


@pytest.mark.parametrize(
    ("line", "mark", "says"),
    [
        ("region(r, blok, 0, 1, 0, 1)", "blok", "did you mean 'block'?"),
        ("region(disk1, block, 0, 1, 0, 1)", "disk1", "already used (line 7)"),
        ("region(r, block, 0, 1, 0)", None, "block, xlo, xhi, ylo, yhi[, exterior]"),
        ("region(r, block, 1, 0, 0, 1)", "1", "xlo = 1 is above xhi = 0"),
        ("region(r, block, 0, 1, 0, time)", "time", "yhi must be a constant number"),
        ("region(r, block, 0, 1, 0, NULL)", "NULL", "NULL cannot be used here"),
        ("region(r, cylinder, 0, 0, -R)", "-R", "R = -0.2 must be above 0"),
        ("region(r, union, disk1)", None, "second is missing"),
        ("region(r, union, disk1, disk3)", "disk3", "one of disk1, disk2, left"),
        ("solid(s, region, disk3, 2, steel, h)", "disk3", "unknown region 'disk3'"),
        ("solid(s, region, disk1, 2, stel, h)", "stel", "did you mean 'steel'?"),
        ("solid(s, region, disk1, 0, steel, h)", "0", "at least 1"),
        ("solid(s, region, disk1, 1.5, steel, h)", "1.5", "a whole number"),
        ("solid(s, region, disk1, 2, steel, 0)", "0", "above 0"),
        ("solid(s, region, disk1, 2, steel, 2*h)", "2*h", "0.05, as in dimension(...)"),
        ("solid(s, region, disk1, 2, steel)", None, "solid(ID, region, regionID, ppc, material, h"),
        ("solid(s, mesh, body.msh, steel, h, 0)", "body.msh", "file body.msh does not exist"),
        ("solid(s, region, disk1, 2, steel, h, points=gaus)", "gaus", "did you mean 'gauss'?"),
        ("solid(s, region, disk1, 2, steel, h, GlueToSolid=s1)", "s1", "unknown solid 's1'"),
        ("solid(s, region, disk1, 2, steel, h, GlueTo=s1)", "GlueTo=s1", "GlueToSolid=..."),
        ("solid(s, rgion, disk1, 2, steel, h)", "rgion", "did you mean 'region'?"),
        ("group(all, nodes, region, left, all)", "all", "another name"),
        ("group(g, node, region, left, all)", "node", "did you mean 'nodes'?"),
        ("group(g, nodes, region, lft, all)", "lft", "did you mean 'left'?"),
        ("group(g, nodes, region, left)", None, "all | solid, solidID, ..."),
        ("group(g, particles, region, left, solid)", "solid", "no solid is named"),
        ("group(g, particles, region, left, solid, s9)", "s9", "unknown solid 's9'"),
        ("dimension(2, 0, 1, 0, 1, 0.1)", None, "the domain is already set"),
        ("axisymmetric(true)", "true", "begins at x = -0.5"),
        ("axisymmetric(yes)", "yes", "true or false"),
    ],
)
def test_mistakes(line, mark, says):
    assert says in message(SCENE + line)
    if mark:
        assert marked(SCENE + line) == mark


@pytest.mark.parametrize(
    ("line", "mark", "says"),
    [
        ("dimension(2, 0, 1, 0.1)", None, "dimension(2, xmin, xmax, ymin, ymax, h)"),
        ("dimension()", None, "dimension(1|2|3, xmin, xmax[, ymin, ymax[, zmin, zmax]], h)"),
        ("dimension(5, 0, 1)", "5", "dimension(1, xmin, xmax, h)"),
        ("dimension(1, 0, 1, 1e-15)", "1e-15", "nodes"),
        ("region(r, block, 0, 1)", None, "dimension(...) before this line"),
        ("group(g, nodes, region, r, all)", "r", "unknown region 'r'"),
    ],
)
def test_mistakes_at_the_start(line, mark, says):
    assert says in message(line)
    if mark:
        assert marked(line) == mark


def test_help_shows_the_forms():
    from karamelo_py.language import registry

    def syntax(family, name):
        return describe(registry.find(family, name), f"{family} {name}").syntax

    assert syntax("region", "block") == (
        "region(ID, block, xlo, xhi[, ylo, yhi[, zlo, zhi]][, exterior])"
    )
    assert syntax("region", "difference") == "region(ID, difference, first, second[, more, ...])"


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("dimension(2, 0, 1, 0, 2, 2.5)", True),
        ("dimension(1, 0, 1, 1.01)", True),
        ("create_domain(0, 1, 0, 2, 0, 1, 3)", True),
        ("dimension(2, 0, 1, 0, 2, 2)", False),  # a column
        ("dimension(2, 0, 0.1, 0, 2, 0.5)", False),
        ("dimension(3, 0, 0.3, 0, 0.3, 0, 0.3, 0.1*3)", False),  # an element
        ("method(tlmpm, FLIP, linear, 1)\ndimension(2, 0, 1, 0, 1, 2)", False),  # has no such grid
    ],
)
def test_cells_larger_than_the_domain_are_told(line, told):
    warnings = run(line).warnings
    assert told == any("larger than the domain, whose longest side is" in one for one in warnings)
