"""A block of points that touch as balls slides down a slope of 20 degrees: too rough, and told."""

from comparisons.slopes import slope

CASE = slope(angle=20, mu=0.2)._replace(advice="made of balls")
