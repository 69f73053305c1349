"""Mesh data in the form that all readers return."""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import NamedTuple, TypeVar

import numpy as np

from karamelo_py.script.errors import unknown

# meshio's type without the number of nodes, by family of cells.
DIMENSIONS = {
    "vertex": 0, "line": 1, "triangle": 2, "quad": 2, "polygon": 2, "pixel": 2,
    "tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3, "voxel": 3, "hexa_prism": 3,
}  # fmt: skip


_MANY = 100  # number of names above which messages list only a few


class CellBlock(NamedTuple):
    type: str  # meshio's cell type, such as tetra10
    nodes: np.ndarray  # (n, c) node numbers from 0, corners first
    # (c, d) natural coordinates of the nodes; None: the order of VTK
    reference: np.ndarray | None = None
    label: str = ""  # cell type in the file, if it differs from meshio's

    @property
    def family(self) -> str:
        return self.type.rstrip("0123456789")

    @property
    def dimension(self) -> int:
        return DIMENSIONS.get(self.family, -1)


Of = TypeVar("Of")


class OnDemand(Mapping[str, Of]):
    def __init__(self, names: Collection[str], of: Callable[[str], Of]):
        self.names, self.of = names, of

    def __getitem__(self, name: str) -> Of:
        if name not in self.names:
            raise KeyError(name)
        return self.of(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


class Mesh(NamedTuple):
    points: np.ndarray  # (N, 3)
    cells: list[CellBlock]
    sets: Mapping[str, list[np.ndarray]]  # masks (n,), one per block of `cells`
    node_sets: Mapping[str, np.ndarray]  # masks (N,)
    left_out: dict[str, int]  # number of ignored elements by type, such as springs

    def chosen(self, group: str | int | None) -> list[CellBlock]:
        """Return cells of an element set, outer faces of a node set, or all cells.

        Raises ScriptError if the group is unknown or empty.
        """
        if group is None:
            masks = [np.ones(len(cells.nodes), bool) for cells in self.cells]
        else:
            name = self._name_of(str(group))
            if name not in self.sets:
                return outer_faces_of(self, self.node_sets[name])
            masks = self.sets[name]
        return [
            cells._replace(nodes=cells.nodes[mask])
            for cells, mask in zip(self.cells, masks, strict=True)
            if mask.any()
        ]

    def _name_of(self, group: str) -> str:
        names = [*self.sets, *(name for name in self.node_sets if name not in self.sets)]
        alike = [name for name in names if name.casefold() == group.casefold()]
        name = group if group in names else alike[0] if len(alike) == 1 else None
        message = f"the mesh has no physical group '{group}' with elements"
        if name is None:
            # Gmsh numbers its groups and may name them. A number of a single dimension needs no
            # prefix.
            taken = {*names}
            once = [n for n in names if n.rpartition(":")[2] not in taken or ":" not in n]
            named = [name for name in once if not name.isdigit()] or once
            error = unknown(message, group, named[:_MANY], argument="group")
            error.expected = error.expected if named else "no group: the whole mesh"
            if len(named) > _MANY:
                error.expected = f"one of {len(named)} groups: {', '.join(named[:5])}, ..."
            raise error
        masks = self.sets[name] if name in self.sets else [self.node_sets[name]]
        if not any(mask.any() for mask in masks):
            some = [*self.sets][:_MANY]
            filled = [n for n in some if any(mask.any() for mask in self.sets[n])]
            error = unknown(
                f"the physical group '{name}' of the mesh is empty", group, filled, argument="group"
            )
            error.expected = error.expected if filled else "no group: the whole mesh"
            raise error
        return name


# Corners of faces, counter-clockwise as seen from outside; in 2D the interior is on the left.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line": ((0,), (1,)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "hexahedron": (
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}
FACE_TYPES = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


def outer_faces_of(mesh: Mesh, mask: np.ndarray) -> list[CellBlock]:
    highest = max((cells.dimension for cells in mesh.cells if cells.family in FACES), default=0)
    faces: dict[int, list[np.ndarray]] = {}
    for cells in mesh.cells:
        if cells.dimension == highest:
            for face in FACES[cells.family]:
                nodes = cells.nodes[:, face]
                faces.setdefault(len(face), []).append(nodes[mask[nodes].all(axis=1)])
    blocks = []
    for corners, parts in faces.items():
        nodes = np.concatenate(parts)
        _, first, count = np.unique(
            np.sort(nodes, axis=1), axis=0, return_index=True, return_counts=True
        )
        outer = nodes[first[count == 1]]
        if len(outer):
            blocks.append(CellBlock(FACE_TYPES[corners], outer))
    if not blocks:  # the set has nodes only, without a whole face
        blocks.append(CellBlock("vertex", np.flatnonzero(mask)[:, None]))
    return blocks
