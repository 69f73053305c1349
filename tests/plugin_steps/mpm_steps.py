"""A plug-in of parts of a step that have parameters of their own; on the path, it is installed."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from karamelo_py.compiler.tuples import add, scale
from karamelo_py.language.signature import AtLeast, In, Positive
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import Along, along, register
from karamelo_py.points.transfers import updated_velocity
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.methods.ulmpm import ULMPM


class Growing(NamedTuple):
    """FLIP whose points multiply their velocity in every step.

    Parameters
    ----------
    factor
        By how much, each time.
    times
        How often in a step.
    """

    factor: Annotated[float, In(0, 4)]
    times: Annotated[int, AtLeast(1)] = 1

    keeps_moment = False
    inverts_spread = False


@updated_velocity.on(Growing)
def _(transfer, v, v_pic, dv):
    return scale(transfer.factor**transfer.times, add(v, dv))


class Smooth(NamedTuple):
    """Hats, the more rounded the larger the share of the cubic (1 - r)^2 (1 + 2 r) in them.

    Parameters
    ----------
    share
        That of the cubic.
    """

    share: Annotated[float, In(0, 1)] = 0.5

    cells = 1
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = False
    steep_edge = True


@along.on(Smooth)
def _(basis, kin, grid, place, direction):
    i, r, _, gradients, affine = along(Linear(), kin, grid, place, direction)
    right = r + basis.share * (r * r * (3.0 - 2.0 * r) - r)
    slope = 1.0 + basis.share * (6.0 * r * (1.0 - r) - 1.0)
    return Along(i, r, (1.0 - right, right), scale(slope, gradients), affine)


register(Smooth, 2)


class Paced(NamedTuple):
    """A scheme that knows a number.

    Parameters
    ----------
    pace
        The number.
    """

    pace: Annotated[float, Positive]


class Gapped(ULMPM):
    """A method with a number and a word of its own, and nothing about heat."""

    def __init__(
        self, hub: Hub, gap: Annotated[float, Positive], side: Literal["left", "right"] = "left"
    ):
        self.gap, self.side = gap, side


class Hats(NamedTuple):
    """Never used: its name is that of a built-in style."""
