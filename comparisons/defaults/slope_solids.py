"""A block slides down a slope of 20 degrees; each body has its own grid."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0.2)
