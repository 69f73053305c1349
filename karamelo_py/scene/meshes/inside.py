"""Shells of triangles, and outer faces of meshes."""

import numpy as np

from karamelo_py.kernels.surfaces import Surface, depths, distances, surface_of
from karamelo_py.scene.meshes.data import FACES, Mesh
from karamelo_py.scene.meshes.elements import MeshElements, measured
from karamelo_py.script.errors import ScriptError

# Distance, relative to the size, within which vertices count as equal, since files have few digits.
_WELD = 1e-6
_SAMPLES = 4000  # approximate number of positions used to test whether one shell lies in another
_SETS = 8  # maximum number of sets of shells that do not overlap


class Skin:
    """The surface of a shape: sets of faces (m, d, d), each a closed surface.

    A position is inside if a set encloses it or a face is within `tolerance`. An `open`
    shape has no interior. `odd`: see `Surface`.
    """

    def __init__(
        self, sets: list[np.ndarray], tolerance: float, *, odd: bool = False, open: bool = False
    ):
        self.tolerance, self.open = tolerance, open
        self.surfaces: list[Surface] = [surface_of(faces, tolerance, odd=odd) for faces in sets]
        # Length, area or volume; None if it is unknown, as sets may overlap.
        self.volume = None if open or odd or len(sets) > 1 else float(abs(_volumes(sets[0]).sum()))

    @property
    def faces(self) -> np.ndarray:
        return np.concatenate([surface.faces for surface in self.surfaces])

    def depth(self, x: np.ndarray, reach: float) -> np.ndarray:
        if self.open:
            return -np.minimum.reduce([distances(surface, x, reach) for surface in self.surfaces])
        return np.maximum.reduce([depths(surface, x, reach) for surface in self.surfaces])

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.depth(np.asarray(x), 2 * self.tolerance) >= -self.tolerance


def _volumes(faces: np.ndarray) -> np.ndarray:
    d = faces.shape[2]
    if d == 1:
        return faces[:, 0, 0] * np.where(np.arange(len(faces)) % 2, 1, -1)
    local = faces - faces.mean(axis=(0, 1))
    return np.linalg.det(local) / (1, 2, 6)[d - 1]


def outer_faces(parts: list[MeshElements]) -> np.ndarray:
    """Return outer faces (m, d, d), oriented outwards; in 1D pairs of ends, the lower end first.

    Quadrilaterals are split along the diagonal through their lowest-numbered node, so that
    neighbouring elements split their common face in the same way.
    """
    triangles: list[np.ndarray] = []
    for elements in parts:
        solid, _, _ = measured(elements)
        local = FACES[solid.shape.name]
        for size in dict.fromkeys(map(len, local)):
            some = [list(face) for face in local if len(face) == size]
            numbers = np.concatenate([solid.numbers[:, face] for face in some])
            once = _once(np.sort(numbers, axis=1))
            corners = np.concatenate([solid.corners[:, face] for face in some])[once]
            triangles += _halves(numbers[once], corners) if size == 4 else [corners]
    faces = np.concatenate(triangles)
    if faces.shape[2] == 1:
        return np.sort(faces, axis=0)[_once(np.sort(faces[:, :, 0], axis=0))]
    order = np.lexsort(np.moveaxis(faces, 2, 0)[::-1], axis=1)
    same = np.take_along_axis(faces, order[:, :, None], axis=1)
    return faces[_once(same.reshape(len(same), -1))]


def flat_faces(parts: list[MeshElements]) -> np.ndarray:
    """Return simplices (m, d, d). In 3D, lines and nodes become triangles with repeated corners."""
    simplices: list[np.ndarray] = []
    for elements in parts:
        corners, d = elements.corners, elements.corners.shape[2]
        whole = _halves(elements.numbers, corners) if corners.shape[1] == 4 else [corners]
        simplices += [np.concatenate([c, *[c[:, -1:]] * (d - c.shape[1])], axis=1) for c in whole]
    return np.concatenate(simplices)


