"""A block slides down a region that leans by 20 degrees, on its stair-stepped face."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0.2)
