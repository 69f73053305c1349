"""Weighted rows of node arrays."""

from typing import NamedTuple


class Weighted(NamedTuple):
    """Rows of an array used as one: reading gives their weighted sum, writing distributes."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]
