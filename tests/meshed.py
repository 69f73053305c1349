"""Small meshes and surfaces for tests, written with meshio."""

import itertools

import meshio
import numpy as np

_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_CUBE = tuple((*xy, z) for z in (0, 1) for xy in _SQUARE)
_TETRAHEDRA = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
# The cells that one unit cube (square, interval) is cut into.
CUTS = {
    "line": ((0,), (1,)),
    "quad": _SQUARE,
    "triangle": _SQUARE,
    "hexahedron": _CUBE,
    "tetra": _CUBE,
}
PARTS = {"triangle": ((0, 1, 2), (0, 2, 3)), "tetra": _TETRAHEDRA}


def grid_mesh(cell, counts, moved=None):
    """Nodes (n, 3) and cells of a unit box cut into `counts` boxes, the nodes `moved` by a map."""
    shape = [n + 1 for n in counts]
    nodes = np.zeros((int(np.prod(shape)), 3))
    index = np.array(list(itertools.product(*map(range, shape))))
    nodes[:, : len(counts)] = index / counts
    corners = np.array(CUTS[cell])
    cells = []
    for first in itertools.product(*map(range, counts)):
        numbers = np.ravel_multi_index((corners + first).T, shape)
        cells += [numbers[list(part)] for part in PARTS.get(cell, [range(len(numbers))])]
    if moved is not None:
        nodes[:, : len(counts)] = moved(nodes[:, : len(counts)])
    return nodes, np.array(cells)


def write(path, nodes, cells, **options):
    """Write {type: cells} and return the path."""
    meshio.write(path, meshio.Mesh(nodes, cells), **options)
    return path


def cube_surface(lo=0.0, hi=1.0):
    """Vertices and triangles of a cube, normals outward."""
    corners = lo + (hi - lo) * np.array(_CUBE, float)
    faces = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return corners, np.array(triangles)


def sphere_surface(radius, meridians, parallels, centre=(0, 0, 0)):
    """Vertices and triangles of a polyhedron with its vertices on a sphere."""
    rings = np.linspace(0, np.pi, parallels + 1)[1:-1]
    around = 2 * np.pi * np.arange(meridians) / meridians
    points = [(0, 0, 1)]
    points += [
        (np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for t in rings for p in around
    ]
    points.append((0, 0, -1))
    last = len(points) - 1
    triangles = []
    for k in range(meridians):
        n = (k + 1) % meridians
        triangles.append((0, 1 + k, 1 + n))
        for ring in range(len(rings) - 1):
            a, b = 1 + ring * meridians, 1 + (ring + 1) * meridians
            triangles += [(a + k, b + k, b + n), (a + k, b + n, a + n)]
        a = 1 + (len(rings) - 1) * meridians
        triangles.append((last, a + n, a + k))
    return radius * np.array(points) + centre, np.array(triangles)


def enclosed_volume(points, triangles):
    """By the divergence theorem: a sixth of the sum of a . (b x c)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
