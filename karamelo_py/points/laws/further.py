"""Parts of a composed law of further kinds, which a plug-in may bring: any number of them.

A part is a NamedTuple of parameters (its class is the tag). It may remember numbers of its own, and
add a pressure. What is not defined for a class is that of a part that remembers and adds nothing.
"""

from functools import reduce
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.tuples import only
from karamelo_py.points.laws import Absent


class Further(NamedTuple):
    """A part, and further ones (`Absent` at the end)."""

    in_lanes = True

    part: Any
    rest: Any


def chained(parts: list) -> NamedTuple:
    """The parts, one after the other."""
    return reduce(lambda rest, part: Further(part, rest), reversed(parts), Absent())


@point_function(otherwise=True)
def initial_part(part, like):
    """The memory of a point without a past."""
    return ()


@point_function(otherwise=True)
def part_after(part, memory, law, kin, j, s, memories, dt):
    """The memory after a step dt to the volume ratio j and the deviatoric stress s.

    `memories` are those of the other parts of the `law`.
    """
    return memory


@point_function(otherwise=True)
def part_pressure(part, memory):
    """(p,), the pressure that the part adds, or ()."""
    return ()


# ---- the same of all ----------------------------------------------------------------------------


@point_function(otherwise=True)
def initial_further(parts, like):
    """Memory of the first part, and that of the others."""
    return ()


@initial_further.on(Further)
def _initial_further_further(parts, like):
    return initial_part(parts.part, like), initial_further(parts.rest, like)


@point_function(otherwise=True)
def further_after(parts, memory, law, kin, j, s, memories, dt):
    """The memories after a step."""
    return ()


@further_after.on(Further)
def _further_after_further(parts, memory, law, kin, j, s, memories, dt):
    own, rest = memory
    after = part_after(parts.part, own, law, kin, j, s, memories, dt)
    return after, further_after(parts.rest, rest, law, kin, j, s, memories, dt)


@point_function(otherwise=True)
def further_pressure(parts, memory, p):
    """p and what all parts add to it."""
    return p


@further_pressure.on(Further)
def _further_pressure_further(parts, memory, p):
    own, rest = memory
    return further_pressure(parts.rest, rest, p + only(part_pressure(parts.part, own)))
