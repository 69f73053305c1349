"""Two rods meet and rebound by elastic contact of their points: the energy that they keep."""

from comparisons.defaults import Case

CASE = Case(
    quantity="energy after the rebound over that before, contact between points",
    exact=1.0,
    measure=lambda result: result.log.energy[-1],
    source="elastic collision",
    within=0.01,
)
