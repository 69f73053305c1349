"""Output intervals in steps or time."""

import re
from math import ceil, floor, isfinite
from typing import Annotated

from karamelo_py.language.kinds import Positive, Unfit, kind_of
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.script.errors import Mark

_BY_TIME = re.compile(r"time\s*\((.*)\)")
_STEPS = kind_of(Annotated[int, Positive])
_SPAN = kind_of(Annotated[float, Positive])


class ByTime:
    """Output at the first step at or after each multiple of `span`, of which `passed` are done."""

    def __init__(self, span: float):
        self.span = span
        self.passed = -1

    def now(self, time: float) -> int:
        """Return the number of multiples up to `time`, allowing for round-off."""
        return floor(time / self.span * (1 + 1e-12) + 1e-9)


class Rhythmic:
    remembers: tuple[str, ...] = ("last_step", "passed")
    every: int | ByTime
    last_step: int | None = None
    style = ""  # style of a dump
    mark: Mark | None = None

    def write(self) -> None:
        raise NotImplementedError

    def take_part(self) -> None:
        """Take part in the output, instead of `write`, on ranks other than 0."""
        self.write()

    def finish(self) -> None:
        """Complete the files at the end of each run, including failed ones."""

    @property
    def passed(self) -> int | None:
        return self.every.passed if isinstance(self.every, ByTime) else None

    @passed.setter
    def passed(self, count: int | None) -> None:
        if count is not None and isinstance(self.every, ByTime):
            self.every.passed = count


class Every:
    """Script argument: a number of steps (int), or ``time(T)`` (`ByTime`)."""

    script_kind = "a whole number above 0, of steps, or time(T)"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> int | ByTime:
        match = _BY_TIME.fullmatch(argument.text)
        if not match:
            return _STEPS.convert(hub, argument)
        span = argument.piece(match[1].strip())
        try:
            return ByTime(_SPAN.convert(hub, span))
        except Unfit as unfit:
            unfit.mark = unfit.mark or span.mark
            raise


def is_due(every: int | ByTime, step: int, time: float) -> bool:
    if isinstance(every, ByTime):
        return every.now(time) > every.passed
    return step % every == 0


def next_step(every: int | ByTime, step: int, time: float, dt: float, fixed: bool) -> int:
    """Return the first step at which output may be due.

    If output is due by time and dt varies, this step is only half as far as dt predicts, since
    steps may become longer.
    """
    if not isinstance(every, ByTime):
        return (step // every + 1) * every
    left = ((every.now(time) + 1) * every.span - time) / dt
    steps = ceil(left - 1e-6) if isfinite(left) else 1
    return step + max(1, steps if fixed else steps // 2)
