"""Elements by their corners: which are known, their volumes and centroids, their orientation."""

import itertools
import math
from typing import NamedTuple

import meshio
import numpy as np

from karamelo_py.scene.meshes.reading import chosen_cells
from karamelo_py.script.errors import ScriptError

# A shape of this part of size^dimension is flat: its volume is rounding.
_FLAT = 1e-12
# Nodes this far (of the mesh's size) beside the plane of a 2D mesh still lie in it.
_PLANE = 1e-9


class Shape(NamedTuple):
    """A shape of elements; nodes are in the order of meshio, which is that of VTK."""

    name: str  # the cell type in meshio
    words: str  # in plural
    dimension: int
    # The order of the nodes that turns a negative orientation into a positive one.
    mirrored: tuple[int, ...]
    # (c, d) signs of the natural coordinates of nodes; none for simplices, whose map is linear.
    natural: tuple[tuple[int, ...], ...] = ()


_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_CUBE = tuple((*xy, z) for z in (-1, 1) for xy in _SQUARE)
SHAPES = {
    shape.name: shape
    for shape in (
        Shape("line", "lines with 2 nodes", 1, (1, 0)),
        Shape("triangle", "triangles with 3 nodes", 2, (0, 2, 1)),
        Shape("quad", "quadrilaterals with 4 nodes", 2, (0, 3, 2, 1), _SQUARE),
        Shape("tetra", "tetrahedra with 4 nodes", 3, (0, 2, 1, 3)),
        Shape("hexahedron", "hexahedra with 8 nodes", 3, (0, 3, 2, 1, 4, 7, 6, 5), _CUBE),
    )
}


# Corners at the ends of edges, in whose middles elements of second order have their next nodes.
_EDGES = {
    "line3": ((0, 1),),
    **dict.fromkeys(("triangle6", "triangle7"), ((0, 1), (1, 2), (2, 0))),
    **dict.fromkeys(("quad8", "quad9"), ((0, 1), (1, 2), (2, 3), (3, 0))),
    "tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    **dict.fromkeys(
        ("hexahedron20", "hexahedron24", "hexahedron27"),
        (*((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)),
         *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))),
    ),
}  # fmt: skip


class MeshElements(NamedTuple):
    """Elements of one shape."""

    shape: Shape
    numbers: np.ndarray  # (n, c) of their nodes
    corners: np.ndarray  # (n, c, d) positions of these

    def mirrored(self, which: np.ndarray) -> "MeshElements":
        """With the orientation of `which` (n,) of them reversed."""
        order = list(self.shape.mirrored)
        numbers, corners = self.numbers.copy(), self.corners.copy()
        numbers[which], corners[which] = numbers[which][:, order], corners[which][:, order]
        return MeshElements(self.shape, numbers, corners)


def elements_of(
    mesh: meshio.Mesh, dimension: int, group: str | int | None = None, *, lower: bool = False
) -> list[MeshElements]:
    """The elements of `dimension` in a mesh or its physical `group`, one item for each shape.

    With `lower`, a group of lower dimension, such as a boundary, will do. None, elements of other
    types, and a mesh out of the plane z = 0 in 2D, beside the x axis in 1D are errors.
    """
    cells = chosen_cells(mesh, group)
    of = f"group '{group}'" if group is not None else "the mesh"
    highest = max(d for _, d, _ in cells)
    if highest > dimension or (highest < dimension and not lower) or highest < 1:
        types = ", ".join(dict.fromkeys(name for name, _, _ in cells))
        raise ScriptError(
            f"{of} does not fit {dimension}D: it has elements of type {types}",
            argument="file" if group is None else "group",
            expected=_accepted(dimension),
        )
    wanted = [_by_corners(name, nodes) for name, d, nodes in cells if d == highest]
    for name, _ in wanted:
        if name not in SHAPES:
            raise ScriptError(
                f"{of} has elements of type {name}",
                argument="file",
                expected=_accepted(highest),
                hint="in Gmsh, Mesh.ElementOrder = 1",
            )
    positions = np.zeros((len(mesh.points), 3))
    positions[:, : mesh.points.shape[1]] = mesh.points
    used = np.unique(np.concatenate([nodes.ravel() for _, nodes in wanted]))
    _check_plane(positions[used], dimension)
    positions = np.ascontiguousarray(positions[:, :dimension])
    found = []
    for name in dict.fromkeys(name for name, _ in wanted):
        numbers = _once(np.concatenate([nodes for other, nodes in wanted if other == name]))
        found.append(MeshElements(SHAPES[name], numbers, positions[numbers]))
    return found


