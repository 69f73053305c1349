"""Closed surfaces of triangles: which positions lie inside."""

import numpy as np

from karamelo_py.scene.meshes.bins import Bins
from karamelo_py.scene.meshes.simplices import Simplices
from karamelo_py.script.errors import ScriptError

# Vertices this close (of the size of the surface) are the same one, written with few digits.
_WELD = 1e-6


class Surface:
    """A surface that encloses space, perhaps in several parts; it belongs to what it encloses.

    A position is inside if a ray from it upwards (along z) crosses the surface an odd number of
    times. Seen from above, a triangle holds a position if a ray in the plane crosses its outline
    an odd number of times. Triangles that share an edge find the same crossings, bit for bit,
    since the edge is taken in the order of the vertex numbers; and whether an edge is reached at
    all is a comparison without rounding. A position above an edge or a vertex is therefore
    counted once, and no direction needs a second try. (Crossing number: Shimrat 1962,
    Algorithm 112.)

    Parameters
    ----------
    points
        Vertices, (n, 3).
    triangles
        Vertex numbers, (m, 3).
    tolerance
        Distance within which a position lies on the surface.

    Raises
    ------
    ScriptError
        When an edge belongs to one triangle only.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, tolerance: float):
        triangles = _closed(points, triangles)
        self.corners = corners = points[triangles]
        self.skin = Simplices(corners, tolerance)
        # Edges by number, lower first; each as (start, end), seen from above.
        ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
        self.start, self.end = points[ends[..., 0], :2], points[ends[..., 1], :2]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        self.normal = np.cross(b - a, c - a)
        self.origin = a
        self.bottom, self.top = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
        flat = corners[..., :2]
        # Wider by the tolerance: a crossing may be found an ulp beside the triangle.
        self.bins = Bins(flat.min(axis=1) - tolerance, flat.max(axis=1) + tolerance)

    def encloses(self, x: np.ndarray) -> np.ndarray:
        """Test which positions (n, 3) lie inside or on the surface: (n,) bool."""
        odd = np.zeros(len(x), bool)
        flat = np.ascontiguousarray(x[:, :2])
        for rows, items in self.bins.candidates(flat):
            odd[rows] ^= self._crossed(x[rows], items)
        return odd | self.skin.contain(x)

    def _crossed(self, x: np.ndarray, items: np.ndarray) -> np.ndarray:
        """Test if the ray upwards from each position crosses the triangle beside it: (k,) bool."""
        start, end = self.start[items], self.end[items]
        y = x[:, None, 1]
        reached = (start[..., 1] > y) != (end[..., 1] > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            part = (y - start[..., 1]) / (end[..., 1] - start[..., 1])
            at = start[..., 0] + part * (end[..., 0] - start[..., 0])
            crossed = (reached & (x[:, None, 0] < at)).sum(axis=1) % 2 == 1
            normal, local = self.normal[items], x - self.origin[items]
            rise = -(normal[:, 0] * local[:, 0] + normal[:, 1] * local[:, 1]) / normal[:, 2]
            height = self.origin[items, 2] + rise
        # A triangle on edge has any height between its ends: there the position is beside it.
        height = np.clip(np.nan_to_num(height), self.bottom[items], self.top[items])
        return crossed & (height > x[:, 2])


def _closed(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles with equal vertices numbered alike; an error if the surface is open."""
    size = np.ptp(points, axis=0).max()
    for spacing in (0.0, _WELD * size):
        same = points if spacing == 0 else np.rint(points / spacing)
        _, first, number = np.unique(same, axis=0, return_index=True, return_inverse=True)
        welded = first[number.ravel()][triangles]
        edges = np.sort(
            np.concatenate([welded[:, [0, 1]], welded[:, [1, 2]], welded[:, [2, 0]]]), axis=1
        )
        edges = edges[edges[:, 0] != edges[:, 1]]
        unique, count = np.unique(edges, axis=0, return_counts=True)
        open_edges = unique[count % 2 == 1]
        if not len(open_edges):
            return welded
    where = ", ".join(f"{c:g}" for c in points[open_edges[0]].mean(axis=0))
    raise ScriptError(
        f"the surface is not closed: {len(open_edges)} "
        f"edge{'s belong' if len(open_edges) > 1 else ' belongs'} to one triangle only, "
        f"one of them at ({where})",
        argument="file",
        expected="a surface without holes, of which every edge joins two triangles",
        hint="repair it, for example in MeshLab, Blender or Gmsh",
    )
