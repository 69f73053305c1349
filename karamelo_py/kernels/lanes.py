"""The number of points that a visit takes at once, and the order in which it goes through them.

One by one, or in lanes: four or eight, where all parts of the visit know them.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import by_type, index, shared
from karamelo_py.compiler.fingerprint import classes_in
from karamelo_py.compiler.lanes import EightLanes, group, lanes_for, spread
from karamelo_py.kernels.arrays import Block, Index, Number, Tag
from karamelo_py.kernels.g2p import Strain


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


@shared
def points_from(lanes: Tag, q: int, end: int) -> Index:
    """Return the point `q`, or the points in lanes from there on, before `end`."""
    if isinstance(lanes, OneByOne):
        return index(q)
    return group(lanes, q, min(lanes.width, end - q))


@shared
def one_loop_each(lanes: Tag, visit: NamedTuple) -> bool:
    """Choose three loops over a stretch of points: gather, update, scatter; else one for all.

    Three short loops are faster than a long one where there is much to update: processors keep
    some thousand instructions at hand, and a law alone may have as many. That is so in lanes, of
    visits that do nothing but strain. Where points move stretches cost more than they bring: there
    is little to update, and stencils are found twice.
    """
    strains = [isinstance(task, Strain) for task in visit.tasks]
    return not isinstance(lanes, OneByOne) and any(strains) and all(strains)


@shared
def lanes_of_update(lanes: Tag, visit: NamedTuple) -> Tag:
    """Choose the lanes of the particle update: in stretches of doubles twice those of the gather.

    Chains of operations that wait for each other serve eight points in the time of four. To gather
    and to scatter, four are faster.
    """
    return EightLanes() if one_loop_each(lanes, visit) else lanes


@shared
def zero_of(lanes: Tag, like: Number) -> Number:
    """Return 0 as a number of a visit: of the type of `like`, or of lanes of it."""
    return like - like if isinstance(lanes, OneByOne) else spread(lanes, like - like)
