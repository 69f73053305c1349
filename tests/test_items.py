"""Rows of arrays by their addresses, as sorting takes along what points carry."""

import numpy as np
import pytest

from karamelo_py.compiler import kernel
from karamelo_py.compiler.fields import addresses_of_rows, pick_items, put_items, rows_of_points

SMALL, LARGE = np.int32(0), np.int64(0)


def in_order(row, like, order, room, begin, end):
    """Items of a row from `begin` to `end` become those that `order` names."""
    pick_items(row, like, order, room, 1, begin, end)
    put_items(row, like, room, 1, begin, end)


@kernel
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


def test_items_of_other_sizes_have_no_address():
    with pytest.raises(ValueError, match="items of 1 bytes"):
        addresses_of_rows([np.zeros((2, 8), bool)])


def test_of_nothing_there_is_no_row():
    """NumPy gives arrays of nothing strides of 0: they are no rows with gaps."""
    assert addresses_of_rows([np.empty(0), np.empty((3, 0)), np.empty((0, 4))]).shape == (0, 2)
