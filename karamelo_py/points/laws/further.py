"""Further parts of a composed law, of kinds that plug-ins may define: any number of them.

Lowering adds one itself on request: the plastic strain rate, for output.

A part is a NamedTuple of parameters (its class is the tag). It may have a memory, and add a
pressure. By default a part has no memory and adds nothing.
"""

from functools import reduce
from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function, where
from karamelo_py.points import laws
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.strengths import equivalent_plastic_strain


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
    """The initial memory of a point."""
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


def initial_further(parts, like):
    """Memory of the first part, and of the rest; () without parts."""
    if isinstance(parts, Absent):
        return ()
    return initial_part(parts.part, like), initial_further(parts.rest, like)


def further_after(parts, memory, law, kin, j, s, memories, dt):
    """The memories after a step."""
    if isinstance(parts, Absent):
        return ()
    own, rest = memory
    after = part_after(parts.part, own, law, kin, j, s, memories, dt)
    return after, further_after(parts.rest, rest, law, kin, j, s, memories, dt)


def further_pressure(parts, memory, p):
    """p plus the pressure of all parts."""
    if isinstance(parts, Absent):
        return p
    own, rest = memory
    return further_pressure(parts.rest, rest, p + sum(part_pressure(parts.part, own)))


# Karamelo smooths over the time in which sound crosses this many cells.
CELLS = 1000


class PlasticRate(NamedTuple):
    """Rate of the equivalent plastic strain, smoothed over time."""

    in_lanes = True

    time: float


class Smoothed(NamedTuple):
    """Tag of the smoothed rate."""


laws.column(PlasticRate, "epdot", Smoothed())


class RateMemory(NamedTuple):
    """State of a point."""

    rate: Any
    ep: Any  # plastic strain, -1 if not known yet


initial_part.on(PlasticRate)(lambda part, like: RateMemory(0.0, -1.0))


@part_after.on(PlasticRate)
def _part_after_plastic_rate(part, memory, law, kin, j, s, memories, dt):
    ep = equivalent_plastic_strain(law.strength, memories.strength)
    before = where(memory.ep < 0, ep, memory.ep)
    change = (ep - before - dt * memory.rate) / part.time
    return RateMemory(max(memory.rate + change, 0), ep)


@laws.shown.on(Smoothed)
def _shown_smoothed(what, law, kin, state):
    return last_memory(state.m.further).rate


def last_memory(memories):
    """Find the memory of the last of several further parts."""
    own, rest = memories
    return last_memory(rest) if len(rest) else own


def has_rate(law: NamedTuple) -> bool:
    """Check that a law has plastic strain, so that it has a rate."""
    return hasattr(law, "further") and "ep" in laws.columns_of(law)


def with_rate(law: NamedTuple, kin: NamedTuple, h: float) -> NamedTuple:
    """A law that also stores its rate, after its other memory; `h` is the cell size."""
    if not has_rate(law):
        return law
    speed = sqrt(laws.wave_speed_squared(law, kin, laws.initial_state(law, kin, 1.0)))
    return law._replace(further=_behind(law.further, PlasticRate(CELLS * h / speed)))


def without_rate(kinds: tuple[type, ...]) -> tuple[type, ...]:
    """The kinds of a law (`law_kind`) without the rate."""
    if PlasticRate not in kinds:
        return kinds
    k = kinds.index(PlasticRate)
    return kinds[: k - 1] + kinds[k + 1 :]


def _behind(parts: NamedTuple, part: NamedTuple) -> NamedTuple:
    if isinstance(parts, Absent):
        return Further(part, parts)
    return parts._replace(rest=_behind(parts.rest, part))
