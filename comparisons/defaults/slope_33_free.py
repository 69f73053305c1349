"""A block slides down a rigid slope of 33 degrees, with the friction 0."""

from comparisons.slopes import slope

CASE = slope(angle=33, mu=0)
