"""The number of points that a visit takes at once, and the order in which it goes through them.

One by one, or in lanes: four or eight, where all parts of the visit know them.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import by_type, index, point_function
from karamelo_py.compiler.fingerprint import classes_in
from karamelo_py.compiler.lanes import EightLanes, FourLanes, group, lanes_for, spread
from karamelo_py.kernels.arrays import Block, Index, Number, Tag
from karamelo_py.kernels.g2p import SecondStrain, Strain, StrainOfLastStep


class OneByOne(NamedTuple):
    """The points are visited one by one."""

    width = 1


def lanes_of_visit(visit: NamedTuple, s: NamedTuple, block: Block) -> Tag:
    """Choose `OneByOne`, `FourLanes` or `EightLanes` for a visit in the context `s`.

    Interpreted, and where a part of the visit does not know lanes, it is one by one.
    """
    return OneByOne()


@by_type(lanes_of_visit)
def _lanes_of_visit(visit, s, block):
    tasks, quantities = visit[0], visit[1]
    of_scene = (s[s.fields.index(name)] for name in ("basis", "transfer", "averaging"))
    law = block[block.fields.index("laws")]
    parts = {part.instance_class for part in (*tasks, *quantities, *of_scene)}
    made = _lanes_if_known(parts, law, block[0][block[0].fields.index("mass")])
    return lambda visit, s, block: made()


def _lanes_if_known(parts, laws, mass):
    """Choose lanes for points of such `mass`; `OneByOne` where a part does not know lanes."""
    if all(getattr(part, "in_lanes", False) for part in (*parts, *classes_in(laws))):
        return lanes_for(mass.dtype.bitwidth)
    return OneByOne


def lanes_of_law(laws: NamedTuple, mass: np.ndarray) -> Tag:
    """Choose lanes for a loop that asks only a law, as `lanes_of_visit` does for a visit."""
    return OneByOne()


@by_type(lanes_of_law)
def _lanes_of_law(laws, mass):
    made = _lanes_if_known((), laws, mass)
    return lambda laws, mass: made()


def points_at_once(lanes: Tag) -> int:
    """Return the number of points visited at once; constant at compile time."""
    return lanes.width


@by_type(points_at_once)
def _points_at_once(lanes):
    number = lanes.instance_class.width
    return lambda lanes: number


@point_function()
def points_from(lanes: Tag, q: int, end: int) -> Index:
    """Return the point `q`, or the points in lanes from there on, before `end`."""


@points_from.on(OneByOne)
def _points_from_one_by_one(lanes, q, end):
    return index(q)


@points_from.on(FourLanes)
@points_from.on(EightLanes)
def _points_from_lanes(lanes, q, end):
    return group(lanes, q, min(points_at_once(lanes), end - q))


def one_loop_each(lanes: Tag, visit: NamedTuple) -> bool:
    """Choose three loops over a stretch of points: gather, update, scatter; else one for all.

    Three short loops are faster than a long one where there is much to update: processors keep
    some thousand instructions at hand, and a law alone may have as many.
    """
    return False


@by_type(one_loop_each)
def _one_loop_each(lanes, visit):
    only_strains = _only_strains(lanes, visit)
    return lambda lanes, visit: only_strains


def _only_strains(lanes, visit):
    """Return True for a visit in lanes that does nothing but strain.

    Where points move stretches cost more than they bring: there is little to update, and stencils
    are found twice.
    """
    tasks = {task.instance_class for task in visit[0]}
    strains = {Strain, StrainOfLastStep, SecondStrain}
    return lanes.instance_class is not OneByOne and bool(tasks) and tasks <= strains


def lanes_of_update(lanes: Tag, visit: NamedTuple) -> Tag:
    """Choose the lanes of the particle update: in stretches of doubles twice those of the gather.

    Chains of operations that wait for each other serve eight points in the time of four. To gather
    and to scatter, four are faster.
    """
    return lanes


@by_type(lanes_of_update)
def _lanes_of_update(lanes, visit):
    made = EightLanes if _only_strains(lanes, visit) else lanes.instance_class
    return lambda lanes, visit: made()


@point_function()
def zero_of(lanes: Tag, like: Number) -> Number:
    """Return 0 as a number of a visit: of the type of `like`, or of lanes of it."""


@zero_of.on(OneByOne)
def _zero_of_one_by_one(lanes, like):
    return like - like


@zero_of.on(FourLanes)
@zero_of.on(EightLanes)
def _zero_of_lanes(lanes, like):
    return spread(lanes, like - like)
