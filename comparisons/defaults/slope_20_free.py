"""A block slides down a rigid slope of 20 degrees, with the friction 0."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0)
