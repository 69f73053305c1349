"""The weight of clay next to a vertical cut grows until it fails."""

from comparisons.defaults import Case

CASE = Case(
    quantity="weight times height / cohesion at failure",
    exact=3.78,
    measure=lambda result: result.log.N[-1],
    source="bounds of limit analysis, Pastor et al. 2000",
    refine=(1,),
    advice="locking",
    half_step=False,
)