def _once(rows: np.ndarray) -> np.ndarray:
    """Return the indices, ascending, of rows (n, k) that occur an odd number of times."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    begin = np.flatnonzero(np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)])
    odd = np.diff(np.r_[begin, len(rows)]) % 2 == 1
    return np.sort(order[begin[odd]])


def _halves(rank: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    order = (np.argmin(rank, axis=1)[:, None] + np.arange(4)) % 4
    turned = np.take_along_axis(corners, order[:, :, None], axis=1)
    return [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]


def triangles_of(mesh: Mesh) -> np.ndarray:
    parts = [np.empty((0, 3), np.int64)]
    for cells in mesh.cells:
        nodes = cells.nodes
        if cells.type == "triangle":
            parts.append(nodes)
        elif cells.type == "quad":
            a, b, c, d = (mesh.points[nodes[:, k]] for k in range(4))
            sides = np.cross(b - a, c - a) * np.cross(c - a, d - a)
            turned = np.where(sides.sum(axis=1)[:, None] < 0, np.roll(nodes, 1, axis=1), nodes)
            parts += [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]
    return np.concatenate(parts)


def skin_of(points: np.ndarray, triangles: np.ndarray, tolerance: float) -> Skin:
    """Return the closed shells of a surface of `points` (n, 3) with `triangles` (m, 3).

    A shell inside another is a cavity, whatever its orientation; overlapping shells form one body.
    Raises ScriptError for an edge with an odd number of triangles.
    """
    triangles = _closed(points, triangles)
    for sided in (True, False):  # first by the orientation in the file, then ignoring it
        some = _single(triangles, sided=sided)
        some = some if sided else _turned(some)
        edge, way = _edges(some)
        if not np.bincount(edge, way).any():
            break
    else:
        return Skin([points[triangles]], tolerance, odd=True)
    faces, shell = points[some], _shells(edge, sided=sided)
    volume = np.bincount(shell, _volumes(faces))
    negative = volume[shell] < 0
    faces[negative] = faces[negative][:, ::-1]
    if len(volume) == 1:
        return Skin([faces], tolerance)
    order = np.argsort(shell, kind="stable")
    ends = np.searchsorted(shell[order], np.arange(1, len(volume)))
    shells = np.split(faces[order], ends)
    lo, hi = (np.array([end(s, axis=(0, 1)) for s in shells]) for end in (np.min, np.max))
    within = _within(shells, lo, hi, tolerance)
    depth = within.sum(axis=1)
    shells = [s[:, ::-1] if n % 2 else s for s, n in zip(shells, depth, strict=True)]
    # Nested shells join the set of the outermost shell around them. Outermost shells whose boxes do
    # not overlap are in one set; there are at most `_SETS` sets.
    sets: list[list[int]] = []
    for outer in np.flatnonzero(depth == 0):
        members = [outer, *np.flatnonzero(within[:, outer])]
        for one in sets:
            apart = (lo[outer] >= hi[one] - tolerance) | (hi[outer] <= lo[one] + tolerance)
            if apart.any(axis=1).all() or (len(sets) == _SETS and one is sets[-1]):
                one += members
                break
        else:
            sets.append(members)
    return Skin([np.concatenate([shells[k] for k in one]) for one in sets], tolerance)


def _closed(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Merge equal vertices, drop degenerate triangles; raises ScriptError for an open surface."""
    size = np.ptp(points, axis=0).max()
    for spacing in (0.0, _WELD * size):
        same = points if spacing == 0 else np.rint(points / spacing)
        order = np.lexsort(same.T)
        new = np.r_[True, (same[order[1:]] != same[order[:-1]]).any(axis=1)]
        first = np.empty(len(points), np.int64)
        first[order] = order[np.flatnonzero(new)][np.cumsum(new) - 1]
        welded = first[triangles]
        welded = welded[(welded != np.roll(welded, 1, axis=1)).all(axis=1)]
        low, high, _ = _ends(welded)
        edge, count = np.unique(low * len(points) + high, return_counts=True)
        open_edges = edge[count % 2 == 1]
        if not len(open_edges):
            return welded
    where = ", ".join(f"{c:g}" for c in points[[*divmod(open_edges[0], len(points))]].mean(axis=0))
    raise ScriptError(
        f"the surface is not closed: {len(open_edges)} "
        f"edge{'s belong' if len(open_edges) > 1 else ' belongs'} to one triangle only, "
        f"one of them at ({where})",
        argument="file",
        expected="a surface without holes, of which every edge joins two triangles",
        hint="repair it, for example in MeshLab, Blender or Gmsh",
    )


