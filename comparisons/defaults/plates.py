"""A plate of copper hits another: the pressure behind the shock."""

from comparisons.defaults import Case

CASE = Case(
    quantity="pressure behind a shock in copper at 500 m/s over Rankine and Hugoniot's",
    exact=1.0,
    measure=lambda result: float(result.log.ratio[-10:].mean()),
    source="Hugoniot curve, Meyers 1994",
    advice="stress lost across cells",
)
