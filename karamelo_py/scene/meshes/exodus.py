"""Read Exodus II files of Cubit, MOOSE and Sierra (Schoof and Yarberry 1994)."""

from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.scene.meshes.data import FACE_TYPES, CellBlock, Mesh

ENDINGS = (".e", ".exo", ".ex2", ".g", ".gen")
FAMILIES = {
    "TRI": "triangle", "QUA": "quad", "SHE": "quad", "TET": "tetra", "HEX": "hexahedron",
    "WED": "wedge", "PYR": "pyramid", "BAR": "line", "BEA": "line", "TRU": "line", "EDG": "line",
    "SPH": "vertex", "CIR": "vertex",
}  # fmt: skip
# Corners of the sides in their order.
SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "hexahedron": (
        *((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
}
# Edges along z come before those at the top; further nodes are left out.
ORDER = {
    ("hexahedron", 20): [*range(12), *range(16, 20), *range(12, 16)],
    ("wedge", 15): [*range(9), *range(12, 15), *range(9, 12)],
}


class _File:
    """Variables by name, of netCDF-4 (which is HDF5) or netCDF-3."""

    def __init__(self, path: Path):
        if path.read_bytes()[:4] == b"\x89HDF":
            import h5py

            with h5py.File(path, "r") as root:
                self.arrays = {name: of[()] for name, of in root.items() if of.shape is not None}
                self.types = {name: of.attrs.get("elem_type", b"") for name, of in root.items()}
        else:
            from scipy.io import netcdf_file

            with netcdf_file(path, mmap=False) as root:
                self.arrays = {name: of.data.copy() for name, of in root.variables.items()}
                types = root.variables.items()
                self.types = {name: vars(of).get("elem_type", b"") for name, of in types}

    def names(self, kind: str, count: int) -> list[list[str]]:
        """Return the names and numbers of blocks, side sets or node sets."""
        rows: Any = self.arrays.get(f"{kind}_names", np.zeros((count, 0), "S1"))
        numbers = self.arrays.get(f"{kind}_prop1", range(1, count + 1))
        names = [b"".join(row).split(b"\0")[0].decode().strip() for row in rows]
        return [
            [name] * bool(name) + [str(number)] for name, number in zip(names, numbers, strict=True)
        ]

    def each(self, begin: str) -> list[np.ndarray]:
        found: list[np.ndarray] = []
        while (array := self.arrays.get(f"{begin}{len(found) + 1}")) is not None:
            found.append(np.asarray(array, np.int64))
        return found


def read_exodus(path: Path) -> Mesh:
    """Read blocks, side sets and node sets; KeyError or OSError for other files."""
    file = _File(path)
    axes = [file.arrays[f"coord{a}"] for a in "xyz" if f"coord{a}" in file.arrays]
    coordinates = np.array(axes if axes else file.arrays["coord"], float)
    points = np.zeros((coordinates.shape[1], 3))
    points[:, : len(coordinates)] = coordinates.T
    cells: list[CellBlock] = []
    of_set: list[list[str]] = []  # names, by block of `cells`
    connected = file.each("connect")
    firsts = np.cumsum([1, *map(len, connected)])
    for k, (nodes, names) in enumerate(
        zip(connected, file.names("eb", len(connected)), strict=True)
    ):
        kind = file.types[f"connect{k + 1}"]
        word = (kind.decode() if isinstance(kind, bytes) else str(kind)).upper().rstrip("\0")
        family, count = FAMILIES.get(word[:3], word.lower()), nodes.shape[1]
        count = {("hexahedron", 27): 20, ("wedge", 18): 15}.get((family, count), count)
        order = ORDER.get((family, count), range(count))
        cells.append(CellBlock(family, nodes[:, order] - 1, label=word))
        of_set.append(names)
    elements, sides = file.each("elem_ss"), file.each("side_ss")
    sets = zip(elements, sides, file.names("ss", len(sides)), strict=True)
    for element, side, names in list(sets):
        block = np.searchsorted(firsts, element, side="right") - 1
        for k in np.unique(block):
            for number in np.unique(side[block == k]):
                here = (block == k) & (side == number)
                corners = list(SIDES[cells[k].family][number - 1])
                faces = cells[k].nodes[element[here] - firsts[k]][:, corners]
                cells.append(CellBlock(FACE_TYPES[len(corners)], faces))
                of_set.append(names)
    named = dict.fromkeys(name for names in of_set for name in names)
    masks = {
        name: [
            np.full(len(of.nodes), name in names) for of, names in zip(cells, of_set, strict=True)
        ]
        for name in named
    }
    nodes_of, points_of = file.each("node_ns"), {}
    for nodes, names in zip(nodes_of, file.names("ns", len(nodes_of)), strict=True):
        mask = np.isin(np.arange(1, len(points) + 1), nodes)
        points_of.update(dict.fromkeys(names, mask))
    return Mesh(points, cells, masks, points_of, {})
