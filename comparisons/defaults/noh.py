"""A cold gas runs together about a point: the density behind its shock."""

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result


def density(result: Result) -> float:
    """Mean density of what is within 0.15 of the point, behind the shock at 0.2."""
    last = result.snapshots("noh")[-1]
    near = np.hypot(last.x, last.y) < 0.15
    return last.mass[near].sum() / last.volume[near].sum()


CASE = Case(
    quantity="density behind the shock",
    exact=16.0,
    measure=density,
    source="Noh 1987",
    advice="shocks of material",
)
