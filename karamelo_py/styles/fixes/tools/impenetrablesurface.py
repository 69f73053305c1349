"""Planes with a force proportional to the shear modulus."""

from typing import Annotated

from karamelo_py.kernels.tools import ByModulus
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import PlaneTool


class ImpenetrableSurface(PlaneTool):
    """Push back points that have passed a plane, with a force proportional to the depth.

    Parameters
    ----------
    K
        Stiffness relative to the shear modulus of the point, as a function of time.
    xs, ys, zs
        A position on the plane, as functions of time; z is 0 in 2D.
    nx, ny, nz
        Normal of the plane, of any length, towards the side where points may be.

    Example
    -------
    fix(wall, impenetrablesurface, all, 1, 0, 0.1, 0, 0, 1, 0)

    Notes
    -----
    A point at the depth p = n.(xs - x) > 0 gets the force K G (1 - D) p V^(1/d) along the unit
    normal n, where G is its shear modulus, D its damage, V its present volume and d the number of
    dimensions. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    contact/minimize_penetration/plane, cuttingtool
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        xs: Expression, ys: Expression, zs: Expression,
        nx: Expression, ny: Expression, nz: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        self.push(ByModulus(by_side=True), K, *self.lay((xs, ys, zs), (nx, ny, nz)))
