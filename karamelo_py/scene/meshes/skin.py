"""Surfaces of points, lines or triangles: how far positions are from them."""

import math

import numpy as np

from karamelo_py.scene.meshes.bins import Bins


class Skin:
    """Surface of a body in d dimensions: simplices of d - 1 dimensions.

    Parameters
    ----------
    faces
        Their corners, (m, d, d).
    """

    def __init__(self, faces: np.ndarray):
        self.faces = faces
        self.lo, self.hi = faces.min(axis=1), faces.max(axis=1)
        if faces.shape[2] == 3:
            normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            self.normal = normal / np.maximum(size, np.finfo(float).tiny)
        self._bins: dict[int, Bins] = {}

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Distance of positions (n, d) from the nearest face, `reach` at most: (n,)."""
        distance, d = np.full(len(x), reach), x.shape[1]
        widen = math.ceil(math.log2(reach))  # so that few tables are made
        if widen not in self._bins:
            self._bins[widen] = Bins(self.lo - 2.0**widen, self.hi + 2.0**widen)
        for rows, items in self._bins[widen].candidates(x):
            known = distance[rows][:, None]
            near = ((x[rows] > self.lo[items] - known) & (x[rows] < self.hi[items] + known)).all(1)
            rows, items = rows[near], items[near]
            if d == 3:
                height = np.einsum("ni,ni->n", x[rows] - self.faces[items, 0], self.normal[items])
                near = np.abs(height) < distance[rows]
                rows, items = rows[near], items[near]
            found = _distance(x[rows], self.faces[items])
            distance[rows] = np.minimum(distance[rows], found)
        return distance


def outer_faces(corners: np.ndarray) -> np.ndarray:
    """Faces (m, d, d) that belong to one only of simplices with `corners` (n, d + 1, d)."""
    d = corners.shape[2]
    faces = np.concatenate([np.delete(corners, k, axis=1) for k in range(d + 1)])
    order = np.lexsort(np.moveaxis(faces, 2, 0)[::-1], axis=1)
    same = np.take_along_axis(faces, order[:, :, None], axis=1)
    _, first, count = np.unique(
        same.reshape(len(same), -1), axis=0, return_index=True, return_counts=True
    )
    return faces[first[count == 1]]


def _distance(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Of positions (n, d) from a face each, (n, d, d)."""
    if faces.shape[1] == 1:
        return np.abs(x - faces[:, 0])[:, 0]
    ways = [(k, (k + 1) % faces.shape[1]) for k in range(faces.shape[1])]
    distance = np.min([_from_line(x, faces[:, i], faces[:, j]) for i, j in ways], axis=0)
    if faces.shape[1] == 2:
        return distance
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    size = np.linalg.norm(normal, axis=1)
    above = size > 0
    for i, j in ways:
        side = np.cross(faces[:, j] - faces[:, i], x - faces[:, i])
        above &= np.einsum("ni,ni->n", side, normal) >= 0
    height = np.abs(np.einsum("ni,ni->n", x - faces[:, 0], normal))
    distance[above] = height[above] / size[above]
    return distance


def _from_line(x: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    way, local = end - start, x - start
    square = np.maximum(np.einsum("ni,ni->n", way, way), np.finfo(float).tiny)
    along = np.clip(np.einsum("ni,ni->n", way, local) / square, 0, 1)
    return np.linalg.norm(local - along[:, None] * way, axis=1)
