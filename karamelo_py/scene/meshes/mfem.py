"""MFEM meshes of first and second order (https://mfem.org/mesh-format-v1.0)."""

import re
from pathlib import Path

import numpy as np

from karamelo_py.scene.meshes.data import FACES, CellBlock, Mesh
from karamelo_py.scene.meshes.elements import MIDDLES

_TYPES = (
    *(("vertex", 1), ("line", 2), ("triangle", 3), ("quad", 4)),
    *(("tetra", 4), ("hexahedron", 8), ("wedge", 6), ("pyramid", 5)),
)
# Corners of edges, in the order of edge numbers (mfem/fem/geom.cpp).
_EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)),
    "hexahedron": (
        *((0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "pyramid": ((0, 1), (1, 2), (3, 2), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4)),
}
_SPACE = re.compile(
    r"\s*FiniteElementSpace\s+FiniteElementCollection:\s*(\S+)\s+VDim:\s*(\d)\s+Ordering:\s*(\d)"
)
_REMEDY = "in MFEM, write it as .vtu"
_SECTIONS = re.compile(
    r"^\s*(dimension|elements|boundary|vertices|nodes|(?:bdr_)?attribute_sets)\s*$", re.M
)


def _middles(elements: list[tuple[str, list[int]]], first: int) -> dict[frozenset[int], int]:
    """Map the set of corners around each second-order node to the node's number, from `first` on.

    Edge nodes come first, then nodes of quadrilateral faces, then nodes inside elements, each in
    order of appearance.
    """
    numbers: dict[frozenset[int], int] = {}
    faces = {**FACES, "triangle": (), "quad": (), "line": ()}
    bottom, top, *others = FACES["hexahedron"]
    faces["hexahedron"] = bottom, *others, top
    of_faces = [faces[family] for family, _ in elements]
    inner = [[range(len(nodes))] if len(nodes) in (4, 8) and family != "tetra" else []
             for family, nodes in elements]  # fmt: skip
    for kinds in ([_EDGES.get(family, ()) for family, _ in elements], of_faces, inner):
        for (_, nodes), places in zip(elements, kinds, strict=True):
            for corners in places:
                if len(corners) != 3:
                    key = frozenset(nodes[k] for k in corners)
                    numbers.setdefault(key, first + len(numbers))
    return numbers


def read_mfem(path: Path) -> Mesh:
    """Read a mesh, with attributes as groups. Raises ValueError for unsupported content."""
    text = re.sub(r"#.*", "", path.read_text("latin-1"))
    if not re.match(r"\s*MFEM mesh v1\.[0-3]\b", text):
        head = text.strip().splitlines()[0]
        raise ValueError(f"it has MFEM's kind '{head}': {_REMEDY}")
    _, *sections = _SECTIONS.split(text)
    bodies = dict(zip(sections[::2], sections[1::2], strict=True))
    words = {name: body.split() for name, body in bodies.items()}
    count = int(words["vertices"][0])
    space = _SPACE.match(bodies.get("nodes", ""))
    if "nodes" in bodies:
        name = space[1] if space else "unknown"
        if not space or not re.fullmatch(r"H1_[123]D_P[12]|Linear|Quadratic", name):
            raise ValueError(f"its edges are curved ('nodes' of the kind {name}): {_REMEDY}")
        values, d = np.array(bodies["nodes"][space.end() :].split(), float), int(space[2])
        values = values.reshape(-1, d) if space[3] == "1" else values.reshape(d, -1).T
    else:
        d = int(words["vertices"][1])
        values = np.array(words["vertices"][2:], float).reshape(count, d)
    points = np.zeros((len(values), 3))
    points[:, :d] = values
    ordered: list[tuple[str, list[int]]] = []
    rows: dict[tuple[str, int], list[list[int]]] = {}
    for name in ("elements", "boundary"):
        numbers = list(map(int, words.get(name, ["0"])))
        at = 1
        for _ in range(numbers[0]):
            attribute, kind = numbers[at : at + 2]
            end = at + 2 + _TYPES[kind][1]
            rows.setdefault((name, kind), []).append([attribute, *numbers[at + 2 : end]])
            at = end
            if name == "elements":
                ordered.append((_TYPES[kind][0], numbers[end - _TYPES[kind][1] : end]))
    numbering = _middles(ordered, count) if len(points) > count else {}
    cells, owners = [], []
    for (name, kind), lines in rows.items():
        table = np.array(lines)
        family, nodes = _TYPES[kind][0], table[:, 1:]
        of_middle = MIDDLES.get(family, ()) if name == "elements" and len(points) > count else ()
        sets_of = [[frozenset(row[list(of)].tolist()) for of in of_middle] for row in nodes]
        middles = [[numbering[of] for of in row if of in numbering] for row in sets_of]
        nodes = np.concatenate([nodes, np.array(middles, int).reshape(len(nodes), -1)], axis=1)
        more = nodes.shape[1] > _TYPES[kind][1]
        cells.append(CellBlock(f"{family}{nodes.shape[1]}" if more else family, nodes))
        owners.append([f"{'boundary:' * (name == 'boundary')}{n}" for n in table[:, 0]])
    names = dict.fromkeys(name for of in owners for name in of)
    sets = {name: [np.array(of) == name for of in owners] for name in names}
    for begin, of in (("", "attribute_sets"), ("boundary:", "bdr_attribute_sets")):
        for name, numbers in re.findall(r'"([^"]*)" +\d+ +([\d ]+)', bodies.get(of, "")):
            masks = [sets[begin + n] for n in numbers.split() if begin + n in sets]
            sets[name] = [np.any(of, axis=0) for of in zip(*masks, strict=True)]
    return Mesh(points, cells, sets, {}, {})
