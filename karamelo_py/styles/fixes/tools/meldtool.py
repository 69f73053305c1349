"""The tool of additive friction stir deposition."""

from typing import Annotated, Literal

from karamelo_py.kernels.tools import CHANNELS, ByModulus
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import ShapedTool


class MeldTool(ShapedTool):
    """Push points out of the tool of additive friction stir deposition, in 3D.

    Parameters
    ----------
    K
        Force divided by depth and by the shear modulus of the point; a length. All numbers may be
        formulas of time.
    axis
        Direction of the axis.
    half_width
        Half the width of the square channel along the axis.
    c1, c2
        Position of the axis in the two directions normal to it, in the order x, y, z.
    theta
        Rotation angle of the tool in radians, from the first of these directions to the second.
    lo, hi
        Ends of the tool along the axis; points are pushed out at the lower end.
    Rmax
        Radius of the tool.

    Example
    -------
    fix(tool, meldtool, all, 1, y, 0.1, 0.5, 0.5, 10*time, 0.6, 1, 0.3)

    Notes
    -----
    The tool is a cylinder with a square channel along its axis. A point inside the tool gets the
    force K G (1 - D) times the shortest way out (into the channel, out of the cylinder, or below
    the lower end), with the shear modulus G and the damage D. Publishes the force on the points as
    ID_x, ID_y, ID_z.

    See Also
    --------
    cuttingtool, impenetrablesurface
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        axis: Literal["x", "y", "z"], half_width: Annotated[Expression, NonNegative],
        c1: Expression, c2: Expression, theta: Expression, lo: Expression, hi: Expression,
        Rmax: Annotated[Expression, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, group)
        if hub.domain.dimension != 3:
            raise ScriptError("this tool is for 3D", expected="a domain in 3D")
        self.shape = CHANNELS[axis]()
        self.push(ByModulus(by_side=False), K, half_width, c1, c2, theta, lo, hi, Rmax)
