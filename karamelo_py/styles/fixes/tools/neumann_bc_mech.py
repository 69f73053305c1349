"""A force per unit area on the outer points."""

import numpy as np

from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.hooks import vector_hook
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import per_direction
from karamelo_py.scene.views import PointsView
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import vector
from karamelo_py.styles.fixes.tools.base import ToolFix


def pull(area, force, values, dt):
    """Add the traction times the area of a face."""
    load = [area * value for value in values]
    both = zip(force, (*load, *(0.0,) * (len(force) - len(load))), strict=True)
    return force._make([a + b for a, b in both]), tuple(load)


class NeumannBcMech(ToolFix):
    """Apply a traction (force per unit area) to the surface of a body.

    Parameters
    ----------
    group
        A single layer of points along the surface.
    traction
        tx, ty, tz, one per dimension: functions of x, y, z, x0, y0, z0, time and published values.
        NULL leaves a component unchanged.

    Example
    -------
    fix(load, neumann_bc_mech, top, 0, -1e6*min(time/0.01, 1))

    Notes
    -----
    The force on a point is the traction times the area of one outer face, a side of a cube of the
    present volume V: V^(2/3) in 3D, V^(1/2) in 2D, the whole section in 1D; in axisymmetry at the
    radius of the point. The force acts at the point, half a side of the cube below the surface.
    Publishes the total force as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes, body_force, heat_flux_particles
    """

    syntax = "group, tx[, ty[, tz]]"
    presses = False

    initial_integrate = vector_hook(pull, reads=("face", Force), writes=(Force,), publishes=True)

    def __init__(self, hub: Hub, group: ParticleGroup, *traction: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "t", traction)

    def forces(self, points: PointsView) -> np.ndarray:
        """Return the forces (n, d) in load steps."""
        x, first = points.position.astype(float), lambda: points.reference_position
        return self.face(points)[:, None] * vector(self.formulas, self.hub, x, first)
