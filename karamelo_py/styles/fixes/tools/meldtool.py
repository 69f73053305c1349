"""The tool of additive friction stir deposition."""

from typing import Annotated, Any, Literal

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import ToolFix


class MeldTool(ToolFix):
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
        self.numbers = (K, half_width, c1, c2, theta, lo, hi, Rmax)
        self.now(*self.numbers)  # raises an error for formulas of position
        self.along = "xyz".index(axis)
        self.across = [k for k in range(3) if k != self.along]

    def _seen(self, points: Any, *at: float) -> tuple[np.ndarray, ...]:
        """Return heights (n,) above the end, positions (n, 2) in fixed and tool axes, rotation."""
        c1, c2, theta, lo = at
        x = points.position.astype(float)
        q = x[:, self.across] - np.array([c1, c2])
        turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
        return x[:, self.along] - lo, q, q @ turn.T, turn

    def depth_of(self, points: PointTable) -> np.ndarray:
        _, w, c1, c2, theta, lo, hi, Rmax = self.now(*self.numbers)
        height, q, rotated, _ = self._seen(points, c1, c2, theta, lo)
        ways = (
            height,
            hi - lo - height,
            Rmax - np.linalg.norm(q, axis=1),
            abs(rotated).max(axis=1) - w,
        )
        return np.min(ways, axis=0)

    def forces(self, points: PointsView) -> np.ndarray:
        K, w, c1, c2, theta, lo, hi, Rmax = self.now(*self.numbers)
        height, q, rotated, turn = self._seen(points, c1, c2, theta, lo)
        r = np.linalg.norm(q, axis=1)
        inward = (np.clip(rotated, -w, w) - rotated) @ turn
        outward = q * np.divide(Rmax - r, r, out=np.zeros_like(r), where=r > 0)[:, None]
        # Ways out (n, 3) into the channel, radially and below; and their lengths.
        ways = np.zeros((3, len(r), 3))
        ways[0][:, self.across] = inward
        ways[1][:, self.across] = outward
        ways[2][:, self.along] = -height
        shortest = np.linalg.norm(ways, axis=2).argmin(axis=0)
        inside = (height >= 0) & (height <= hi - lo) & (r <= Rmax)
        way = ways[shortest, np.arange(len(r))] * inside[:, None]
        return (K * self.stiffness(points))[:, None] * way
