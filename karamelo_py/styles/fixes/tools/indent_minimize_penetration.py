"""A rigid ball in contact."""

from typing import Annotated, Literal

from karamelo_py.kernels.tools import PressBall, Stiff
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import BallTool
from karamelo_py.styles.fixes.tools.stiff import StiffShape


class IndentMinimizePenetration(StiffShape, BallTool):
    """Press a rigid ball (in 2D a disk) into points, as stiff as the step allows.

    Parameters
    ----------
    vx, vy, vz
        Velocity of the ball for friction; it does not move the centre.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(ball, indent/minimize_penetration, all, sphere, 0.2, 0.5, 1.2 - time, 0, 0, -1, 0, 0.1)

    Notes
    -----
    Each point is a sphere (a disk in 2D). The diameter 2 rp is the edge of a cube of the point's
    present volume. A point at the distance r from the centre, with the overlap p = R + rp - r > 0,
    gets the force m p / dt^2, which moves a free point out of the ball within one step. Friction
    and dt are as in contact/minimize_penetration (de Vaucorbeil & Nguyen 2021).

    Publishes the force on the points as ID_x, ID_y, ID_z, and the contact area as ID_s: one face of
    the cube of each touching point.

    See Also
    --------
    indent, contact/minimize_penetration/plane, contact/minimize_penetration
    """

    kind_of_press = PressBall

    def __init__(
        self, hub: Hub, group: ParticleGroup, kind: Literal["sphere"],
        R: Annotated[Expression, NonNegative], x: Expression, y: Expression, z: Expression,
        vx: Expression, vy: Expression, vz: Expression, mu: Annotated[float, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, group)
        self.rubs(hub, mu)
        centre, velocity = self.of_time("", (x, y, z)), self.of_time("v", (vx, vy, vz))
        self.push(Stiff(mu), R, *centre, *velocity)
