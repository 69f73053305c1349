"""Output intervals: every n steps, or every time span."""

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
    """Output at the first step at or after each multiple of `span`.

    `passed` counts the multiples that have been written.
    """

    def __init__(self, span: float):
        self.span = span
        self.passed = -1

    def now(self, time: float) -> int:
        """Count the multiples up to `time`, allowing for round-off."""
        return floor(time / self.span * (1 + 1e-12) + 1e-9)


class Rhythmic:
    """Something written repeatedly: at the interval `every`, last at `last_step`."""

    remembers = ("last_step", "passed")
    every: int | ByTime
    last_step: int | None = None

    @property
    def passed(self) -> int | None:
        """Number of multiples of the time span that were written."""
        return getattr(self.every, "passed", None)

    @passed.setter
    def passed(self, count: int | None) -> None:
        if count is not None and isinstance(self.every, ByTime):
            self.every.passed = count


class Every:
    """Annotation: a number of steps, or ``time(T)``; an int or a `ByTime`."""

    script_kind = "a whole number above 0, of steps, or time(T)"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> int | ByTime:
        """Read the interval from an argument."""
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
    """Tell whether the present state is to be written."""
    if isinstance(every, ByTime):
        return every.now(time) > every.passed
    return step % every == 0


def next_step(every: int | ByTime, step: int, time: float, dt: float, fixed: bool) -> int:
    """Find the first step after `step` that may be due.

    Unless `fixed`, the step may grow, so half of a longer distance is taken at a time.
    """
    if not isinstance(every, ByTime):
        return (step // every + 1) * every
    left = ((every.now(time) + 1) * every.span - time) / dt
    steps = ceil(left - 1e-6) if isfinite(left) else 1
    return step + max(1, steps if fixed else steps // 2)
