"""Quantities as data: a new one needs what docs/house/kernels.md shows, and no more."""

import re
import textwrap
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from karamelo_py.compiler import kernel
from karamelo_py.compiler.lanes import FourLanes, added, group
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels import table
from karamelo_py.kernels.arrays import Nodes
from karamelo_py.kernels.equations import affine_part, load_of, scattered
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, Normal
from karamelo_py.kernels.sums import columns_in_turn, columns_of
from karamelo_py.kernels.views import NodeView
from karamelo_py.points.kinematics import Line, PlaneStrain, Space

PAGE = Path(__file__).parent.parent / "docs" / "house" / "kernels.md"
Load = namedtuple("Load", "mass v")


@pytest.fixture(scope="module")
def shown():
    """What the example of the page defines."""
    found: dict = {"__name__": __name__}
    code = re.search(r"^  ```python\n(.*?)^  ```", PAGE.read_text("utf-8"), re.M | re.S)
    exec(textwrap.dedent(code[1]), found)
    return found


def test_the_example_of_the_page(shown):
    kin, kind, speed = PlaneStrain(), shown["SquaredSpeed"], shown["Speed"]()
    assert columns_of((speed,), kin) == [(kind, 0, 1)]
    assert speed.reads == ("mass", "v")
    array = np.zeros((4, 1))
    load = Load(2.0, kin.Vector(3.0, 4.0))
    for fields in ((kind(array),), ()):  # without the field, nothing is given
        w = SimpleNamespace(nodes=Nodes(None, None, None, fields), kin=kin)
        scattered(speed, load, NodeView(w, (), 0, 2, 0.25, None))
    assert array.tolist() == [[0], [0], [0.25 * 2 * 25], [0]]
    assert affine_part(speed, w, (), load) == ()


@pytest.mark.parametrize("kin", [Line(), PlaneStrain(), Space()])
def test_columns_follow_from_the_rows(kin):
    """Records are summed whole, with their gaps; a card has their numbers alone."""
    both = MassMomentum(), InternalForce()
    d = kin.dimension
    width = {1: 4, 2: 8, 3: 8}[d]
    assert ("sums", 0, width) in columns_of(both, kin)
    there = columns_in_turn(both, kin, ["sums", Normal])
    force = 2 if d == 1 else 4
    own = [*range(1 + d), *range(force, force + d)]
    assert [column for array, column, _ in there if array == "sums"] == own
    assert [column for array, column, _ in there if array is Normal] == list(range(d))


class Values(NamedTuple):
    p: Any
    values: Any


@eq.reads()
def value(pt):
    return pt.values[0, pt.p]


class Valued(eq.NodalQuantity):
    takes = eq.of_point(value=value)


@kernel
def summed(values):
    return added(0.0, load_of(Valued(), Values(group(FourLanes(), 0, 3), values)).value)


def test_lanes_without_a_point_give_nothing_of_a_quantity_without_mass():
    assert summed(np.array([[2.0, 3.0, 4.0, 5.0]])) == 9


def test_a_function_without_reads_is_named():
    with pytest.raises(TypeError, match=r"Wrong: put @eq.reads\(...\) before planar, "):

        class Wrong(eq.NodalQuantity):
            takes = eq.of_point(v=PlaneStrain.Vector.planar)


def test_a_single_quantity_is_scattered_and_shown_before_the_first_step(shown):
    speed = shown["Speed"]()
    row = table.Scatter(speed)
    assert row == table.Scatter((speed,)) and row.quantities == (speed,)
    rows = (table.SUMS, row, *table.MOVE, table.Scatter(Valued()))
    kinds = [type(one) for one in table.shown_sums(rows)]
    assert kinds == [MassMomentum, InternalForce, type(speed)]
