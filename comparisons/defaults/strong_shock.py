"""A strong shock in a gas: the pressure behind it."""

from comparisons.defaults import Case
from comparisons.results import Result


def plateau(result: Result) -> float:
    """Mean pressure of the points between fan and contact."""
    (*_, last) = result.snapshots("points")
    return float(-last.s11[(last.x > 0.4) & (last.x < 0.65)].mean())


CASE = Case(
    quantity="pressure between fan and contact",
    exact=460.894,
    measure=plateau,
    source="Toro 2009, test 3",
    advice="shocks in a gas",
)
