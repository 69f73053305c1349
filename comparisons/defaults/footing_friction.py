"""A strip footing on soil with friction and dilatancy: its limit load."""

from math import radians

from comparisons.defaults import Case
from comparisons.exact import prandtl_load
from comparisons.results import Result


def load(result: Result) -> float:
    """Mean load over the last fifth of the way."""
    log = result.log
    return float(log.load[log.Time > 0.8].mean())


CASE = Case(
    quantity="limit load / cohesion",
    exact=prandtl_load(1, radians(20)),
    measure=load,
    source="Prandtl 1920, 20 degrees",
    advice="locking",
)
