"""fix contact/minimize_penetration/plane: a wall that points do not enter, with friction."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes import tools
from karamelo_py.styles.fixes.friction import judge_friction


class ContactMinimizePenetrationPlane(tools.PointForceFix):
    """Let a solid touch a fixed plane, as stiffly as the step allows, with friction.

    Parameters
    ----------
    solid
        ID of the solid.
    x, y, z
        A point of the plane: numbers or formulas of time; z is 0 in the plane.
    nx, ny, nz
        Its normal, of any length, towards the side where the solid is.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(floor, contact/minimize_penetration/plane, s1, 0, 0.1, 0, 0, 1, 0, 0.2)

    Notes
    -----
    Points are balls with the radius rp of half the side of a cube of their present volume. Where
    one reaches p = rp - n.(x - xq) into the plane it gets the force m p / dt^2, which takes a free
    point out within one step. Friction is mu times that, against the slip, and at most what stops
    it (de Vaucorbeil & Nguyen 2021). A plane that moves does so without dragging.

    Publishes the force on the solid as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, contact/minimize_penetration, indent/minimize_penetration
    """

    def __init__(
        self,
        hub: Hub,
        solid: Solid,
        x: Expression,
        y: Expression,
        z: Expression,
        nx: Expression,
        ny: Expression,
        nz: Expression,
        mu: Annotated[float, NonNegative],
    ):
        super().__init__(hub, ParticleGroup.of(hub, solid))
        self.mu = mu
        judge_friction(hub, mu)
        self.origin = tools.place(hub, x, y, z)
        self.normal = tools.place(hub, nx, ny, nz, "n")
        if not hub.rehearsing:  # which does not know all numbers
            tools.unit(self.now(self.normal))

    def push(self, bodies: tools.Bodies) -> np.ndarray:
        """See `PointForceFix.push`."""
        normal = tools.unit(self.now(self.normal))[None, :]
        depth = bodies.side / 2 - (bodies.x - self.now(self.origin)) @ normal[0]
        push = tools.apart(bodies, depth, normal)
        return push + tools.rubbed(bodies, push, normal, np.zeros(len(normal[0])), self.mu)
