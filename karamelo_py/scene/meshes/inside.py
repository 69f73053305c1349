"""Positions in simplices, and inside or near surfaces: found by boxes in a coarse grid."""

import math
from collections.abc import Iterator

import numpy as np

from karamelo_py.scene.meshes.elements import MeshElements, measured
from karamelo_py.script.errors import ScriptError

# Boxes are filed in so many cells on average at most; larger ones make the cells larger.
_MOST = 32
# Faces of a hexahedron, seen from outside counter-clockwise.
_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
# Vertices this close (of the size of the surface) are the same one, written with few digits.
_WELD = 1e-6


class Bins:
    """Boxes with corners (m, d), filed so that the few that may hold a position are found."""

    def __init__(self, lo: np.ndarray, hi: np.ndarray):
        count, d = lo.shape
        self.lo, self.hi = lo.min(axis=0), hi.max(axis=0)
        extent = np.maximum(self.hi - self.lo, np.finfo(float).tiny)
        # As many cells as boxes, more or less.
        size = max((extent.prod() / count) ** (1 / d), extent.max() / count)
        while True:
            self.size = size
            self.cells = np.maximum(1, np.ceil(extent / size)).astype(np.int64)
            first, last = self._index(lo), self._index(hi)
            spans = last - first + 1
            filed = spans.prod(axis=1)
            if filed.sum() <= _MOST * count:
                break
            size *= 1.5
        self.first, self.items = self._file(first, spans, filed)

    def _index(self, x: np.ndarray) -> np.ndarray:
        return np.clip(((x - self.lo) / self.size).astype(np.int64), 0, self.cells - 1)

    def _number(self, index: np.ndarray) -> np.ndarray:
        return np.ravel_multi_index(tuple(index.T), tuple(self.cells))

    def _file(self, first, spans, filed) -> tuple[np.ndarray, np.ndarray]:
        """Boxes in the order of cells, and where those of each cell begin."""
        box = np.repeat(np.arange(len(filed)), filed)
        place = np.arange(len(box)) - np.repeat(np.cumsum(filed) - filed, filed)
        index = np.empty((len(box), spans.shape[1]), np.int64)
        for axis in range(spans.shape[1] - 1, -1, -1):
            place, along = np.divmod(place, spans[box, axis])
            index[:, axis] = first[box, axis] + along
        number = self._number(index)
        order = np.argsort(number, kind="stable")
        begin = np.searchsorted(number[order], np.arange(int(self.cells.prod()) + 1))
        return begin, box[order]

    def candidates(
        self, x: np.ndarray, done: np.ndarray | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pairs of positions and boxes that may hold them: rows of `x` (k,) and boxes (k,).

        Each batch names a position once. Positions that `done` (n,) marks meanwhile are left out.
        """
        rows = np.flatnonzero(((x >= self.lo) & (x <= self.hi)).all(axis=1))
        cell = self._number(self._index(x[rows]))
        place, end = self.first[cell], self.first[cell + 1]
        while True:
            kept = place < end
            if done is not None:
                kept &= ~done[rows]
            rows, place, end = rows[kept], place[kept], end[kept]
            if not len(rows):
                return
            yield rows, self.items[place]
            place = place + 1


class Simplices:
    """Simplices with `corners` (m, k + 1, d), d >= k; their faces belong to them.

    A position may lie by the `tolerance` beyond a face, or beside a simplex with k < d.
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
        """Test which positions (n, d) lie in one of the simplices: (n,) bool."""
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


class Skin:
    """Surface of a body in d dimensions: simplices of d - 1 dimensions, `faces` (m, d, d)."""

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
            distance[rows] = np.minimum(distance[rows], _distance(x[rows], self.faces[items]))
        return distance


def outer_faces(corners: np.ndarray) -> np.ndarray:
    """Faces (m, d, d) that belong to one only of simplices with `corners` (n, d + 1, d)."""
    faces = np.concatenate([np.delete(corners, k, axis=1) for k in range(corners.shape[2] + 1)])
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


class Surface:
    """A closed surface of triangles, perhaps in several parts; it belongs to what it encloses.

    A position is inside if a ray from it upwards (along z) crosses the surface an odd number of
    times. Seen from above, a triangle holds a position if a ray in the plane crosses its outline
    an odd number of times. Triangles that share an edge find the same crossings, bit for bit,
    since the edge is taken in the order of the vertex numbers; and whether an edge is reached at
    all is a comparison without rounding. A position above an edge or a vertex is therefore
    counted once, and no direction needs a second try. (Crossing number: Shimrat 1962,
    Algorithm 112.) An edge that belongs to one triangle only is an error.

    `points` (n, 3) are vertices, `triangles` (m, 3) their numbers; within the `tolerance` a
    position lies on the surface.
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
        for rows, items in self.bins.candidates(np.ascontiguousarray(x[:, :2])):
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
