"""A vortex of a liquid without viscosity: the error of its velocities."""

from comparisons.defaults import Case

CASE = Case(
    quantity="error of the velocity (L2, relative)",
    exact=0.0,
    measure=lambda result: result.log.off[-1],
    source="Taylor & Green 1937",
    advice="liquids with a linear basis",
)
