"""Elements: volumes, centroids and orientation."""

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from karamelo_py.scene.meshes.data import CellBlock, Mesh
from karamelo_py.script.errors import ScriptError

# Smallest accepted volume / size^dimension.
_FLAT = 1e-12
# Accepted distance from the plane of a 2D mesh, relative to its size.
_PLANE = 1e-9
_CHUNK = 4096
# If fewer curved elements than this fraction are folded at an edge, the mesher made the folds, and
# signed sums are right. If more are folded, the nodes are in the wrong order.
_FOLDED = 0.01


class Shape(NamedTuple):
    name: str
    words: str
    dimension: int
    mirrored: tuple[int, ...]
    corners: tuple[tuple[float, ...], ...]  # natural coordinates
    simplex: bool = False  # natural coordinates >= 0 with a sum <= 1; otherwise from -1 to 1


_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_CUBE = tuple((*xy, z) for z in (-1, 1) for xy in _SQUARE)
_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_WEDGE = tuple((*xy, z) for z in (-1, 1) for xy in _TRIANGLE)
_PYRAMID = (*((*xy, 0) for xy in _SQUARE), (0, 0, 1))
_TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
SHAPES = {
    shape.name: shape
    for shape in (
        Shape("vertex", "nodes", 0, (0,), ((),), True),
        Shape("line", "lines", 1, (1, 0), ((-1,), (1,))),
        Shape("triangle", "triangles", 2, (0, 2, 1), _TRIANGLE, True),
        Shape("quad", "quadrilaterals", 2, (0, 3, 2, 1), _SQUARE),
        Shape("tetra", "tetrahedra", 3, (0, 2, 1, 3), _TETRAHEDRON, True),
        Shape("hexahedron", "hexahedra", 3, (0, 3, 2, 1, 4, 7, 6, 5), _CUBE),
        Shape("wedge", "wedges", 3, (0, 2, 1, 3, 5, 4), _WEDGE),
        Shape("pyramid", "pyramids", 3, (0, 3, 2, 1, 4), _PYRAMID),
    )
}

