"""Laws in the precision of a run, and in tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.points.laws.parameters import Numbers


def law_in(law: Any, real: type) -> Any:
    return type(law)(*(_in(p, real) for p in law))


def _in(value: Any, real: type) -> Any:
    if isinstance(value, tuple):
        return law_in(value, real)
    return np.array(value.values, real) if isinstance(value, Numbers) else real(value)


def law_table(laws: Sequence[Any], real: type) -> Any:
    """Gather `laws` of one kind in a NamedTuple of arrays (m,), or (m, longest) for rows."""
    return type(laws[0])(*(_table(column, real) for column in zip(*laws, strict=True)))


def _table(column: Sequence, real: type) -> Any:
    if isinstance(column[0], tuple):
        return law_table(column, real)
    if isinstance(column[0], Numbers):
        longest = max(len(row) for row in column)
        return np.array([row.filled(longest) for row in column], real)
    return np.array(column, real)


def law_on(law: Any, h: float | None, T0: float | None) -> Any:
    """Set the fields ``cell_size`` and ``initial_temperature`` of a law and its parts."""
    values = {"cell_size": h, "initial_temperature": T0}

    def on(name: str, value: Any) -> Any:
        if isinstance(value, tuple):
            return law_on(value, h, T0)
        return value if values.get(name) is None else values[name]

    return type(law)(*map(on, law._fields, law))
