"""Two rods of quadratic splines meet: how long they touch."""

from comparisons.faces import faces

CASE = faces("two rods of quadratic splines")
