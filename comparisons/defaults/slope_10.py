"""A block slides down a rigid slope of 10 degrees, with the friction 0.1."""

from comparisons.slopes import slope

CASE = slope(angle=10, mu=0.1)
