"""A block slides to rest on a rigid base: energy and the heat of friction add up."""

from comparisons.defaults import Case

CASE = Case(
    quantity="energy and heat at rest over the initial ones",
    exact=1.0,
    measure=lambda result: result.log.E[-1] / result.log.E[0],
    source="first law",
)
