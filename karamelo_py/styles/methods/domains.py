"""Domains of points before the first step: arrays for what a basis declares to keep of them.

A solid has `half_size` (n, d), of the box around each point, and, where it comes from a mesh,
`corners` (n, c, d), of the element around each point.
"""

import numpy as np

from karamelo_py.points.basis.cpdi import Element
from karamelo_py.scene.solid import Solid


def initial_shape(basis: type, solid: Solid) -> np.ndarray:
    """Return the shapes of the domains of a solid's points, (n, s), as `basis` keeps them."""
    half = solid.half_size
    n, d = half.shape
    unit = np.eye(d)
    parts = [np.empty((n, 0))]
    for part in getattr(basis, "shape", ()):
        if part == "corners":
            corners = _corners(basis.element, solid)
            parts.append(corners.reshape(n, corners.shape[1] * d))
        elif part == "half_edges":
            parts.append((half[:, :, None] * unit).reshape(n, d * d))
        elif part == "deformation":
            parts.append(np.tile(unit.ravel(), (n, 1)))
        else:
            parts.append(getattr(solid, part))
    return np.concatenate(parts, axis=1)


def _corners(element: Element, solid: Solid) -> np.ndarray:
    """Corners (n, c, d) of the elements of a mesh, else of the boxes; no volume is negative."""
    corners = solid.corners
    if corners is None:
        corners = solid.x0[:, None, :] + np.array(element.box) * solid.half_size[:, None, :]
    corners = corners.astype(float)
    edges = np.stack([corners[:, b] - corners[:, a] for a, b in element.edges], axis=1)
    negative = np.linalg.det(edges) < 0
    corners[negative] = corners[negative][:, element.mirrored]
    return corners
