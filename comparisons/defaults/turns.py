"""A disk turns freely, five times around: its angular momentum."""

from comparisons.defaults import Case

CASE = Case(
    quantity="angular momentum after 5 revolutions over the initial one",
    exact=1.0,
    measure=lambda result: result.log.L_z[-1] / result.log.L_z[0],
    source="conservation",
    within=0.01,
    advice="angular momentum",
)
