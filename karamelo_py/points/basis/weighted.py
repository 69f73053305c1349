"""Weighted rows of node arrays."""

from typing import NamedTuple


class Weighted(NamedTuple):
    """Rows of an array used as one row: reads are weighted sums, writes distribute by weight."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]
