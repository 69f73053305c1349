"""Exodus II files of Cubit, MOOSE and Sierra (Schoof & Yarberry 1994)."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.scene.meshes.data import FACE_TYPES, CellBlock, Mesh
from karamelo_py.script.errors import ScriptError

ENDINGS = (".e", ".exo", ".ex2", ".g", ".gen")
FAMILIES = {
    "TRI": "triangle", "QUA": "quad", "SHE": "quad", "TET": "tetra", "HEX": "hexahedron",
    "WED": "wedge", "PYR": "pyramid", "BAR": "line", "BEA": "line", "TRU": "line", "EDG": "line",
    "SPH": "vertex", "CIR": "vertex",
}  # fmt: skip
MESH = re.compile("coord|connect|(eb|ss|ns)_|(elem|side)_ss|node_ns")  # everything except results
SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line": ((0,), (1,)),
    "SHELL": ((0, 1, 2, 3), (0, 3, 2, 1), (0, 1), (1, 2), (2, 3), (3, 0)),
    "TRISHELL": ((0, 1, 2), (0, 2, 1), (0, 1), (1, 2), (2, 0)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "hexahedron": (
        *((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
}
# In Exodus, nodes of edges along z come before nodes of the top edges. Further nodes are ignored.
ORDER = {
    ("hexahedron", 20): [*range(12), *range(16, 20), *range(12, 16)],
    ("wedge", 15): [*range(9), *range(12, 15), *range(9, 12)],
}


def _variables(path: Path) -> dict[str, tuple[np.ndarray, str]]:
    """Return arrays and element types by name, from netCDF-4 (which is HDF5) or netCDF-3."""
    with path.open("rb") as file:
        is_hdf5 = file.read(4) == b"\x89HDF"
    if is_hdf5:
        import h5py

        with h5py.File(path, "r") as root:
            items = [(name, of) for name, of in root.items() if MESH.match(name)]
            arrays = {name: (of[()], of.attrs.get("elem_type", "")) for name, of in items}
    else:
        if find_spec("scipy") is None:
            hint = "pip install '.[implicit]' in the folder of karamelo-py"
            raise ScriptError(f"{path}: meshes in NetCDF need SciPy", hint=hint)
        from scipy.io import netcdf_file

        with netcdf_file(path, mmap=False) as root:
            items = [(name, of) for name, of in root.variables.items() if MESH.match(name)]
            arrays = {name: (of.data.copy(), vars(of).get("elem_type", "")) for name, of in items}
    return {
        name: (array, word.decode() if isinstance(word, bytes) else str(word))
        for name, (array, word) in arrays.items()
    }


def read_exodus(path: Path) -> Mesh:
    """Read blocks, side sets and node sets; raises KeyError or OSError for other formats."""
    variables = _variables(path)
    arrays = {name: array for name, (array, _) in variables.items()}

    def each(begin: str) -> list[np.ndarray]:
        count = sum(re.fullmatch(rf"{begin}\d+", name) is not None for name in arrays)
        return [np.asarray(arrays[f"{begin}{k + 1}"], np.int64) for k in range(count)]

    def names(kind: str, count: int) -> list[list[str]]:
        rows: Any = arrays.get(f"{kind}_names", np.zeros((count, 0), "S1"))
        words = [b"".join(row).split(b"\0")[0].decode().strip() for row in rows]
        numbers = arrays.get(f"{kind}_prop1", np.arange(1, count + 1))
        return [[w] * bool(w) + [str(n)] for w, n in zip(words, numbers, strict=True)]

    axes = [arrays[f"coord{a}"] for a in "xyz" if f"coord{a}" in arrays]
    coordinates = np.array(axes if axes else arrays["coord"], float)
    points = np.zeros((coordinates.shape[1], 3))
    points[:, : len(coordinates)] = coordinates.T
    cells: list[CellBlock] = []
    connected = each("connect")
    of_set = names("eb", len(connected))  # one mask per block of `cells`
    firsts = np.cumsum([1, *map(len, connected)])
    for k, nodes in enumerate(connected):
        word = variables[f"connect{k + 1}"][1].upper().rstrip("\0")
        family, count = FAMILIES.get(word[:3], word.lower()), nodes.shape[1]
        count = {("hexahedron", 27): 20, ("wedge", 18): 15}.get((family, count), count)
        order = ORDER.get((family, count), range(count))
        cells.append(CellBlock(family, nodes[:, order] - 1, label=word))
    sides = each("side_ss")
    for element, side, called in zip(each("elem_ss"), sides, names("ss", len(sides)), strict=True):
        block = np.searchsorted(firsts, element, side="right") - 1
        for k, number in np.unique(np.column_stack([block, side]), axis=0):
            here = (block == k) & (side == number)
            of_type = cells[k].label.rstrip("0123456789")
            of_family = SIDES.get(of_type, SIDES.get(cells[k].family, ()))
            if number > len(of_family):
                continue
            corners = list(of_family[number - 1])
            faces = cells[k].nodes[element[here] - firsts[k]][:, corners]
            cells.append(CellBlock(FACE_TYPES[len(corners)], faces))
            of_set.append(called)
    masks = {
        name: [np.full(len(of.nodes), name in sets) for of, sets in zip(cells, of_set, strict=True)]
        for name in dict.fromkeys(name for sets in of_set for name in sets)
    }
    nodes_of, points_of = each("node_ns"), {}
    for nodes, called in zip(nodes_of, names("ns", len(nodes_of)), strict=True):
        mask = np.isin(np.arange(1, len(points) + 1), nodes)
        points_of.update(dict.fromkeys(called, mask))
    return Mesh(points, cells, masks, points_of, {})
