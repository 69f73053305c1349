"""A rod meets a rigid punch: how long they touch."""

from comparisons.faces import faces

CASE = faces("a rod and a rigid punch")
