"""The tip of a cutting tool in 2D."""

from typing import Annotated

from karamelo_py.kernels.tools import ByModulus, Wedge
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import ShapedTool


class CuttingTool(ShapedTool):
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
    shape = Wedge()

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        x_tip: Expression, y_tip: Expression, z_tip: Expression,
        vx: Expression, vy: Expression, vz: Expression,
        xA: Expression, yA: Expression, xB: Expression, yB: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        if hub.domain.dimension != 2:
            raise ScriptError("this tool is for 2D", expected="a domain in 2D")
        tip = self.of_time("", (x_tip, y_tip, z_tip))
        self.push(ByModulus(by_side=False), K, *tip, xA, yA, xB, yB)
        self.refuse_undefined()

    def undefined(self) -> tuple[str, str] | None:
        tip, *ends = self.now(*self.values_of_time[1:]).reshape(3, 2)
        (ax, ay), (bx, by) = ends - tip
        defined = abs(ax * by - ay * bx) > 0
        return None if defined else ("tip, A and B lie in one line", "two faces with an angle")
