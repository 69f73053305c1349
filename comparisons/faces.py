"""Bodies that meet with their faces in the plane, for `comparisons.defaults`."""

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result


def touched(result: Result) -> float:
    """Time from the first force to the last, over what a wave needs to the rod's end and back."""
    touching = np.flatnonzero(result.log.force)
    time = result.log.Time[touching]
    return float(time[-1] - time[0])  # L = 0.5, c = 1


def faces(bodies: str) -> Case:
    """The case of two bodies."""
    return Case(
        quantity=f"time that {bodies} touch, meeting at less than 1 % of the wave speed, "
        "over 2 L/c",
        exact=1.0,
        measure=touched,
        source="St Venant 1867",
    )
