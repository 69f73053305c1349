"""Wavefront .obj files."""

from pathlib import Path

import numpy as np

from karamelo_py.scene.meshes.data import CellBlock, Mesh
from karamelo_py.script.errors import ScriptError


def read_obj(path: Path) -> Mesh:
    """Read a file. Polygons become triangles; objects and groups become sets."""
    points: list[list[float]] = []
    faces: dict[int, list[list[int]]] = {3: [], 4: []}
    owners: dict[int, list[tuple[str, ...]]] = {3: [], 4: []}
    names: dict[str, tuple[str, ...]] = {"o": (), "g": ()}
    text = path.read_text(errors="replace").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        word, *rest = line.split("#", 1)[0].split() or [""]
        try:
            if word == "v":
                x, y, z = rest[:3]
                points.append([float(x), float(y), float(z)])
            elif word in names:
                names[word] = tuple(rest)
            elif word == "f":
                # Ignore texture and normal after a slash. Negative numbers count from the end.
                corners = [int(item.split("/", 1)[0]) for item in rest]
                corners = [k - 1 if k > 0 else len(points) + k for k in corners]
                if min(corners) < 0 or max(corners) >= len(points):
                    raise ValueError("a vertex that does not exist")
                parts = [corners] if len(corners) <= 4 else _split(points, corners)
                faces[len(parts[0])] += parts
                owners[len(parts[0])] += [names["o"] + names["g"]] * len(parts)
        except (ValueError, KeyError) as error:
            why = "a face needs three corners or more" if isinstance(error, KeyError) else error
            raise ScriptError(
                f"the file {path.name} cannot be read as a mesh: line {number}: {why}",
                argument="file",
                expected="v x y z, f a b c ..., and other lines of .obj files",
            ) from None
    kinds = [n for n in faces if faces[n]]
    cells = [CellBlock({3: "triangle", 4: "quad"}[n], np.array(faces[n])) for n in kinds]
    names_used = dict.fromkeys(name for n in kinds for of in owners[n] for name in of)
    sets = {
        name: [np.array([name in of for of in owners[n]]) for n in kinds] for name in names_used
    }
    return Mesh(np.array(points, float).reshape(-1, 3), cells, sets, {}, {})


def _split(points: list[list[float]], corners: list[int]) -> list[list[int]]:
    """Divide a polygon into a fan of triangles, from a corner that sees all other corners."""
    count = len(corners)
    for start in range(count):
        fan = [
            [corners[start], corners[(start + k) % count], corners[(start + k + 1) % count]]
            for k in range(1, count - 1)
        ]
        a, b, c = np.moveaxis(np.array([[points[k] for k in one] for one in fan]), 1, 0)
        normals = np.cross(b - a, c - a)
        if (normals @ normals.sum(axis=0) >= 0).all():
            return fan
    raise ValueError("a face that is concave in several places: export it as triangles")