# For each second-order node, the corners around it: first of edges, then of faces.
MIDDLES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line": ((0, 1),),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 1, 2, 3)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)),
        *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
        *((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 1, 2, 3), (4, 5, 6, 7)),
        tuple(range(8)),
    ),
    "wedge": (
        *((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        *((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ),
}


class MeshElements(NamedTuple):
    shape: Shape
    numbers: np.ndarray  # (n, c) numbers of the corner nodes
    corners: np.ndarray
    nodes: np.ndarray | None = None  # (n, k, d) positions of all nodes, if not only corners
    reference: tuple[tuple[float, ...], ...] = ()  # natural coordinates of `nodes`
    bulge: float = 0.0  # distance of `nodes` from the straight element / its size

    def mirrored(self, which: np.ndarray) -> "MeshElements":
        """Reverse the elements `which` (n,); corners only."""
        order = list(self.shape.mirrored)
        numbers, corners = self.numbers.copy(), self.corners.copy()
        numbers[which], corners[which] = numbers[which][:, order], corners[which][:, order]
        return MeshElements(self.shape, numbers, corners)


def elements_of(
    mesh: Mesh, dimension: int, group: str | int | None = None, *, lower: bool = False
) -> list[MeshElements]:
    """Return elements of `dimension` in a mesh or its `group`, one item per type.

    With `lower`, groups of lower dimension, such as a boundary, are accepted. Raises ScriptError
    for missing elements, unsupported types, and nodes off z = 0 in 2D or the x axis in 1D.
    """
    chosen = mesh.chosen(group)
    of = f"group '{group}'" if group is not None else "the mesh"
    highest = max(cells.dimension for cells in chosen)
    if highest > dimension or (highest < dimension and not lower) or highest < 0:
        strange = [cells.type for cells in chosen if cells.dimension < 0]
        types = ", ".join(dict.fromkeys(strange or [cells.type for cells in chosen]))
        raise ScriptError(
            f"{of} does not fit {dimension}D: it has elements of type {types}",
            argument="file" if group is None else "group",
            expected=_accepted(dimension),
        )
    wanted = [in_order(cells) for cells in chosen if cells.dimension in (-1, highest)]
    for cells in wanted:
        if cells.family not in SHAPES:
            raise ScriptError(
                f"{of} has elements of type {cells.label or cells.family}",
                argument="file",
                expected=_accepted(highest),
            )
    used = np.unique(np.concatenate([cells.nodes.ravel() for cells in wanted]))
    _check_plane(mesh.points[used], dimension)
    positions = np.ascontiguousarray(mesh.points[:, :dimension])
    kinds: dict[tuple[str, tuple], list[np.ndarray]] = {}
    for cells in wanted:
        reference = _reference(cells)
        kept = cells.nodes[:, : len(reference)]
        kinds.setdefault((cells.family, reference), []).append(kept)
    groups = []
    for (name, reference), parts in kinds.items():
        shape, numbers = SHAPES[name], _once(np.concatenate(parts))
        corners = len(shape.corners)
        groups.append(MeshElements(shape, numbers[:, :corners], positions[numbers[:, :corners]]))
        if len(reference) > corners:
            nodes = positions[numbers[:, : len(reference)]]
            bulge = _bulge(shape, nodes, reference)
            groups[-1] = groups[-1]._replace(nodes=nodes, reference=reference, bulge=bulge)
    return groups


def in_order(cells: CellBlock) -> CellBlock:
    order = {
        "pixel": ("quad", [[0, 1, 3, 2]]),
        "voxel": ("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]]),
        "hexa_prism": ("hexahedron", [[0, 1, 2, 3, 6, 7, 8, 9], [0, 3, 4, 5, 6, 9, 10, 11]]),
    }
    if cells.type not in order:
        return cells
    name, parts = order[cells.type]
    return CellBlock(name, np.concatenate([cells.nodes[:, corners] for corners in parts]))


def _reference(cells: CellBlock) -> tuple[tuple[float, ...], ...]:
    """Return natural coordinates of all nodes, or only of the corners if others are unknown."""
    shape, count = SHAPES[cells.family], cells.nodes.shape[1]
    if cells.reference is not None:
        coordinates = tuple(map(tuple, cells.reference.tolist()))
    else:
        corners = np.array(shape.corners, float)
        middles = [corners[list(of)].mean(axis=0) for of in MIDDLES.get(shape.name, ())]
        coordinates = tuple(
            map(tuple, np.concatenate([corners, *(m[None] for m in middles)]).tolist())
        )
        if count > len(coordinates):
            coordinates = coordinates[: len(corners)]
    while len(coordinates) > len(shape.corners):
        coordinates = coordinates[: min(count, len(coordinates))]
        if _exponents(shape.name, len(coordinates)) is not None:
            return coordinates
        coordinates = coordinates[: len(coordinates) - 1]  # without the centre node
    return coordinates[: len(shape.corners)]


@lru_cache
def _exponents(name: str, count: int) -> tuple[tuple[int, ...], ...] | None:
    d = SHAPES[name].dimension
    for p in range(1, 11):
        every = tuple(itertools.product(range(p + 1), repeat=d))
        if SHAPES[name].simplex:
            spaces = [[e for e in every if sum(e) <= p]]
        elif name == "wedge":
            flat = [e for e in every if e[0] + e[1] <= p]
            linear = [e for e in flat if e[2] < 2 or e[0] + e[1] < 2]
            spaces = [flat, linear] if p == 2 else [flat]
        elif name == "pyramid":
            return None
        else:  # complete polynomials, or serendipity (Arnold & Awanou 2011)
            spaces = [list(every)]
            if p > 1 and d > 1:
                spaces.append([e for e in every if sum(k for k in e if k > 1) <= p])
        for space in spaces:
            if len(space) == count:
                return tuple(space)
    return None


def _bulge(shape: Shape, nodes: np.ndarray, reference: tuple) -> float:
    functions, _ = _functions(shape.name, shape.corners, np.array(reference))
    straight = np.einsum("qc,nci->nqi", functions, nodes[:, : len(shape.corners)])
    size = np.ptp(nodes, axis=1).max(axis=1)
    off = np.linalg.norm(nodes - straight, axis=2).max(axis=1)
    return float((off / np.maximum(size, np.finfo(float).tiny)).max())


def _once(numbers: np.ndarray) -> np.ndarray:
    """Drop repeated elements. Older formats repeat elements that are in two physical groups."""
    _, first = np.unique(np.sort(numbers, axis=1), axis=0, return_index=True)
    return numbers[np.sort(first)]


def _accepted(dimension: int) -> str:
    return " or ".join(shape.words for shape in SHAPES.values() if shape.dimension == dimension)


def _check_plane(positions: np.ndarray, dimension: int) -> None:
    distance = np.abs(positions[:, dimension:]).max() if dimension < 3 else 0.0
    if distance > _PLANE * np.ptp(positions, axis=0).max():
        raise ScriptError(
            f"the mesh does not lie {'on the x axis' if dimension == 1 else 'at z = 0'}: "
            f"a node is {distance:g} away from it",
            argument="file",
            expected=f"a mesh for {dimension}D",
        )


def measured(elements: MeshElements) -> tuple[MeshElements, np.ndarray, np.ndarray]:
    """Return elements with positive orientation, volumes (n,) and centroids (n, d).

    Integrals of det J and x det J are exact, also with curved edges and warped faces. Raises
    ScriptError for a flat or twisted element. A few curved elements may be folded at an edge.
    """
    shape = elements.shape
    nodes = elements.corners if elements.nodes is None else elements.nodes
    reference = elements.reference or shape.corners
    volume = np.empty(len(nodes))
    centroid = np.empty((len(nodes), shape.dimension))
    twisted = np.zeros(len(nodes), bool)
    for first in range(0, len(nodes), _CHUNK):
        batch = slice(first, first + _CHUNK)
        # Far from the origin, positions relative to the first node have more digits.
        local = nodes[batch] - nodes[batch, :1]
        weights, x = _integrated(shape, reference, local)
        volume[batch] = weights.sum(axis=1)
        twisted[batch] = (weights * np.sign(volume[batch])[:, None] <= 0).any(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            moment = (weights[:, :, None] * x).sum(axis=1) / volume[batch, None]
        centroid[batch] = nodes[batch, 0] + moment
    flat = np.abs(volume) <= _FLAT * np.ptp(nodes, axis=1).max(axis=1) ** shape.dimension
    if elements.nodes is not None and twisted.mean() < _FOLDED:
        twisted[:] = False
    for bad, error in ((flat, "has no volume"), (twisted, "is twisted: it overlaps itself")):
        if bad.any():
            number = int(np.argmax(bad))
            where = ", ".join(f"{c:g}" for c in nodes[number].mean(axis=0))
            raise ScriptError(
                f"element {number + 1} of the {len(volume)} {shape.words} with "
                f"{nodes.shape[1]} nodes {error}; it lies at ({where})",
                argument="file",
                expected="elements with a volume, their nodes in the order of the format",
            )
    return elements.mirrored(volume < 0), np.abs(volume), centroid


def _integrated(shape: Shape, reference: tuple, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if shape.simplex and len(reference) == len(shape.corners):
        edges = nodes[:, 1:] - nodes[:, :1]
        weights = np.linalg.det(edges)[:, None] / math.factorial(shape.dimension)
        return weights, nodes.mean(axis=1)[:, None]
    rule, functions, slopes = _quadrature(shape.name, reference)
    jacobian = np.einsum("nci,qcj->nqij", nodes, slopes)
    return np.linalg.det(jacobian) * rule, np.einsum("qc,nci->nqi", functions, nodes)


@lru_cache
def _quadrature(name: str, reference: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return weights (q,), shape functions (q, c) and slopes (q, c, d) at Gauss points."""
    shape = SHAPES[name]
    exponents = _exponents(name, len(reference))
    order = max(map(max, exponents)) if exponents else 1  # a pyramid is a cube with merged corners
    d = shape.dimension
    at, weight = np.polynomial.legendre.leggauss(-(-(d + 1) * order // 2))
    points = np.array(list(itertools.product(at, repeat=d)))
    weights = np.prod(list(itertools.product(weight, repeat=d)), axis=1)
    room = np.ones(len(points))
    for axis in range({"triangle": 2, "tetra": 3, "wedge": 2}.get(name, 0)):
        weights = weights / 2 * room
        points[:, axis] = (points[:, axis] + 1) / 2 * room
        room = room - points[:, axis]
    return weights, *_functions(name, reference, points)


@lru_cache
def _coefficients(name: str, reference: tuple) -> tuple[np.ndarray, np.ndarray]:
    exponents = np.array(_exponents(name, len(reference)))
    nodes = np.array(reference, float)
    table = np.prod(nodes[:, None, :] ** exponents[None], axis=2)  # 0^0 is 1, as needed
    return exponents, np.linalg.inv(table)


def _functions(name: str, reference: tuple, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return shape functions (q, c) and slopes (q, c, d) at `points`, for nodes at `reference`."""
    if name == "pyramid":
        return _of_pyramids(points)
    exponents, inverse = _coefficients(name, reference)
    powers = points[:, None, :] ** exponents[None]
    functions = np.prod(powers, axis=2) @ inverse
    slopes = []
    for axis in range(points.shape[1]):
        of = powers.copy()
        lower = np.maximum(exponents[:, axis] - 1, 0)
        of[:, :, axis] = exponents[:, axis] * points[:, None, axis] ** lower
        slopes.append(np.prod(of, axis=2) @ inverse)
    return functions, np.stack(slopes, axis=2)


def _of_pyramids(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    cube = SHAPES["hexahedron"].corners
    functions, slopes = _functions("hexahedron", cube, points)
    upper = [of[:, 4:].sum(axis=1, keepdims=True) for of in (functions, slopes)]
    return (
        np.concatenate([functions[:, :4], upper[0]], axis=1),
        np.concatenate([slopes[:, :4], upper[1]], axis=1),
    )
