"""A stiff body is thrown upwards: its fall."""

from comparisons.defaults import Case

CASE = Case(
    quantity="fall below the straight path over g t^2 / 2",
    exact=1.0,
    measure=lambda result: result.log.fall[-1],
    source="Galilei",
    within=0.01,
)
