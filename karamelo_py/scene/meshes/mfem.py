"""Meshes of MFEM with straight edges (https://mfem.org/mesh-format-v1.0)."""

import re
from pathlib import Path

import numpy as np

from karamelo_py.scene.meshes.data import CellBlock, Mesh

_TYPES = (
    *(("vertex", 1), ("line", 2), ("triangle", 3), ("quad", 4)),
    *(("tetra", 4), ("hexahedron", 8), ("wedge", 6), ("pyramid", 5)),
)
_REMEDY = "in MFEM, write it as .vtu"
_SECTIONS = re.compile(
    r"^\s*(dimension|elements|boundary|vertices|nodes|(?:bdr_)?attribute_sets)\s*$", re.M
)


def read_mfem(path: Path) -> Mesh:
    """Read a mesh, with attributes as groups; ValueError says what is not read."""
    text = re.sub(r"#.*", "", path.read_text("latin-1"))
    if not re.match(r"\s*MFEM mesh v1\.[0-3]\b", text):
        head = text.strip().splitlines()[0]
        raise ValueError(f"it is of MFEM's kind '{head}': {_REMEDY}")
    _, *sections = _SECTIONS.split(text)
    bodies = dict(zip(sections[::2], sections[1::2], strict=True))
    words = {name: body.split() for name, body in bodies.items()}
    if "nodes" in words or len(words.get("vertices", ())) < 2:
        raise ValueError(f"its elements have curved edges (a section 'nodes'): {_REMEDY}")
    count, d = int(words["vertices"][0]), int(words["vertices"][1])
    points = np.zeros((count, 3))
    points[:, :d] = np.array(words["vertices"][2:], float).reshape(count, d)
    rows: dict[tuple[str, int], list[list[int]]] = {}
    for name in ("elements", "boundary"):
        numbers = list(map(int, words.get(name, ["0"])))
        at = 1
        for _ in range(numbers[0]):
            attribute, kind = numbers[at : at + 2]
            end = at + 2 + _TYPES[kind][1]
            rows.setdefault((name, kind), []).append([attribute, *numbers[at + 2 : end]])
            at = end
    cells, owners = [], []
    for (name, kind), lines in rows.items():
        table = np.array(lines)
        cells.append(CellBlock(_TYPES[kind][0], table[:, 1:]))
        owners.append([f"{'boundary:' * (name == 'boundary')}{n}" for n in table[:, 0]])
    names = dict.fromkeys(name for of in owners for name in of)
    sets = {name: [np.array(of) == name for of in owners] for name in names}
    for begin, of in (("", "attribute_sets"), ("boundary:", "bdr_attribute_sets")):
        for name, numbers in re.findall(r'"([^"]*)" +\d+ +([\d ]+)', bodies.get(of, "")):
            masks = [sets[begin + n] for n in numbers.split() if begin + n in sets]
            sets[name] = [np.any(of, axis=0) for of in zip(*masks, strict=True)]
    return Mesh(points, cells, sets, {}, {})
