"""The rate of plastic strain, for output: a further part of laws that lowering adds when asked."""

from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import where
from karamelo_py.points import laws
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.further import Further, initial_part, part_after
from karamelo_py.points.laws.strengths import equivalent_plastic_strain

# Karamelo smooths over the time in which sound goes through this many cells.
CELLS = 1000


class PlasticRate(NamedTuple):
    """Rate of the equivalent plastic strain, smoothed over a time."""

    in_lanes = True

    time: float


class Smoothed(NamedTuple):
    """Tag of the smoothed rate."""


laws.column(PlasticRate, "epdot", Smoothed())


class RateMemory(NamedTuple):
    """State of a point."""

    rate: Any
    ep: Any  # plastic strain, -1 where none is known yet


@initial_part.on(PlasticRate)
def _initial_part_plastic_rate(part, like):
    return RateMemory(0.0, -1.0)


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
    return isinstance(law, EosStrength) and "ep" in laws.columns_of(law)


def with_rate(law: NamedTuple, kin: NamedTuple, h: float) -> NamedTuple:
    """A law that keeps its rate behind all that it keeps else; `h` is the cell size."""
    if not has_rate(law):
        return law
    speed = sqrt(laws.wave_speed_squared(law, kin, laws.initial_state(law, kin, 1.0)))
    return law._replace(further=_behind(law.further, PlasticRate(CELLS * h / speed)))


def without_rate(kinds: tuple[type, ...]) -> tuple[type, ...]:
    """The kinds of a law (`law_kind`) as they are when nobody asks for the rate."""
    if PlasticRate not in kinds:
        return kinds
    k = kinds.index(PlasticRate)
    return kinds[: k - 1] + kinds[k + 1 :]


def _behind(parts: NamedTuple, part: NamedTuple) -> NamedTuple:
    if isinstance(parts, laws.Absent):
        return Further(part, parts)
    return parts._replace(rest=_behind(parts.rest, part))
