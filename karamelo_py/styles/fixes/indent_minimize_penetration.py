"""fix indent/minimize_penetration: a ball that points do not enter, with friction."""

from typing import Annotated, Literal

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.friction import judge_friction
from karamelo_py.styles.fixes.tools import Bodies, PointForceFix, apart, place, rubbed


class IndentMinimizePenetration(PointForceFix):
    """Press a rigid ball (in the plane a disk) into points, as stiffly as the step allows.

    Parameters
    ----------
    kind
        The word ``sphere``.
    R
        Radius of the ball: a number or a formula of time.
    x, y, z
        Its centre: numbers or formulas of time; z is 0 in the plane.
    vx, vy, vz
        Its velocity, which friction needs: the centre does not follow from it.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(ball, indent/minimize_penetration, all, sphere, 0.2, 0.5, 1.2 - time, 0, 0, -1, 0, 0.1)

    Notes
    -----
    Points are balls, too, with the radius rp of half the side of a cube of their present volume.
    Where one reaches p = R + rp - r into the ball, r from its centre, it gets the force m p / dt^2,
    which takes a free point out within one step. Friction is mu times that, along the slip, and at
    most what stops the slip (de Vaucorbeil & Nguyen 2021).

    Publishes the force on the points as ID_x, ID_y, ID_z and the area of contact, one face of the
    cube for each point that touches, as ID_s.

    See Also
    --------
    indent, contact/minimize_penetration/plane, contact/minimize_penetration
    """

    published = ("x", "y", "z", "s")

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        kind: Literal["sphere"],
        R: Annotated[Expression, NonNegative],
        x: Expression,
        y: Expression,
        z: Expression,
        vx: Expression,
        vy: Expression,
        vz: Expression,
        mu: Annotated[float, NonNegative],
    ):
        super().__init__(hub, group)
        self.R, self.mu = R, mu
        judge_friction(hub, mu)
        self.centre = place(hub, x, y, z)
        self.velocity = place(hub, vx, vy, vz, "v")

    def push(self, bodies: Bodies) -> np.ndarray:
        """See `PointForceFix.push`."""
        (R,) = self.now((self.R,))
        away = bodies.x - self.now(self.centre)
        r = np.linalg.norm(away, axis=1, keepdims=True)
        normal = np.divide(away, r, out=np.zeros_like(away), where=r > 0)
        depth = R + bodies.side / 2 - r[:, 0]
        self.publish("s", bodies.total(bodies.face * (depth > 0)))
        push = apart(bodies, depth, normal)
        return push + rubbed(bodies, push, normal, self.now(self.velocity), self.mu)
