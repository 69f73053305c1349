"""A bar is torn in two: broken points do not rule the step."""

from comparisons.defaults import Case

CASE = Case(
    quantity="stable step of the torn bar over that at rest",
    exact=1.0,
    measure=lambda result: result.log.kept[-2],
    source="h/c, c the speed of waves in the two ends",
    half_step=False,
)
