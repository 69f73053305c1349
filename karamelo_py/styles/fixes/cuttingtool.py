"""fix cuttingtool: a wedge that points do not enter."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools import Bodies, PointForceFix, place


class CuttingTool(PointForceFix):
    """Push points out of the tip of a rigid tool, in the plane.

    Parameters
    ----------
    K
        Stiffness of the tool in shear moduli of the point: a number or a formula of time.
    x_tip, y_tip, z_tip
        The tip: numbers or formulas of time; z is 0.
    vx, vy, vz
        Its velocity, which scripts of Karamelo give; there is no friction that would need it.
    xA, yA, xB, yB
        A point on each of the two faces that meet in the tip: numbers or formulas of time.

    Example
    -------
    fix(tool, cuttingtool, all, 1, 1 - time, 0.5, 0, -1, 0, 0, 1.1 - time, 0.9, 1.4 - time, 0.55)

    Notes
    -----
    The tool is what lies between the two faces. A point in it, at the depth p from the nearer face,
    gets the force K G (1 - D) p out of that face, with the shear modulus G and the damage D of its
    material (de Vaucorbeil & Nguyen 2021). Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, meldtool
    """

    needs_stiffness = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        K: Annotated[Expression, NonNegative],
        x_tip: Expression,
        y_tip: Expression,
        z_tip: Expression,
        vx: Expression,
        vy: Expression,
        vz: Expression,
        xA: Expression,
        yA: Expression,
        xB: Expression,
        yB: Expression,
    ):
        super().__init__(hub, group)
        if hub.domain.dimension != 2:
            raise ScriptError("the tool is one in the plane", expected="a domain in 2D")
        self.K = K
        self.tip = place(hub, x_tip, y_tip, z_tip)
        self.ends = (xA, yA), (xB, yB)
        if not hub.rehearsing:  # which does not know all numbers
            self._faces()

    def _faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (2, 2) out of the tool, of the faces to A and to B, and the tip."""
        tip = self.now(self.tip)
        a, b = (self.now(end) - tip for end in self.ends)
        turn = a[0] * b[1] - a[1] * b[0]
        if not abs(turn) > 0:
            raise ScriptError("tip, A and B lie in one line", expected="two faces with an angle")
        # Turned away from the other face.
        normals = np.array([[a[1], -a[0]], [-b[1], b[0]]]) * np.sign(turn)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True), tip

    def push(self, bodies: Bodies) -> np.ndarray:
        """See `PointForceFix.push`."""
        (K,) = self.now((self.K,))
        normals, tip = self._faces()
        depths = (tip - bodies.x) @ normals.T
        nearer = depths.argmin(axis=1)
        depth = np.maximum(depths.min(axis=1), 0)
        return (K * bodies.stiffness * depth)[:, None] * normals[nearer]
