"""How many points a visit takes at once, and in what order it goes through them.

One by one, or in lanes: four or eight, where all parts of the visit know them.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import by_type, index, point_function
from karamelo_py.compiler.fingerprint import classes_in
from karamelo_py.compiler.lanes import Eights, Fours, group, lanes_for, spread
from karamelo_py.kernels.g2p import SecondStrain, Strain, StrainOfLastStep


class OneByOne(NamedTuple):
    """The points are visited one by one."""

    width = 1


def in_lanes(visit, s, block):
    """Whether points are visited in lanes, and how many at once: `OneByOne`, `Fours` or `Eights`.

    Interpreted, and where a part of the visit does not know lanes, they are visited one by one.
    """
    return OneByOne()


@by_type(in_lanes)
def _in_lanes(visit, s, block):
    tasks, quantities = visit[0], visit[1]
    of_scene = (s[s.fields.index(name)] for name in ("basis", "transfer", "averaging"))
    law = block[block.fields.index("laws")]
    parts = {part.instance_class for part in (*tasks, *quantities, *of_scene)}
    made = _lanes_if_known(parts, law, block[0][block[0].fields.index("mass")])
    return lambda visit, s, block: made()


def _lanes_if_known(parts, laws, mass):
    """The lanes for points of such `mass`, or none where a part does not know them."""
    if all(getattr(part, "in_lanes", False) for part in (*parts, *classes_in(laws))):
        return lanes_for(mass.dtype.bitwidth)
    return OneByOne


def lanes_of_law(laws, mass):
    """The same as `in_lanes`, where only a law is asked."""
    return OneByOne()


@by_type(lanes_of_law)
def _lanes_of_law(laws, mass):
    made = _lanes_if_known((), laws, mass)
    return lambda laws, mass: made()


def width_of(width):
    """How many points are visited at once; constant at compile time."""
    return width.width


@by_type(width_of)
def _width_of(width):
    number = width.instance_class.width
    return lambda width: number


@point_function()
def points_from(width, q, end):
    """The points to visit, from number `q` on, before `end`."""


@points_from.on(OneByOne)
def _points_from_one_by_one(width, q, end):
    return index(q)


@points_from.on(Fours)
@points_from.on(Eights)
def _points_from_eights(width, q, end):
    return group(width, q, min(width_of(width), end - q))


def in_stretches(width, visit):
    """Whether a visit gathers for a stretch of points, then settles them, then scatters.

    Three short loops are faster than a long one where there is much to settle: processors keep
    some thousand instructions at hand, and a law alone may have as many.
    """
    return False


@by_type(in_stretches)
def _in_stretches(width, visit):
    only_strains = _only_strains(width, visit)
    return lambda width, visit: only_strains


def _only_strains(width, visit):
    """Whether a visit in lanes does nothing but strain.

    Where points move stretches cost more than they bring: there is little to settle, and stencils
    are found twice.
    """
    tasks = {task.instance_class for task in visit[0]}
    strains = {Strain, StrainOfLastStep, SecondStrain}
    return width.instance_class is not OneByOne and bool(tasks) and tasks <= strains


def settled_width(width, visit):
    """How many points are settled at once: in stretches of doubles twice as many as gather.

    Chains of operations that wait for each other serve eight points in the time of four. To gather
    and to scatter, four are faster.
    """
    return width


@by_type(settled_width)
def _settled_width(width, visit):
    made = Eights if _only_strains(width, visit) else width.instance_class
    return lambda width, visit: made()


@point_function()
def zero_of(width, like):
    """0 as a number of a visit."""


@zero_of.on(OneByOne)
def _zero_of_one_by_one(width, like):
    return like - like


@zero_of.on(Fours)
@zero_of.on(Eights)
def _zero_of_eights(width, like):
    return spread(width, like - like)
