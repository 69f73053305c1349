"""Rhythms of output: every so many steps, or whenever so much time has passed."""

import re
from math import ceil, floor, isfinite
from typing import Annotated

from karamelo_py.language.kinds import Positive, Unfit, kind_of
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument

_BY_TIME = re.compile(r"time\s*\((.*)\)")
_STEPS = kind_of(Annotated[int, Positive])
_SPAN = kind_of(Annotated[float, Positive])


class ByTime:
    """At the first step at or after each multiple of `span`.

    `passed` counts the multiples that have been written.
    """

    def __init__(self, span: float):
        self.span = span
        self.passed = -1

    def now(self, time: float) -> int:
        """Count the multiples up to `time`; a sum of steps falls short by round-off."""
        return floor(time / self.span * (1 + 1e-12) + 1e-9)


class Rhythmic:
    """Something written again and again: `every` says how often, `last_step` when last."""

    remembers = ("last_step", "passed")
    every: int | ByTime
    last_step: int | None = None

    @property
    def passed(self) -> int | None:
        """The multiples of a span of time that were written."""
        return getattr(self.every, "passed", None)

    @passed.setter
    def passed(self, count: int | None) -> None:
        if count is not None and isinstance(self.every, ByTime):
            self.every.passed = count


class Every:
    """For signatures: a number of steps, or ``time(T)``; gives an int or a `ByTime`."""

    script_kind = "a whole number above 0, of steps, or time(T)"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> int | ByTime:
        """Read the rhythm from an argument."""
        match = _BY_TIME.fullmatch(argument.text)
        if not match:
            return _STEPS.convert(hub, argument)
        span = argument.part(match[1].strip())
        try:
            return ByTime(_SPAN.convert(hub, span))
        except Unfit as unfit:
            unfit.place = unfit.place or span.place
            raise


def is_due(every: int | ByTime, step: int, time: float) -> bool:
    """Tell if the present state is one to be written."""
    if isinstance(every, ByTime):
        return every.now(time) > every.passed
    return step % every == 0


def next_step(every: int | ByTime, step: int, time: float, dt: float, fixed: bool) -> int:
    """The first step after `step` that may be due.

    While the step is not `fixed` it may grow, so that a longer way is gone by halves.
    """
    if not isinstance(every, ByTime):
        return (step // every + 1) * every
    left = ((every.now(time) + 1) * every.span - time) / dt
    steps = ceil(left - 1e-6) if isfinite(left) else 1
    return step + max(1, steps if fixed else steps // 2)
