"""Weighted rows of node arrays."""

from typing import NamedTuple


class Weighted(NamedTuple):
    """Rows of an array used as one: reading sums them by weight, writing distributes."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]
