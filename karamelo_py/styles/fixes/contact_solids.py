"""Contact between the surfaces of two solids, each with its own grid."""

from math import inf
from typing import Annotated, Any

import numpy as np

from karamelo_py.kernels import pairs
from karamelo_py.kernels.arrays import Block, Matter
from karamelo_py.language.signature import NonNegative
from karamelo_py.points.bodies import MeetingFaces
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.pairs import PairContact

# In sizes of a point: differences of depths, and where they are taken, so that the point at a
# corner has the normal of one side.
STEP, OFFSET = 0.02, (0.1, 0.05, 0.025)
BESIDE = 1e-6
LEVEL = 0.1  # slope of the depth below which there is no normal
EDGE = 0.9  # cosine between normals on the two sides of an edge
TINY = float(np.finfo(float).tiny)


class ContactSolids(PairContact):
    """Apply contact between the surfaces of two solids with separate grids, with friction.

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids, which must fill regions.
    mu
        Coefficient of friction (Coulomb); without it, none.

    Example
    -------
    fix(touch, contact/solids, block, base, 0.3)

    Notes
    -----
    Publishes the force on solid1 as ID_x, ID_y, ID_z in one step; that on solid2 is the opposite.
    Bodies bounce, so take the mean over many steps.

    A point next to the surface of its region has a face: the tangent plane of the region at the
    nearest place, as wide as the distance to the next points along the surface. Faces follow the
    deformation gradients of their points. Where two faces overlap by p, they get the force
    m1 m2 / (m1 + m2) w p / dt^2 along the mean of their normals, where w is the common part of
    their widths. Friction, dt and cost are as in contact/minimize_penetration. Contact conserves
    momentum, and angular momentum except the force times the offset of the two points.

    Surfaces are smooth, also if they are inclined to the grid: friction on slopes of 10 to 33
    degrees is correct within 1.5 %. A disk of 4 and 8 cells in its radius rolls down a plane 5 and
    1 to 2 % too slowly. Edges are rounded: points next to an edge are balls.

    See Also
    --------
    contact/minimize_penetration, contact/surface, method tlmpm
    """

    impulsive = has_faces = True
    room = 4.0

    def __init__(
        self,
        hub: Hub,
        solid1: Solid,
        solid2: Solid,
        mu: Annotated[float, NonNegative] | None = None,
    ):
        if not hub.update.method.own_grids:
            raise ScriptError(
                "it needs a separate grid for each solid",
                expected="method(tlmpm, ...) or method(tlcpdi, ...)",
                hint="with method(ulmpm/contacts, ...), solids touch on the grid, with friction by "
                "fix contact/friction",
            )
        super().__init__(hub, solid1, solid2)
        self.rubs(hub, float(mu or 0.0))
        self._reach = inf
        self._faces = np.concatenate([*map(faces_of, self.solids, ("solid1", "solid2"))])

    def law(self) -> MeetingFaces:
        return MeetingFaces(self.mu)

    def _of(self, block: Block, rows: np.ndarray) -> np.ndarray:
        begin1, end1, begin2, _ = self._ranges
        ids = block.points.id[rows]
        first = (begin1 <= ids) & (ids < end1)
        return self._faces[np.where(first, ids - begin1, ids - begin2 + end1 - begin1)]

    def at_surface(self, block: Block, rows: np.ndarray) -> np.ndarray:
        return rows[self._of(block, rows)[:, -2] > 0]

    def faces(self, simulation: Any, block: Block, rows: np.ndarray) -> np.ndarray:
        faces = self._of(block, rows)
        matter = Matter(simulation.kin, block.points, block.laws)
        pairs.rotate_faces(simulation.setup.frame, matter, rows, faces)
        return faces


def faces_of(solid: Solid, argument: str) -> np.ndarray:
    """Return `points.bodies.Face` (n, d + 3) of the points of a solid in its reference shape."""
    region, x, size = solid.region, solid.x0, 2 * solid.half_size
    if region is None or not region.inside(x).all():
        why = "does not fill a region" if region is None else "was moved out of its region"
        hint = "fix contact/minimize_penetration needs no regions"
        hint = hint if region is None else "the fix before translate_particles"
        raise ScriptError(f"solid '{solid.id}' {why}", argument=argument, hint=hint)
    n, d = x.shape
    reach = 2 * float(size.max())

    def outward(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inward = np.empty((n, d))
        for k, axis in enumerate(np.eye(d)):
            step = STEP * size * axis
            ends = (region.depth(x + way * step, reach) for way in (1, -1))
            inward[:, k] = np.subtract(*ends) / (2 * step[:, k])
        steep = np.maximum(np.linalg.norm(inward, axis=1), TINY)
        return -inward / steep[:, None], steep

    normal, steep = outward(x + OFFSET[:d] * size)
    near, across = region.depth(x, reach) / steep, abs(normal) * size
    thick = np.maximum(across.max(axis=1), TINY)  # of the layer of points next to the surface
    wide = (size.prod(axis=1) / thick) ** (1 / (d - 1)) if d > 1 else size[:, 0].copy()
    wide[(near > (1 - BESIDE) * thick) | (steep < LEVEL)] = 0
    behind = region.depth(x - thick[:, None] * normal, reach)[wide > 0]
    if np.mean(behind < 0) > 0.5:
        message = f"solid '{solid.id}' is only one point thick"
        expected = "a solid of two or more points across, with a face on one side of each"
        raise ScriptError(message, argument=argument, expected=expected)
    flat = np.ones(n)
    for tangent in tangents(normal):
        for way in (-0.5, 0.5):
            other, _ = outward(x + way * wide[:, None] * tangent)
            flat[(normal * other).sum(axis=1) < EDGE] = 0
    return np.column_stack([normal, near, wide, flat])


def tangents(normal: np.ndarray) -> list[np.ndarray]:
    """Return d - 1 unit vectors (n, d) across unit vectors (n, d)."""
    d = normal.shape[1]
    if d < 3:
        return [normal[:, ::-1] * (1, -1)] * (d - 1)
    one = np.cross(normal, np.eye(3)[abs(normal).argmin(axis=1)])
    one /= np.linalg.norm(one, axis=1)[:, None]
    return [one, np.cross(normal, one)]
