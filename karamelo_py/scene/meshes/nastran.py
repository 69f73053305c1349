"""Meshes in Nastran bulk data: nodes in any coordinate system, solids, properties as groups.

Entries are in small or large fields or separated by commas (MSC Nastran Quick Reference Guide).
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.scene.meshes.data import Mesh
from karamelo_py.scene.meshes.deck import (
    DeckBody,
    DeckElements,
    DeckKeyword,
    DeckPart,
    Merged,
    cylindrical,
    included,
    into_by_owner,
    wrong,
)

ENDINGS = (".bdf", ".nas")
# Number of corners, and number of all nodes. Second-order elements may omit mid-edge nodes.
_TYPES = {
    "CTETRA": ("tetra", 4, 10), "CPENTA": ("wedge", 6, 15), "CHEXA": ("hexahedron", 8, 20),
    "CPYRAM": ("pyramid", 5, 13),
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CTRAX3", "CPLSTN3", "CPLSTS3"), ("triangle", 3, 3)),
    **dict.fromkeys(("CTRIA6", "CTRAX6", "CPLSTN6", "CPLSTS6"), ("triangle", 3, 6)),
    **dict.fromkeys(("CQUAD4", "CQUADR", "CQUADX4", "CPLSTN4", "CPLSTS4"), ("quad", 4, 4)),
    **dict.fromkeys(("CQUAD8", "CQUADX8", "CPLSTN8", "CPLSTS8"), ("quad", 4, 8)),
}  # fmt: skip
# Nastran numbers nodes on vertical edges after those on lower edges.
_ORDER = {
    "hexahedron20": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge15": [*range(9), *range(12, 15), *range(9, 12)],
}
_NO_SOLIDS = re.compile(
    r"C(BAR|BEAM3?|BEND|ROD|ONROD|TUBE|ELAS\d|DAMP\d|BUSH\w*|GAP|VISC|MASS\d|ONM\d|FAST|WELD|SHEAR)"
    r"|RBE\d|RBAR|RROD|PLOTEL"
)


class _Entry(NamedTuple):
    name: str
    fields: list[str]
    number: int  # line number of the entry
    file: Path

    def whole(self, k: int) -> int:
        try:
            return int(self.fields[k] or 0) if k < len(self.fields) else 0
        except ValueError:
            raise self.wrong(f"has '{self.fields[k]}' instead of a whole number") from None

    def wholes(self, count: int) -> list[int]:
        """Return the integers in the first `count` fields; an omitted second equals the first."""
        try:
            numbers = list(map(int, self.fields[:count]))
        except ValueError:
            numbers = [self.whole(k) for k in range(count)]
            numbers[1] = numbers[1] or numbers[0]
        return numbers if len(numbers) == count else [self.whole(k) for k in range(count)]

    def real(self, k: int) -> float:
        text = self.fields[k] if k < len(self.fields) else ""
        try:
            return float(text or 0)
        except ValueError:  # 1.5-3 means 1.5e-3, and D is an exponent in double precision
            written = re.sub(r"(?<=[\d.])[DdEe]?([+-]\d+)$", r"e\1", text.replace(" ", ""))
        try:
            return float(written)
        except ValueError:
            raise self.wrong(f"has '{text}' instead of a number") from None

    def wrong(self, error: str, expected: str | None = None) -> Exception:
        return wrong(DeckKeyword(self.name, {}, [], self.number, self.file), error, expected)


def _entries(path: Path, above: tuple[Path, ...] = ()) -> Iterator[_Entry]:
    text = path.read_text("latin-1")
    begin = re.search(r"^\s*BEGIN\s+BULK", text, re.I | re.M)
    lines = text.splitlines()
    entry = None
    for number in range(text.count("\n", 0, begin.end()) + 1 if begin else 0, len(lines)):
        line = lines[number]
        if "$" in line or "\t" in line:
            line = line.split("$", 1)[0].expandtabs(8)
        if not line or line.isspace():
            continue
        if "," in line:
            name, *fields = line.split(",")
            fields = fields[: 4 if "*" in name else 8]
        else:
            name, width = line[:8], 16 if "*" in line[:8] else 8
            fields = [line[k : k + width] for k in range(8, min(len(line), 72), width)]
            fields += [""] * (64 // width - len(fields))
        name, fields = name.strip().upper(), [field.strip() for field in fields]
        if name[:1] in ("", "+", "*"):
            if entry:
                entry.fields.extend(fields)
            continue
        if entry:
            yield entry
        entry = None
        if name == "ENDDATA":
            return
        if name.startswith("INCLUDE"):
            file = re.sub(r"^\s*include\s*|['\"]", "", lines[number], flags=re.I).strip()
            keyword = DeckKeyword("INCLUDE", {}, [], number + 1, path)
            yield from _entries(included(keyword, file, (*above, path)), (*above, path))
        else:
            entry = _Entry(name.rstrip("*"), fields, number + 1, path)
    if entry:
        yield entry


def _spherical(x: np.ndarray) -> np.ndarray:
    down, turn = np.radians(x[:, 1]), np.radians(x[:, 2])
    flat = x[:, 0] * np.sin(down)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), x[:, 0] * np.cos(down)], axis=1)


class _Systems:
    def __init__(self) -> None:
        self.by_number: dict[int, tuple[_Entry, int]] = {}  # entry, and index of its first field
        self.nodes: dict[int, tuple[_Entry, int, list[float]]] = {}  # system -1: the default system
        self.default = 0

    def add(self, entry: _Entry) -> None:
        step = 4 if entry.name[4] == "1" else len(entry.fields) + 1
        for first in range(0, len(entry.fields), step):
            if entry.whole(first):
                self.by_number[entry.whole(first)] = entry, first

    def places(
        self, entry: _Entry, number: int, x: np.ndarray, above: tuple[int, ...] = ()
    ) -> np.ndarray:
        """Return positions (n, 3) in the basic system for coordinates `x` in system `number`."""
        number = self.default if number < 0 else number
        if not number:
            return x
        if number not in self.by_number or number in above:
            raise entry.wrong(f"is in the coordinate system {number}, which is not defined")
        of, first = self.by_number[number]
        above = (*above, number)
        if of.name[4] == "1":
            three = []
            for k in range(1, 4):
                node = of.whole(first + k)
                if node not in self.nodes:
                    raise of.wrong(f"has the node {node}, which is not defined")
                at, system, point = self.nodes[node]
                three.append(self.places(at, system, np.array([point]), above)[0])
            origin, on_z, in_xz = three
        else:
            points = np.array([of.real(k) for k in range(2, 11)]).reshape(3, 3)
            origin, on_z, in_xz = self.places(of, of.whole(1), points, above)
        e3 = on_z - origin
        e2 = np.cross(e3, in_xz - origin)
        if not e2.any():
            raise of.wrong("has three points on a line")
        e3, e2 = e3 / np.linalg.norm(e3), e2 / np.linalg.norm(e2)
        local = {"C": cylindrical, "S": _spherical}.get(of.name[5], lambda x: x)(x)
        return origin + local @ np.stack([np.cross(e2, e3), e2, e3])


def read_nastran(path: Path) -> Mesh:
    """Read bulk data; raises ScriptError with the line that cannot be read."""
    part, systems = DeckPart(), _Systems()
    elements: dict[tuple[str, str], list[list[int]]] = defaultdict(list)
    for entry in _entries(path):
        name = entry.name
        if name == "GRID":
            system = entry.whole(1) if len(entry.fields) > 1 and entry.fields[1] else -1
            at = entry, system, [entry.real(k) for k in (2, 3, 4)]
            if systems.nodes.setdefault(entry.whole(0), at)[1:] != at[1:]:
                raise entry.wrong("is defined twice, at different positions", "one superelement")
        elif name == "GRDSET":
            systems.default = entry.whole(1)
        elif re.fullmatch(r"CORD[12][RCS]", name):
            systems.add(entry)
        elif name.startswith("CORD3"):
            raise entry.wrong("is not read", "CORD1 or CORD2")
        elif name in _TYPES:
            family, corners, most = _TYPES[name]
            nodes = entry.fields[2 : 2 + most]
            count = most if len(nodes) == most and all(nodes) and "0" not in nodes else corners
            of_mesh = family if count == corners else f"{family}{count}"
            elements[of_mesh, name].append(entry.wholes(2 + count))
        elif _NO_SOLIDS.fullmatch(name):
            part.skipped[name] += 1
    by_system = defaultdict(list)
    for number, (_, system, _) in systems.nodes.items():
        by_system[system].append(number)
    for system, numbers in by_system.items():
        x = np.array([systems.nodes[n][2] for n in numbers])
        first = systems.nodes[numbers[0]][0]
        part.add_nodes(np.array(numbers), systems.places(first, system, x))
    for (of_mesh, name), rows in elements.items():
        table = np.array(rows)
        order = 2 + np.array(_ORDER.get(of_mesh, range(table.shape[1] - 2)))
        part.elements.append(DeckElements(of_mesh, name, table[:, 0], table[:, order]))
        into_by_owner(part.groups, table[:, 1], table[:, 0])
    merged = Merged(path)
    merged.add(DeckBody("", part))
    return merged.mesh()
