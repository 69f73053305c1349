"""The tip of a cutting tool in 2D."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import ToolFix


class CuttingTool(ToolFix):
    """Push points out of the tip of a rigid cutting tool, in 2D.

    Parameters
    ----------
    K
        Stiffness relative to the shear modulus of the point, as a function of time.
    x_tip, y_tip, z_tip
        Position of the tip, as functions of time; z is 0.
    vx, vy, vz
        Unused; for compatibility with Karamelo.
    xA, yA, xB, yB
        A position A and B on each of the two faces that meet at the tip, as functions of time.

    Example
    -------
    fix(tool, cuttingtool, all, 1, 1 - time, 0.5, 0, -1, 0, 0, 1.1 - time, 0.9, 1.4 - time, 0.55)

    Notes
    -----
    A point between the faces, at the depth p from the nearer one, gets the force K G (1 - D) p,
    normal to this face and outwards, with the shear modulus G and the damage D (de Vaucorbeil &
    Nguyen 2021). Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, meldtool
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        x_tip: Expression, y_tip: Expression, z_tip: Expression,
        vx: Expression, vy: Expression, vz: Expression,
        xA: Expression, yA: Expression, xB: Expression, yB: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        if hub.domain.dimension != 2:
            raise ScriptError("this tool is for 2D", expected="a domain in 2D")
        self.K = K
        self.tip = self.of_time("", (x_tip, y_tip, z_tip))
        self.ends = (xA, yA), (xB, yB)
        if not hub.rehearsing:
            self._faces()

    def _faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the outward normals (2, 2) of the faces, and the tip."""
        tip = self.now(*self.tip)
        a, b = (self.now(*end) - tip for end in self.ends)
        turn = a[0] * b[1] - a[1] * b[0]
        if not abs(turn) > 0:
            raise ScriptError("tip, A and B lie in one line", expected="two faces with an angle")
        normals = np.array([[a[1], -a[0]], [-b[1], b[0]]]) * np.sign(turn)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True), tip

    def _depths(self, points: PointsView | PointTable) -> tuple[np.ndarray, np.ndarray]:
        normals, tip = self._faces()
        return (tip - points.position.astype(float)) @ normals.T, normals

    def depth_of(self, points: PointTable) -> np.ndarray:
        return self._depths(points)[0].min(axis=1)

    def forces(self, points: PointsView) -> np.ndarray:
        depths, normals = self._depths(points)
        nearer = depths.argmin(axis=1)
        depth = np.maximum(depths.min(axis=1), 0)
        return (self.now(self.K) * self.stiffness(points) * depth)[:, None] * normals[nearer]
