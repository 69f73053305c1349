"""Contact of a solid with a plane."""

from typing import Annotated

from karamelo_py.kernels.tools import Stiff
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import PlaneTool
from karamelo_py.styles.fixes.tools.stiff import StiffShape


class ContactMinimizePenetrationPlane(StiffShape, PlaneTool):
    """Apply contact of a solid with a plane, as stiff as the step allows, with friction.

    Parameters
    ----------
    solid
        ID of the solid.
    x, y, z
        A position on the plane, as functions of time; z is 0 in 2D.
    nx, ny, nz
        Normal of the plane, of any length, towards the solid.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(floor, contact/minimize_penetration/plane, s1, 0, 0.1, 0, 0, 1, 0, 0.2)

    Notes
    -----
    Points are spheres (in 2D disks) with a radius rp of half the side of a cube of their present
    volume. A point at x with the penetration p = rp - n.(x - xq) > 0 gets the force m p / dt^2,
    which moves a free point out within one step; n is the unit normal, xq the position on the
    plane. Friction and dt are as in contact/minimize_penetration (de Vaucorbeil & Nguyen 2021). The
    motion of the plane causes no friction. The force acts at the centres of points: the stress in
    the lowest row of a body at rest is 33 % too small, and disks that hit at 25 % of their wave
    speed gain 2 to 4 % of energy. contact/surface has neither error.

    Publishes the force on the solid as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, contact/minimize_penetration, indent/minimize_penetration
    """

    def __init__(
        self, hub: Hub, solid: Solid, x: Expression, y: Expression, z: Expression,
        nx: Expression, ny: Expression, nz: Expression, mu: Annotated[float, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, ParticleGroup.of(hub, solid))
        self.rubs(hub, mu)
        self.push(Stiff(mu), *self.lay((x, y, z), (nx, ny, nz)))
