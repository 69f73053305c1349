"""Sorting takes along all that points carry, and is compiled for none of it."""

from itertools import pairwise
from math import inf

import numpy as np
import pytest
from numba import config

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.compiler.loops import loop
from karamelo_py.compiler.memory import addresses_of_rows, pick_items, put_items
from karamelo_py.kernels.sorting import sort_points
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene.hub import Hub

SMALL, LARGE = np.int32(0), np.int64(0)


def in_order(row, like, order, room, begin, end):
    """Items of a row from `begin` to `end` become those that `order` names."""
    pick_items(row, like, order, room, 1, begin, end)
    put_items(row, like, room, 1, begin, end)


@loop
def in_order_compiled(row, like, order, room, begin, end):
    """The same, compiled."""
    in_order(row, like, order, room, begin, end)


@pytest.mark.parametrize("ordered", [in_order, in_order_compiled])
@pytest.mark.parametrize(
    ("kind", "like"),
    [(np.int32, SMALL), (np.float32, SMALL), (np.int64, LARGE), (np.float64, LARGE)],
)
def test_rows_by_their_addresses(ordered, kind, like):
    """Each row of whatever array, and in it the items that are asked for."""
    numbers = np.random.default_rng(1)
    array = rows_of_points((2, 3, 20), kind)
    array[:] = numbers.integers(-(10**6), 10**6, array.shape)
    order = numbers.permutation(20)
    expected = array.copy()
    expected[1, 0, 4:17] = array[1, 0, order[4:17]]
    rows = addresses_of_rows([array[0, 0], array])
    assert rows[:, 1].tolist() == [array.itemsize] * 7
    assert rows[0, 0] == rows[1, 0]
    ordered(rows[4, 0], like, order, np.zeros((2, 20), np.int64), 4, 17)
    assert np.array_equal(array, expected)


def test_rows_with_gaps_have_no_address():
    with pytest.raises(ValueError, match="one after another"):
        addresses_of_rows([np.zeros((4, 6))[:, ::2]])


SCENE = """
method({method})
dimension(2, 0, 2, 0, 2, 0.1)
axisymmetric({round})
region(disk, cylinder, 1, 1, 0.72)
material(rubber, {law}, 2, 100, 0.3{heat})
solid(disk, region, disk, 2, rubber, 0.1, 20)
"""
SCENES = {
    "plain": {},
    "spline": {"method": "ulmpm, APIC, quadratic-spline", "law": "neo-hookean"},
    "domains": {"method": "ulcpdi, FLIP, linear, 1, Q4"},
    "total": {"method": "tlmpm, FLIP, linear, 1"},
    "warm": {"method": "ulmpm, MLS, linear, thermo-mechanical", "heat": ", 2, 3"},
    "round": {"round": "true"},
}


def sorted_scene(method="ulmpm, FLIP, linear, 1", law="linear", heat="", round="false"):
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(SCENE.format(method=method, law=law, heat=heat, round=round))
    hub.simulation.begin(inf)
    hub.simulation.sort()
    return hub.simulation


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_one_kernel_sorts_points_of_all_kinds():
    """In a dimension and a precision, whatever laws, bases and fields there are."""
    known = []
    for words in SCENES.values():
        simulation = sorted_scene(**words)
        assert simulation.count > 400
        known.append(set(sort_points.entries))
    assert all(one == other for one, other in pairwise(known))
