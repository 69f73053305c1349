"""A block slides down a region that leans by 20 degrees: its stair-stepped face is thrown off."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0.2)._replace(advice="points pressed against the region")
