"""Further parts of a composed law, whose kinds plug-ins may define.

A part is a NamedTuple of parameters, with optional history variables and an added pressure. The
plastic strain rate is such a part, which is added if an output requests it.
"""

from functools import reduce
from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, where
from karamelo_py.points import laws
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.strengths import equivalent_plastic_strain


class Further(NamedTuple):
    in_lanes = True

    component: Any
    rest: Any


def chained(parts: list) -> NamedTuple:
    none: Any = Absent()
    return reduce(lambda rest, component: Further(component, rest), reversed(parts), none)


@point_function(otherwise=True)
def initial_part(component, template):
    return ()


@point_function(otherwise=True)
def part_after(component, memory, law, step, memories):
    """Return the history variables after a `StrainStep`; `memories` belong to other parts."""
    return memory


@point_function(otherwise=True)
def part_pressure(component, memory):
    """Return (p,), the pressure that a part adds, or ()."""
    return ()


def initial_further(parts, template):
    if isinstance(parts, Absent):
        return ()
    return initial_part(parts.component, template), initial_further(parts.rest, template)


def further_after(parts, memory, law, step, memories):
    if isinstance(parts, Absent):
        return ()
    first, rest = memory
    after = part_after(parts.component, first, law, step, memories)
    return after, further_after(parts.rest, rest, law, step, memories)


def further_pressure(parts, memory, p):
    if isinstance(parts, Absent):
        return p
    first, rest = memory
    return further_pressure(parts.rest, rest, p + sum(part_pressure(parts.component, first)))


# As in Karamelo, the rate is smoothed over the time in which sound crosses this number of cells.
CELLS = 1000


class PlasticRate(NamedTuple):
    in_lanes = True

    time: float


class Smoothed(NamedTuple):
    pass


laws.column(PlasticRate, "epdot", Smoothed())


class RateMemory(NamedTuple):
    rate: Any
    ep: Any  # plastic strain, -1 if unknown


@initial_part.on(PlasticRate)
def _initial_part_plastic_rate(component, template):
    return RateMemory(0.0, -1.0)


@part_after.on(PlasticRate)
def _part_after_plastic_rate(component, memory, law, step, memories):
    ep = equivalent_plastic_strain(law.strength, memories.strength)
    before = where(memory.ep < 0, ep, memory.ep)
    change = (ep - before - step.dt * memory.rate) / component.time
    return RateMemory(max(memory.rate + change, 0), ep)


@laws.shown.on(Smoothed)
def _shown_smoothed(tag, law, kin, state):
    return last_memory(state.m.further).rate


def last_memory(memories):
    first, rest = memories
    return last_memory(rest) if len(rest) else first


def has_rate(law: NamedTuple) -> bool:
    return "further" in law._fields and "ep" in laws.columns_of(law)


def with_rate(law: NamedTuple, kin: NamedTuple, h: float) -> NamedTuple:
    """Return a law that also stores its plastic strain rate, for cells of size `h`."""
    if not has_rate(law):
        return law
    speed = sqrt(laws.wave_speed_squared(law, kin, laws.initial_state(law, kin, 1.0)))
    return law._replace(further=_appended(law.further, PlasticRate(CELLS * h / speed)))


def without_rate(kinds: tuple[type, ...]) -> tuple[type, ...]:
    if PlasticRate not in kinds:
        return kinds
    k = kinds.index(PlasticRate)
    return kinds[: k - 1] + kinds[k + 1 :]


def _appended(parts: NamedTuple, component: NamedTuple) -> NamedTuple:
    if isinstance(parts, Absent):
        return Further(component, parts)
    return parts._replace(rest=_appended(parts.rest, component))
