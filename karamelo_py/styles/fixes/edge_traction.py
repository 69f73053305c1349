"""fix edge_traction: a force per area on one side of a region."""

from typing import Literal

import numpy as np

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.edges import SIDES, EdgeFix, Faces
from karamelo_py.styles.fixes.formulas import per_direction, vector


class EdgeTraction(EdgeFix):
    """Load one side of a region with a force per area.

    Parameters
    ----------
    side
        The side that is loaded, by the direction in which it looks: xlo and xhi for left and right,
        ylo and yhi, zlo and zhi.
    traction
        tx, ty, tz, as many as the domain has dimensions: force per area, numbers or formulas of x,
        y, z (the place of the edge before the first step), time and published values. NULL leaves a
        component alone.

    Example
    -------
    fix(pull, edge_traction, all, disk, xhi, 1e6*min(time/0.01, 1), 0, 0)

    Notes
    -----
    The group's points are boxes that fill the region; those that show a face to the outside in the
    direction of `side` bear the traction on the area that this face has before the first step. The
    load keeps size and direction (a dead load), the sum over a plane side is exactly traction times
    area, and it acts half a box inside the edge. Around an axis, area and force belong to a radian.
    Publishes the sum as ID_x, ID_y, ID_z.

    See Also
    --------
    edge_pressure, neumann_bc_mech, force_particles
    """

    syntax = "group, region, side, tx[, ty[, tz]]"

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        region: Region,
        side: Literal[SIDES],
        *traction: Expression | None,
    ):
        super().__init__(hub, group, region)
        self.axis, self.sign = SIDES.index(side) // 2, 1 if side.endswith("hi") else -1
        self.traction = per_direction(hub, "t", traction)

    def chosen(self, faces: Faces) -> Faces:
        """See `EdgeFix.chosen`."""
        here = (faces.axis == self.axis) & (faces.sign == self.sign)
        return Faces(*(column[here] for column in faces))

    def loads(self, faces: Faces) -> np.ndarray:
        """See `EdgeFix.loads`."""
        x = faces.middle
        return faces.area[:, None] * vector(self.traction, self.hub, x, lambda: x)