def bulge_of(mesh: meshio.Mesh, group: str | int | None = None) -> float:
    """Find how far nodes in the middle of edges lie beside these, over their length, at most."""
    found = 0.0
    for name, _, nodes in chosen_cells(mesh, group):
        corners = _by_corners(name, nodes)[1].shape[1]
        for k, (a, b) in enumerate(_EDGES.get(name, ())):
            a, b, middle = (mesh.points[nodes[:, i]] for i in (a, b, corners + k))
            length = np.linalg.norm(b - a, axis=1)
            beside = np.linalg.norm(middle - (a + b) / 2, axis=1)
            found = max(found, float((beside / np.maximum(length, np.finfo(float).tiny)).max()))
    return found


def _by_corners(name: str, nodes: np.ndarray) -> tuple[str, np.ndarray]:
    """Reduce elements to their corners, which come first: type and nodes (n, c)."""
    shape = SHAPES.get(name.rstrip("0123456789"))
    return (shape.name, nodes[:, : len(shape.mirrored)]) if shape else (name, nodes)


def _once(numbers: np.ndarray) -> np.ndarray:
    """Each element once: older formats repeat those that belong to two physical groups."""
    _, first = np.unique(np.sort(numbers, axis=1), axis=0, return_index=True)
    return numbers[np.sort(first)]


def _accepted(dimension: int) -> str:
    return " or ".join(shape.words for shape in SHAPES.values() if shape.dimension == dimension)


def _check_plane(positions: np.ndarray, dimension: int) -> None:
    """Refuse nodes that lie beside the x axis in 1D or the plane z = 0 in 2D."""
    beside = np.abs(positions[:, dimension:]).max() if dimension < 3 else 0.0
    if beside > _PLANE * np.ptp(positions, axis=0).max():
        raise ScriptError(
            f"the mesh does not lie {'on the x axis' if dimension == 1 else 'in the plane z = 0'}: "
            f"a node is {beside:g} away from it",
            argument="file",
            expected=f"a mesh for {dimension}D",
        )


def measured(elements: MeshElements) -> tuple[MeshElements, np.ndarray, np.ndarray]:
    """The elements with positive orientation, their volumes (n,) and their centroids (n, d).

    Volume and centroid are those of the region that the map of the element covers, faces that are
    not plane included: integrals of det J and x det J by 2 Gauss points per direction, which is
    exact, since both are polynomials of degree 3 at most in each natural coordinate. An element
    that is flat or twisted is an error.
    """
    shape, corners = elements.shape, elements.corners
    # About the first node, so that a mesh far from the origin loses no digits.
    local = corners - corners[:, :1]
    if shape.natural:
        weights, x = _by_quadrature(shape, local)
    else:
        edges = local[:, 1:]
        weights = np.linalg.det(edges)[:, None] / math.factorial(shape.dimension)
        x = local.mean(axis=1)[:, None]
    volume = weights.sum(axis=1)
    size = np.ptp(corners, axis=1).max(axis=1)
    flat = np.abs(volume) <= _FLAT * size**shape.dimension
    twisted = ~flat & (weights * np.sign(volume)[:, None] <= 0).any(axis=1)
    for bad, what in ((flat, "has no volume"), (twisted, "is twisted: it overlaps itself")):
        if bad.any():
            number = int(np.argmax(bad))
            where = ", ".join(f"{c:g}" for c in corners[number].mean(axis=0))
            raise ScriptError(
                f"element {number + 1} of the {len(volume)} {shape.words} {what}; "
                f"it lies at ({where})",
                argument="file",
                expected="elements with a volume, their nodes in the order of the format",
            )
    centroid = corners[:, 0] + (weights[:, :, None] * x).sum(axis=1) / volume[:, None]
    return elements.mirrored(volume < 0), np.abs(volume), centroid


def _by_quadrature(shape: Shape, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """det J (n, q) and position (n, q, d) at the 2^d Gauss points, all of weight 1."""
    natural = np.array(shape.natural, float)
    gauss = np.array(list(itertools.product((-1, 1), repeat=shape.dimension))) / math.sqrt(3)
    factors = (1 + natural[None] * gauss[:, None]) / 2  # (q, c, d)
    functions = factors.prod(axis=2)
    slopes = np.empty_like(factors)
    for axis in range(shape.dimension):
        others = np.delete(factors, axis, axis=2).prod(axis=2)
        slopes[:, :, axis] = others * natural[:, axis] / 2
    jacobian = np.einsum("nci,qcj->nqij", corners, slopes)
    return np.linalg.det(jacobian), np.einsum("qc,nci->nqi", functions, corners)
