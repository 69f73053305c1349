"""fix impenetrablesurface: an elastic wall."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools import Bodies, PointForceFix, place, unit


class ImpenetrableSurface(PointForceFix):
    """Push points back that come behind a plane, with a force that grows with the depth.

    Parameters
    ----------
    K
        Stiffness of the wall in shear moduli of the point: a number or a formula of time.
    xs, ys, zs
        A point of the plane: numbers or formulas of time; z is 0 in the plane.
    nx, ny, nz
        Its normal, of any length, towards the side where points may be.

    Example
    -------
    fix(wall, impenetrablesurface, all, 1, 0, 0.1, 0, 0, 1, 0)

    Notes
    -----
    A point at the depth p = n.(xs - x) > 0 gets the force K G (1 - D) p V^(1/d) along the normal,
    with the shear modulus G and the damage D of its material, its present volume V and the number
    of dimensions d. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    contact/minimize_penetration/plane, cuttingtool
    """

    needs_stiffness = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        K: Annotated[Expression, NonNegative],
        xs: Expression,
        ys: Expression,
        zs: Expression,
        nx: Expression,
        ny: Expression,
        nz: Expression,
    ):
        super().__init__(hub, group)
        self.K = K
        self.origin = place(hub, xs, ys, zs)
        self.normal = place(hub, nx, ny, nz, "n")
        if not hub.rehearsing:  # which does not know all numbers
            unit(self.now(self.normal))

    def push(self, bodies: Bodies) -> np.ndarray:
        """See `PointForceFix.push`."""
        (K,) = self.now((self.K,))
        normal = unit(self.now(self.normal))
        depth = np.maximum((self.now(self.origin) - bodies.x) @ normal, 0)
        return (K * bodies.stiffness * depth * bodies.side)[:, None] * normal
