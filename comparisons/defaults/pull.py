"""A bar is drawn and pushed: what leads its points and loads them is all the energy that it has."""

import re

from comparisons.defaults import Case
from comparisons.results import Result


def closing(result: Result) -> float:
    """The energy that there is over that which work has brought, by the end of the run."""
    (percent,) = re.findall(r"^  energy +(\S+) % of the largest", result.out, re.M)
    return 1 + float(percent) / 100


CASE = Case(
    quantity="energy over the work of grips and loads",
    exact=1.0,
    measure=closing,
    source="first law",
    within=0.01,
)
