"""The number of points that a visit takes at once, and the order in which it goes through them.

One by one, or in lanes: four or eight, where all parts of the visit know them.
"""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.choices import classes_in
from karamelo_py.compiler.compile import implements, index
from karamelo_py.compiler.lanes import EightLanes, group, lanes_for, spread
from karamelo_py.kernels.arrays import Index, Number, Tag
from karamelo_py.kernels.equations.strain import Strain


class OneByOne(NamedTuple):
    """The points are visited one by one."""

    width = 1


def lanes_with(parts: tuple, laws: NamedTuple, mass: np.ndarray) -> Tag:
    """Choose `OneByOne`, `FourLanes` or `EightLanes` for a loop with these parts over points.

    Interpreted, and where a part or a law does not know lanes, it is one by one.
    """
    return OneByOne()


@implements(lanes_with, by_type=True)
def _lanes_with(parts, laws, mass):
    known = (*(part.instance_class for part in parts), *classes_in(laws))
    in_lanes = all(getattr(part, "in_lanes", False) for part in known)
    made = lanes_for(mass.dtype.bitwidth) if in_lanes else OneByOne
    return lambda parts, laws, mass: made()


def points_from(lanes: Tag, q: int, end: int) -> Index:
    """Return the point `q`, or the points in lanes from there on, before `end`."""
    if isinstance(lanes, OneByOne):
        return index(q)
    return group(lanes, q, min(lanes.width, end - q))


def one_loop_each(lanes: Tag, visit: Any) -> bool:
    """Choose three loops over a stretch of points: gather, update, scatter; else one for all.

    Three short loops are faster than a long one if there is much to update: processors cache
    some thousand instructions at hand, and a law alone may have as many. That is so in lanes, of
    visits that do nothing but strain. Where points move stretches cost more than they bring: there
    is little to update, and stencils are found twice.
    """
    strains = [isinstance(task, Strain) for task in visit.tasks]
    return not isinstance(lanes, OneByOne) and any(strains) and all(strains)


def lanes_of_update(lanes: Tag, visit: Any) -> Tag:
    """Choose the lanes of the particle update: with doubles, twice the lanes of the gather.

    Chains of operations that wait for each other serve eight points in the time of four. To gather
    and to scatter, four are faster.
    """
    return EightLanes() if one_loop_each(lanes, visit) else lanes


def zero_of(lanes: Tag, like: Number) -> Number:
    """Return 0 as a number of a visit: of the type of `like`, or of lanes of it."""
    return like - like if isinstance(lanes, OneByOne) else spread(lanes, like - like)
