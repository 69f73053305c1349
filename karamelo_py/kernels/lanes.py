"""The number of points processed at once: one, or four or eight in lanes."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import classes_in, implements, index
from karamelo_py.compiler.lanes import EightLanes, group, lanes_for, spread
from karamelo_py.kernels.arrays import Index, Number, Tag
from karamelo_py.kernels.equations.pore_water import Seep
from karamelo_py.kernels.equations.strain import Strain


class OneByOne(NamedTuple):
    width = 1


def lanes_with(parts: tuple, laws: NamedTuple, mass: np.ndarray) -> Tag:
    """Choose lanes for a loop over points: none if interpreted, or if a part excludes them."""
    return OneByOne()


@implements(lanes_with, by_type=True)
def _lanes_with(parts, laws, mass):
    classes = (*(tag.instance_class for tag in parts), *classes_in(laws))
    in_lanes = all(getattr(tag, "in_lanes", False) for tag in classes)
    made = lanes_for(mass.dtype.bitwidth) if in_lanes else OneByOne
    return lambda parts, laws, mass: made()


def points_from(lanes: Tag, q: int, end: int) -> Index:
    """Return point `q`, or the points in lanes from there, before `end`."""
    if isinstance(lanes, OneByOne):
        return index(q)
    return group(lanes, q, min(lanes.width, end - q))


def one_loop_each(lanes: Tag, visit: Any) -> bool:
    """Return True if gather, update and scatter get separate loops over a stretch of points.

    Separate loops are faster if all tasks update strains or seepage, as a material law may fill
    the instruction cache. If points move, computing stencils twice would cost more.
    """
    strains = [isinstance(task, Strain | Seep) for task in visit.tasks]
    return not isinstance(lanes, OneByOne) and any(strains) and all(strains)


def lanes_of_update(lanes: Tag, visit: Any) -> Tag:
    """Return twice as many lanes: operations of an update wait for each other."""
    return EightLanes() if one_loop_each(lanes, visit) else lanes


def zero_of(lanes: Tag, template: Number) -> Number:
    """Return 0 in the type of `template`, or in lanes of it."""
    return (
        template - template if isinstance(lanes, OneByOne) else spread(lanes, template - template)
    )
