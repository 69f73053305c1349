"""Several points at once: the lanes of a vector register as a number type of point functions.

A kernel that indexes arrays of points, (components, points), with a `Group` instead of a number
gets `Lanes`: one number for each of 4 or 8 points that lie one after another. Lanes add, multiply
and compare like numbers, node numbers made of them gather from arrays of nodes, (nodes,
components), and `accumulate` scatters to them, lane after lane in the order of the points. Point
functions need not know; powers and logarithms are taken one lane after another (`scalarised`).
Results of a lane are those of the same operations on numbers, to the last bit; sums at nodes
differ from those of points one by one by their rounding.

The last group of a tile may have fewer points than lanes: what is loaded for the others is that of
the first point, and nothing is stored or given to nodes for them.

Only compiled kernels know lanes; interpreted ones take the points one by one.
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
