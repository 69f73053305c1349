"""fix edge_pressure: a pressure on the whole edge of a region."""

import numpy as np

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.edges import EdgeFix, Faces
from karamelo_py.styles.fixes.formulas import evaluated


class EdgePressure(EdgeFix):
    """Press on the whole edge of a region.

    Parameters
    ----------
    p
        Pressure: a number or a formula of x, y, z (the place of the edge before the first step),
        time and published values.

    Example
    -------
    fix(cell, edge_pressure, all, disk, 1e5)

    Notes
    -----
    Each face that a point of the group shows to the outside of the region gets the pressure times
    the area that it has before the first step, inwards. Points are boxes, so that a curved edge has
    steps: the forces along each axis are those on the projected area, as they are on the smooth
    edge. They keep size and direction. A part of an edge is that of a region of its own:
    ``region(top, block, 0, 1, 0.9, 1)`` has other sides as well, where the group may have to end.
    Around an axis, forces belong to a radian. Publishes the sum as ID_x, ID_y, ID_z.

    See Also
    --------
    edge_traction, neumann_bc_mech, initial_stress
    """

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, p: Expression):
        super().__init__(hub, group, region)
        self.p = p

    def chosen(self, faces: Faces) -> Faces:
        """Those with an area: not the axis."""
        return Faces(*(column[faces.area > 0] for column in faces))

    def loads(self, faces: Faces) -> np.ndarray:
        """See `EdgeFix.loads`."""
        force = np.zeros(faces.middle.shape)
        p = evaluated(self.p, self.hub, faces.middle, faces.middle)
        force[np.arange(len(force)), faces.axis] = -faces.sign * faces.area * p
        return force
