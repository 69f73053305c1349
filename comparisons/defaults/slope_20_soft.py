"""A block slides down an elastic slope of 20 degrees, with a friction coefficient of 0.2."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0.2)