def _ends(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    return np.minimum(a, b), np.maximum(a, b), np.where(a < b, 1, -1)


def _edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge (3 m,) of each triangle side, and the side's direction along it (1 or -1).

    Edges are numbered from 0; coinciding edges have the same number.
    """
    low, high, way = _ends(triangles)
    return np.unique(low * (triangles.max() + 1) + high, return_inverse=True)[1].ravel(), way


def _single(triangles: np.ndarray, *, sided: bool) -> np.ndarray:
    """Drop repeated triangles.

    Where two shells touch, all copies of a triangle are dropped.

    If no triangle would be left, all are returned.
    """
    same = np.sort(triangles, axis=1)
    order = np.lexsort(same.T)
    begin = np.flatnonzero(np.r_[True, (np.diff(same[order], axis=0) != 0).any(axis=1)])
    if len(begin) == len(triangles):
        return triangles
    side = -np.sign(triangles - np.roll(triangles, 1, axis=1)).prod(axis=1)
    count = np.add.reduceat(side[order], begin)
    left = order[begin[count != 0 if sided else count % 2 != 0]]
    return triangles[left] if len(left) else triangles


def _turned(triangles: np.ndarray) -> np.ndarray:
    """Orient triangles such that two of them run along a common edge in opposite directions."""
    edge, way = _edges(triangles)
    m = len(triangles)
    order = np.argsort(edge, kind="stable")
    begin = np.flatnonzero(np.r_[True, np.diff(edge[order]) > 0])
    pairs = begin[np.diff(np.r_[begin, len(order)]) == 2]
    one, other = order[pairs], order[pairs + 1]
    flipped = m * (way[one] == way[other])
    # In this graph, node k is triangle k as in the file, and node m + k is the reversed triangle.
    # Links connect consistent orientations. In each component, the lowest triangle is not reversed.
    one, other = one % m, other % m
    label = _components(np.r_[one, one + m], np.r_[other + flipped, other + m - flipped], 2 * m)
    return np.where((label[:m] > label[m:])[:, None], triangles[:, ::-1], triangles)


def _components(a: np.ndarray, b: np.ndarray, count: int) -> np.ndarray:
    """Return, for each node, the lowest node of its component in a graph with links `a` to `b`."""
    lowest = np.arange(count)
    while (apart := lowest[a] != lowest[b]).any():
        ends = np.sort([lowest[a[apart]], lowest[b[apart]]], axis=0)
        np.minimum.at(lowest, ends[1], ends[0])
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
    return lowest


def _shells(edge: np.ndarray, *, sided: bool) -> np.ndarray:
    """Return the shell (m,) of each triangle; triangles with a common edge are in one shell.

    If not `sided`, only edges of exactly two triangles connect triangles.
    """
    m, edges = len(edge) // 3, edge.max() + 1
    triangle = edges + np.tile(np.arange(m), 3)
    linked = np.full(len(edge), True) if sided else np.bincount(edge)[edge] <= 2
    label = _components(edge[linked], triangle[linked], edges + m)
    return np.unique(label[edges:], return_inverse=True)[1].ravel()


def _within(
    shells: list[np.ndarray], lo: np.ndarray, hi: np.ndarray, tolerance: float
) -> np.ndarray:
    n = len(shells)
    within = np.zeros((n, n), bool)
    for k in range(n):
        inner = np.flatnonzero(((lo >= lo[k]) & (hi <= hi[k])).all(axis=1))
        inner = inner[inner != k]
        if not len(inner):
            continue
        outer = surface_of(shells[k], tolerance)
        for other in inner:
            within[other, k] = (depths(outer, _sample(shells[other]), 2 * tolerance) > 0).all()
    return within & ~within.T


def _sample(faces: np.ndarray) -> np.ndarray:
    some = faces[:: max(1, 21 * len(faces) // _SAMPLES)]
    fraction = np.linspace(0, 1, 8)[:-1, None, None, None]
    return ((1 - fraction) * some + fraction * np.roll(some, -1, axis=1)).reshape(-1, 3)
