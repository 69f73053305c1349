"""Several points at once: lanes of a vector register as a number type of point functions.

A kernel that indexes point arrays (components, points) with a `Group` instead of a number gets
`Lanes`: one number for each of 4 or 8 consecutive points. Lanes add, multiply and compare like
numbers; node numbers in lanes gather from node arrays (nodes, components), and `accumulate`
scatters to them, lane by lane in the order of the points. Point functions are unaware of it;
powers and logarithms are computed lane by lane (`scalarised`). Each lane has the bits of the same
operations on numbers; sums at nodes differ from sums over single points by round-off.

The last group of a tile may have fewer points than lanes: missing lanes load the first point, and
store and contribute nothing.

Only compiled kernels have lanes; interpreted ones process points one by one.
"""

from karamelo_py.compiler.code import Lanes
from karamelo_py.compiler.lanes import records  # noqa: F401
from karamelo_py.compiler.lanes.arrays import (
    EightLanes,
    FourLanes,
    group,
    lanes_for,
    room_for,
    spread,
)

__all__ = ["EightLanes", "FourLanes", "Lanes", "group", "lanes_for", "room_for", "spread"]
