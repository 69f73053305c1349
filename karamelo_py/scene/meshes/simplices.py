"""Triangles and tetrahedra (lines, too): which positions lie in one of them."""

import numpy as np

from karamelo_py.scene.meshes.bins import Bins
from karamelo_py.scene.meshes.elements import MeshElements, measured

# Faces of a hexahedron, seen from outside counter-clockwise.
_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


class Simplices:
    """Simplices with k + 1 corners in d >= k dimensions; their faces belong to them.

    Parameters
    ----------
    corners
        Their corners, (m, k + 1, d).
    tolerance
        How far beyond a face, or beside a simplex with k < d, a position may lie.
    """

    def __init__(self, corners: np.ndarray, tolerance: float):
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        gram = np.swapaxes(edges, 1, 2) @ edges
        size = np.ptp(corners, axis=1).max(axis=1)
        k = edges.shape[2]
        solid = np.linalg.det(gram) > (1e-12 * size**k) ** 2
        corners, edges, gram = corners[solid], edges[solid], gram[solid]
        self.tolerance = tolerance
        self.origin = corners[:, 0]
        self.edges = edges
        # Of the barycentric coordinates; the first one is 1 minus the others.
        self.inverse = (
            np.linalg.inv(edges)
            if edges.shape[1] == k
            else np.linalg.solve(gram, np.swapaxes(edges, 1, 2))
        )
        slopes = np.linalg.norm(self.inverse, axis=2)
        first = np.linalg.norm(self.inverse.sum(axis=1), axis=1)
        # A distance from a face, in barycentric coordinates.
        self.slack = -tolerance * np.column_stack([first, slopes])
        self.flat = k < corners.shape[2]
        self.bins = Bins(corners.min(axis=1) - tolerance, corners.max(axis=1) + tolerance)

    def contain(self, x: np.ndarray) -> np.ndarray:
        """Which positions (n, d) lie in one of the simplices: (n,) bool."""
        inside = np.zeros(len(x), bool)
        for rows, items in self.bins.candidates(x, done=inside):
            local = x[rows] - self.origin[items]
            coordinates = np.einsum("nij,nj->ni", self.inverse[items], local)
            slack = self.slack[items]
            within = (coordinates >= slack[:, 1:]).all(axis=1)
            within &= 1 - coordinates.sum(axis=1) >= slack[:, 0]
            if self.flat:
                beside = local - np.einsum("nij,nj->ni", self.edges[items], coordinates)
                within &= np.einsum("ni,ni->n", beside, beside) <= self.tolerance**2
            inside[rows[within]] = True
        return inside


def split(elements: MeshElements) -> np.ndarray:
    """The simplices (m, k + 1, d) that the elements are made of.

    A hexahedron becomes 12 tetrahedra about its middle. Faces that are not plane are split along
    the diagonal from their lowest node number, so that neighbours agree and leave no gap.
    """
    shape = elements.shape.name
    corners = elements.corners
    if shape == "hexahedron":
        elements = measured(elements)[0]
        middle = elements.corners.mean(axis=1, keepdims=True)
        parts = [
            np.concatenate([np.broadcast_to(middle, (len(middle), 1, 3)), triangle], axis=1)
            for face in _FACES
            for triangle in _halves(elements.numbers[:, face], elements.corners[:, face])
        ]
        return np.concatenate(parts)
    if shape == "quad" and corners.shape[2] == 2:
        # Of the diagonals, one that stays inside.
        corners = measured(elements)[0].corners
        sides = np.roll(corners, -1, axis=1) - corners
        turn = np.roll(sides, 1, axis=1)
        reflex = turn[..., 0] * sides[..., 1] - turn[..., 1] * sides[..., 0]
        return np.concatenate(_halves(reflex, corners))
    if shape == "quad":
        return np.concatenate(_halves(elements.numbers, corners))
    return corners


def _halves(rank: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """The two triangles of quadrilaterals (n, 4, d), cut from the corner of lowest `rank`."""
    order = (np.argmin(rank, axis=1)[:, None] + np.arange(4)) % 4
    turned = np.take_along_axis(corners, order[:, :, None], axis=1)
    return [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]
