"""method ulmpm: updated Lagrangian, one grid for the whole domain."""

from __future__ import annotations

from karamelo_py.styles.methods.base import Method


class ULMPM(Method):
    """Updated Lagrangian MPM: weights follow the present positions, all solids share one grid.

    Solids that meet on the grid move together there: contact without slip and without further
    definition.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    """
