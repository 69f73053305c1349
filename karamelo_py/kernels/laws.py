"""Laws of materials as a run needs them: in its precision, and in tables.

A law is a NamedTuple of numbers, or of parts that are NamedTuples of numbers
(:mod:`karamelo_py.points.laws`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def law_in(law: NamedTuple, real: type) -> NamedTuple:
    """The law with its numbers in the type `real`."""
    return type(law)(*(law_in(p, real) if isinstance(p, tuple) else real(p) for p in law))


def law_table(laws: Sequence[NamedTuple], real: type) -> NamedTuple:
    """The NamedTuple of `laws` of one kind with an array (m,) for each number, m their count."""
    columns = zip(*laws, strict=True)
    return type(laws[0])(
        *(law_table(c, real) if isinstance(c[0], tuple) else np.array(c, real) for c in columns)
    )


def law_on(law: NamedTuple, h: float, T0: float | None) -> NamedTuple:
    """The law with what it has to know of a solid: cell size `h`, initial temperature `T0`.

    Laws and parts that need them have fields ``cell_size`` and ``initial_temperature``.
    """
    known = {"cell_size": h, "initial_temperature": T0}
    return type(law)(
        *(
            law_on(value, h, T0)
            if isinstance(value, tuple)
            else value
            if known.get(name) is None
            else known[name]
            for name, value in zip(law._fields, law, strict=True)
        )
    )


def elastic_law(law: NamedTuple) -> NamedTuple:
    """The law that makes the stress, of one that adds a temperature to it."""
    return getattr(law, "elastic", law)
