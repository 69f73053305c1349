"""Two rods meet and rebound: the energy that they keep."""

from comparisons.defaults import Case

CASE = Case(
    quantity="energy after the rebound over that before",
    exact=1.0,
    measure=lambda result: result.log.energy[-1],
    source="elastic collision",
    advice="energy is lost",
)
