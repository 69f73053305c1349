"""Water sloshes in a tank: the height of its first standing wave after two periods."""

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result


def height(result: Result) -> float:
    """Height of the last half wave, from the swing of the centre of mass."""
    swing = result.log.swing
    zeros = np.flatnonzero(np.diff(np.sign(swing[1:]))) + 1
    return float(abs(swing[zeros[-2] : zeros[-1] + 1]).max())


CASE = Case(
    quantity="height of the wave after two periods over that at first",
    exact=1.0,
    measure=height,
    source="no viscosity, Lamb 1932",
    advice="liquids with a linear basis",
)
