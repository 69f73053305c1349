"""Meshes in Abaqus or CalculiX decks: parts, instances, sets, surfaces, generated nodes.

Keywords that move or copy nodes otherwise are refused (Abaqus Keywords Reference; CalculiX CrunchiX
manual).
"""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.scene.meshes.data import FACE_TYPES, CellBlock, Mesh
from karamelo_py.scene.meshes.elements import SHAPES
from karamelo_py.script.errors import ScriptError

_MOST = 2**31  # bytes, with includes
_REFUSED = ("NCOPY", "ELCOPY", "NMAP")
# Corners, from 0, of faces S1, S2, ... (Abaqus Analysis User's Guide, "Two- and three-dimensional
# solid element library").
_FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
}
_FAMILIES = {
    **{("solid", c): "tetra" for c in (4, 10)},
    **{("solid", c): "pyramid" for c in (5, 13)},
    **{("solid", c): "wedge" for c in (6, 15, 18)},
    **{("solid", c): "hexahedron" for c in (8, 20, 27)},
    **{("flat", c): "triangle" for c in (3, 6)},
    **{("flat", c): "quad" for c in (4, 8, 9)},
    **{("line", c): "line" for c in (2, 3)},
}
_TYPES = (
    ("solid", re.compile(r"(?:C|DC|AC|EC|PC|Q|F|DCC)?3D(\d+)\D?.*|SC([68])R\w*")),
    ("flat", re.compile(r"(?:CPS|CPE|CPEG|CAX|CGAX|DC2D|AC2D|DCAX|ACAX|EC2D)(\d+)\D?.*")),
    ("flat", re.compile(r"(?:S|M3D|STRI|DS|SFM3D|R3D|R2D)([346789])\d*R?\w*")),
    ("line", re.compile(r"(?:T2D|T3D|DC1D|AC1D)([23])\w*")),
)


class _Keyword(NamedTuple):
    name: str
    options: dict[str, str]
    lines: list[str]
    number: int
    file: Path


class _Elements(NamedTuple):
    type: str
    numbers: np.ndarray  # (n,)
    nodes: np.ndarray  # (n, c) node numbers of the deck


class _Part:
    def __init__(self) -> None:
        self.numbers: list[np.ndarray] = []
        self.places: list[np.ndarray] = []
        self.elements: list[_Elements] = []
        self.skipped: list[tuple[str, int]] = []
        self.nodes: dict[str, list[np.ndarray | str]] = {}
        self.groups: dict[str, list[np.ndarray | str]] = {}
        self.surfaces: dict[str, list[tuple[str, str]]] = {}
        self.system: Callable[[np.ndarray], np.ndarray] = lambda x: x

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Ascending node numbers (n,) and positions; the last definition of a node counts."""
        if not self.numbers:
            return np.empty(0, np.int64), np.empty((0, 3))
        numbers, places = np.concatenate(self.numbers), np.concatenate(self.places)
        unique, last = np.unique(numbers[::-1], return_index=True)
        return unique, places[::-1][last]


class _Instance(NamedTuple):
    name: str
    part: _Part
    move: Callable[[np.ndarray], np.ndarray]


def _wrong(keyword: _Keyword, error: str, expected: str | None = None) -> ScriptError:
    return ScriptError(
        f"{keyword.file.name}, line {keyword.number}: *{keyword.name} {error}",
        argument="file",
        expected=expected,
    )


def _keywords(path: Path, above: tuple[Path, ...] = ()) -> Iterator[_Keyword]:
    lines = [line.lstrip() for line in path.read_text("utf-8", errors="replace").splitlines()]
    starts = [
        k for k, line in enumerate(lines) if line.startswith("*") and not line.startswith("**")
    ]
    for at, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        head, first = lines[at].rstrip(), at + 1
        while head.endswith(",") and first < end:
            head, first = head + lines[first].strip(), first + 1
        data = [line for line in lines[first:end] if line.strip() and not line.startswith("**")]
        name, *words = re.findall(r'(?:[^,"]|"[^"]*")+', head[1:]) or [""]
        options = {}
        for word in words:
            key, _, value = word.partition("=")
            options[key.strip().upper().replace(" ", "")] = value.strip().strip('"')
        keyword = _Keyword(" ".join(name.upper().split()), options, data, at + 1, path)
        yield keyword
        if keyword.name == "INCLUDE" and "INPUT" in options:
            yield from _keywords(_included(keyword, options["INPUT"], above + (path,)))
        elif "INPUT" in options and keyword.name in ("NODE", "ELEMENT", "NSET", "ELSET"):
            raise _wrong(keyword, "with INPUT is not read", "the lines in the deck, or *INCLUDE")


def _included(keyword: _Keyword, name: str, above: tuple[Path, ...]) -> Path:
    path = keyword.file.parent / name
    if path in above or not path.is_file() or path.stat().st_size > _MOST:
        raise _wrong(keyword, f"of '{name}', which cannot be read", "a file next to the deck")
    return path


def _table(keyword: _Keyword, least: int, most: int) -> np.ndarray:
    """Numbers (n, most) of the data lines; omitted ones are 0."""
    try:
        rows = [line.rstrip().rstrip(",").split(",")[:most] for line in keyword.lines]
        if any(len(row) < least for row in rows):
            raise ValueError
        filled = [[x if x.strip() else "0" for x in row] + ["0"] * (most - len(row))
                  for row in rows]  # fmt: skip
        return np.array(filled, float).reshape(-1, most)
    except ValueError:
        raise _wrong(keyword, "has a line that is not numbers and commas") from None


def _flat(keyword: _Keyword) -> np.ndarray:
    try:
        words = ",".join(keyword.lines).replace(" ", "").split(",")
        return np.array([word for word in words if word], np.int64)
    except ValueError:
        raise _wrong(keyword, "has a line that is not whole numbers and commas") from None


def _rows(keyword: _Keyword, count: int) -> np.ndarray:
    """Elements (n, count); lines continue until they have `count` numbers.

    Extra numbers on the last line, such as inner nodes of C3D8I, are ignored, as in CalculiX.
    """
    flat = _flat(keyword)
    if len(flat) == count * len(keyword.lines):
        return flat.reshape(-1, count)
    rows, row = [], np.empty(0, np.int64)
    for line in keyword.lines:
        row = np.append(row, _flat(keyword._replace(lines=[line])))
        if len(row) >= count:
            rows.append(row[:count])
            row = row[:0]
    if len(row):
        kind = keyword.options["TYPE"]
        raise _wrong(keyword, f"has lines that are not {count} whole numbers for a {kind}")
    return np.array(rows).reshape(-1, count)


def _cylindrical(x: np.ndarray) -> np.ndarray:
    angle = np.radians(x[:, 1])
    return np.stack([x[:, 0] * np.cos(angle), x[:, 0] * np.sin(angle), x[:, 2]], axis=1)


def _spherical(x: np.ndarray) -> np.ndarray:
    turn, rise = np.radians(x[:, 1]), np.radians(x[:, 2])
    flat = x[:, 0] * np.cos(rise)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), x[:, 0] * np.sin(rise)], axis=1)


def _system(keyword: _Keyword) -> Callable[[np.ndarray], np.ndarray]:
    """Map from local coordinates: origin, a point on the x axis, one in the x-y plane."""
    if not keyword.lines:
        return lambda x: x
    points = _table(keyword, 3, 6)
    origin, along = points[0, :3], points[0, 3:]
    if len(points) == 1:  # x axis parallel to the global x-y plane
        way = along - origin
        in_plane = np.array([-way[1], way[0], 0.0]) if way[:2].any() else np.array([0.0, 1, 0])
    else:
        way, in_plane = along - origin, points[1, :3] - origin
    if not way.any():
        return lambda x: x + origin
    e1 = way / np.linalg.norm(way)
    e3 = np.cross(e1, in_plane)
    e3 /= np.linalg.norm(e3)
    axes = np.stack([e1, np.cross(e3, e1), e3])
    return lambda x: origin + x @ axes


def _motion(keyword: _Keyword) -> Callable[[np.ndarray], np.ndarray]:
    """Translation, then rotation about two points, in degrees."""
    rows = [_table(keyword._replace(lines=[line]), 1, 7)[0] for line in keyword.lines[:2]]
    shift = rows[0][:3] if rows else np.zeros(3)
    if len(rows) < 2:
        return lambda x: x + shift
    start, end, angle = rows[1][:3], rows[1][3:6], np.radians(rows[1][6])
    k = (end - start) / np.linalg.norm(end - start)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return lambda x: start + (x + shift - start) @ rotation.T


def _kind(name: str) -> tuple[str, int] | None:
    for kind, pattern in _TYPES:
        match = pattern.fullmatch(name)
        if match:
            count = int(next(filter(None, match.groups())))
            return (_FAMILIES[kind, count], count) if (kind, count) in _FAMILIES else None
    return None


def _into(sets: dict, name: str | None, item: np.ndarray | str) -> None:
    if name:
        sets.setdefault(name.upper(), []).append(item)


class _Deck:
    def __init__(self, path: Path):
        self.path = path
        self.parts: dict[str, _Part] = {}
        self.instances: list[_Instance] = []
        self.whole = self.scope = _Part()
        # Sets of the assembly by numbers of an instance: nodes?, name, instance, items.
        self.assembly: list[tuple[bool, str, str, list]] = []
        for keyword in _keywords(path):
            reads = _READ.get(keyword.name)
            if keyword.name in _REFUSED:
                raise _wrong(keyword, "is not read", "the nodes and elements written out")
            if keyword.name == "STEP":
                break
            if reads:
                reads(self, keyword)

    def _part(self, keyword: _Keyword) -> None:
        self.scope = self.parts.setdefault(keyword.options.get("NAME", "").upper(), _Part())

    def _end_part(self, _: _Keyword) -> None:
        self.scope = self.whole

    def _instance(self, keyword: _Keyword) -> None:
        name = keyword.options.get("PART", "").upper()
        if name not in self.parts:
            raise _wrong(keyword, f"of the part '{name}', which is not defined above")
        part = self.parts[name]
        self.instances.append(
            _Instance(keyword.options.get("NAME", "").upper(), part, _motion(keyword))
        )
        self.scope = part

    def _system(self, keyword: _Keyword) -> None:
        self.scope.system = _system(keyword)

    def _node(self, keyword: _Keyword) -> None:
        table = _table(keyword, 1, 4)
        kind = (keyword.options.get("SYSTEM") or "R")[0].upper()
        maps = {"R": lambda x: x, "C": _cylindrical, "S": _spherical}
        if kind not in maps:
            raise _wrong(keyword, f"has the system '{kind}'", "R, C or S")
        places = self.scope.system(maps[kind](table[:, 1:]))
        self._add_nodes(keyword, table[:, 0].astype(np.int64), places)

    def _add_nodes(self, keyword: _Keyword, numbers: np.ndarray, places: np.ndarray) -> None:
        self.scope.numbers.append(numbers)
        self.scope.places.append(places)
        _into(self.scope.nodes, keyword.options.get("NSET"), numbers)

    def _ngen(self, keyword: _Keyword) -> None:
        if keyword.options.get("LINE", "").upper()[:1] in ("C", "P"):
            raise _wrong(keyword, "along a curve is not read", "the nodes written out")
        for first, last, step in _table(keyword, 2, 3).astype(np.int64):
            numbers = np.arange(first, last + 1, step or 1)
            ends = self._places(keyword, np.array([first, last]))
            fraction = (numbers - first) / max(last - first, 1)
            self._add_nodes(keyword, numbers, ends[0] + fraction[:, None] * (ends[1] - ends[0]))

    def _nfill(self, keyword: _Keyword) -> None:
        if {"BIAS", "SINGULAR"} & keyword.options.keys():
            raise _wrong(keyword, "with BIAS or SINGULAR is not read", "the nodes written out")
        for line in keyword.lines:
            low, high, count, step = (word.strip() for word in (line + ",,,").split(",")[:4])
            a = self._numbers(self.scope.nodes, low)
            b = self._numbers(self.scope.nodes, high)
            start, end = self._places(keyword, a), self._places(keyword, b)
            for k in range(1, int(count or 1)):
                places = start + k / int(count) * (end - start)
                self._add_nodes(keyword, a + k * int(step or 1), places)

    def _places(self, keyword: _Keyword, numbers: np.ndarray) -> np.ndarray:
        defined, places = self.scope.table()
        at = np.searchsorted(defined, numbers)
        if not len(defined) or (defined[np.minimum(at, len(defined) - 1)] != numbers).any():
            raise _wrong(keyword, "names a node that is not defined above")
        return places[at]

    def _element(self, keyword: _Keyword) -> None:
        name = keyword.options.get("TYPE", "").upper()
        kind = _kind(name)
        if kind is None:
            self.scope.skipped.append((name or "without a type", len(keyword.lines)))
            return
        table = _rows(keyword, kind[1] + 1)
        self.scope.elements.append(_Elements(name, table[:, 0], table[:, 1:]))
        _into(self.scope.groups, keyword.options.get("ELSET"), table[:, 0])

    def _elgen(self, keyword: _Keyword) -> None:
        for row in _table(keyword, 2, 10).astype(np.int64):
            named = [e for e in self.scope.elements if row[0] in e.numbers]
            if not named:
                raise _wrong(keyword, f"of element {row[0]}, which is not defined above")
            type_, numbers, nodes = named[-1]
            numbers, nodes = numbers[numbers == row[0]], nodes[numbers == row[0]]
            for count, by_nodes, by_number in row[1:].reshape(3, 3):
                steps = np.arange(max(count, 1))[:, None]
                numbers = (numbers + steps * (by_number or 1)).ravel()
                nodes = (nodes[None] + steps[:, :, None] * (by_nodes or 1)).reshape(
                    -1, nodes.shape[1]
                )
            self.scope.elements.append(_Elements(type_, numbers[1:], nodes[1:]))
            _into(self.scope.groups, keyword.options.get("ELSET"), numbers)

    def _set(self, keyword: _Keyword) -> None:
        is_nodes = keyword.name == "NSET"
        name = keyword.options.get(keyword.name, "")
        items: list[np.ndarray | str] = []
        if "GENERATE" in keyword.options:
            for first, last, step in _table(keyword, 2, 3).astype(np.int64):
                items.append(np.arange(first, last + 1, step or 1))
        else:
            words = [w.strip().strip('"') for w in ",".join(keyword.lines).split(",")]
            items = [w.upper() for w in words if w and not w.lstrip("-").isdigit()]
            items.append(np.array([int(w) for w in words if w.lstrip("-").isdigit()], np.int64))
        instance = keyword.options.get("INSTANCE", "").upper()
        if instance:
            self.assembly.append((is_nodes, name.upper(), instance, items))
            return
        for item in items:
            _into(self.scope.nodes if is_nodes else self.scope.groups, name, item)

    def _surface(self, keyword: _Keyword) -> None:
        name = keyword.options.get("NAME", "").upper()
        if keyword.options.get("TYPE", "ELEMENT").upper() == "NODE":
            for line in keyword.lines:
                _into(self.scope.nodes, name, line.split(",")[0].strip().upper())
            return
        for line in keyword.lines:
            of, face = (word.strip().upper() for word in (line + ",").split(",")[:2])
            self.scope.surfaces.setdefault(name, []).append((of, face))

    def _numbers(self, sets: dict, name: str) -> np.ndarray:
        if name.lstrip("-").isdigit():
            return np.array([int(name)])
        return np.unique(np.concatenate([np.empty(0, np.int64), *self._resolved(sets, name, ())]))

    def _resolved(self, sets: dict, name: str, above: tuple[str, ...]) -> Iterator[np.ndarray]:
        for item in sets.get(name.upper(), ()):
            if not isinstance(item, str):
                yield item
            elif item not in above:
                yield from self._resolved(sets, item, (*above, name))

    def mesh(self) -> Mesh:
        bodies = self.instances or [
            _Instance(name, part, lambda x: x) for name, part in self.parts.items()
        ]
        whole = _Instance("", self.whole, lambda x: x)
        if self.whole.numbers or not bodies:
            bodies = [*bodies, whole]
        merged = _Merged(self.path)
        for body in bodies:
            merged.add(body, self)
        for is_nodes, name, instance, items in self.assembly:
            sets = merged.nodes if is_nodes else merged.elements
            numbering = sets.numbering.get(instance, sets.numbering[bodies[-1].name])
            for item in items:
                if isinstance(item, str):
                    sets.extend(name, f"{instance}.{item}")
                else:
                    sets.by_name[name].append(numbering.listed(item))
        if self.instances:  # assembly sets made of INSTANCE.SET and of each other
            pairs = (self.whole.nodes, merged.nodes), (self.whole.groups, merged.elements)
            for of_deck, sets in pairs:
                for name, items in of_deck.items():
                    for item in items:
                        if isinstance(item, str):
                            sets.extend(name, item)
            merged.add_surfaces(whole)
        return merged.mesh()


_READ: dict[str, Callable[[_Deck, _Keyword], None]] = {
    "PART": _Deck._part, "END PART": _Deck._end_part, "INSTANCE": _Deck._instance,
    "END INSTANCE": _Deck._end_part, "SYSTEM": _Deck._system, "NODE": _Deck._node,
    "NGEN": _Deck._ngen, "NFILL": _Deck._nfill, "ELEMENT": _Deck._element,
    "ELGEN": _Deck._elgen, "NSET": _Deck._set, "ELSET": _Deck._set, "SURFACE": _Deck._surface,
}  # fmt: skip


class _Numbering(NamedTuple):
    deck: np.ndarray  # (n,) ascending
    mesh: np.ndarray  # (n,)

    def of(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers in the mesh (m,), or -1."""
        if not len(self.deck):
            return np.full(len(numbers), -1)
        at = np.minimum(np.searchsorted(self.deck, numbers), len(self.deck) - 1)
        return np.where(self.deck[at] == numbers, self.mesh[at], -1)

    def listed(self, numbers: np.ndarray) -> np.ndarray:
        of_mesh = self.of(numbers)
        return of_mesh[of_mesh >= 0]


class _Sets:
    def __init__(self) -> None:
        self.by_name: dict[str, list[np.ndarray]] = defaultdict(list)
        self.numbering: dict[str, _Numbering] = {}

    def extend(self, name: str, other: str) -> None:
        self.by_name[name] += list(self.by_name.get(other, ()))

    def members(self, name: str) -> np.ndarray:
        return np.concatenate([np.empty(0, np.int64), *self.by_name.get(name, ())])


def _names(body: _Instance, name: str) -> set[str]:
    return {name, f"{body.name}.{name}"} if body.name else {name}


class _Merged:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.points: list[np.ndarray] = []
        # By Abaqus type: numbers (n,) and nodes (n, c).
        self.blocks: dict[str, list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
        self.count = 0
        self.nodes, self.elements = _Sets(), _Sets()
        self.surfaces: dict[str, list[tuple[int, np.ndarray]]] = defaultdict(list)
        self.skipped: Counter[str] = Counter()

    def add(self, body: _Instance, deck: _Deck) -> None:
        numbers, places = body.part.table()
        table = _Numbering(numbers, np.arange(len(numbers)) + sum(map(len, self.points)))
        self.nodes.numbering[body.name] = table
        self.points.append(body.move(places))
        for kind, count in body.part.skipped:
            self.skipped[kind] += count
        numbered = [np.empty((2, 0), np.int64)]
        for kind, numbers, nodes in body.part.elements:
            of_mesh = table.of(nodes.ravel()).reshape(nodes.shape)
            if (of_mesh < 0).any():
                row, column = np.argwhere(of_mesh < 0)[0]
                raise ScriptError(
                    f"{self.path.name}: element {numbers[row]} has the node "
                    f"{nodes[row, column]}, which is not defined",
                    argument="file",
                )
            rows = self.count + np.arange(len(nodes))
            self.blocks[kind].append((rows, of_mesh))
            self.count += len(nodes)
            numbered.append(np.stack([numbers, rows]))
        pairs = np.concatenate(numbered, axis=1)
        elements = _Numbering(*pairs[:, np.argsort(pairs[0], kind="stable")])
        self.elements.numbering[body.name] = elements
        self.elements.by_name[body.name].append(elements.mesh)
        for of_part, sets in ((body.part.nodes, self.nodes), (body.part.groups, self.elements)):
            for name in of_part:
                members = sets.numbering[body.name].listed(deck._numbers(of_part, name))
                for key in _names(body, name):
                    sets.by_name[key].append(members)
        self.add_surfaces(body)

    def add_surfaces(self, body: _Instance) -> None:
        for name, items in body.part.surfaces.items():
            for of, face in items:
                if of.isdigit():
                    elements = self.elements.numbering[body.name].listed(np.array([int(of)]))
                else:
                    of_body = f"{body.name}.{of}"
                    in_body = of_body in self.elements.by_name
                    elements = self.elements.members(of_body if in_body else of)
                if re.fullmatch(r"S[1-6]", face):
                    for key in _names(body, name):
                        self.surfaces[key].append((int(face[1]) - 1, elements))

    def mesh(self) -> Mesh:
        cells, numbers = [], []
        for label, parts in self.blocks.items():
            family, count = _kind(label) or ("", 0)
            name = family if count == len(SHAPES[family].corners) else f"{family}{count}"
            of_block, nodes = map(np.concatenate, zip(*parts, strict=True))
            numbers.append(of_block)
            cells.append(CellBlock(name, nodes, label=label))
        faces: dict[str, list[CellBlock]] = defaultdict(list)
        for name, items in self.surfaces.items():
            for side, elements in items:
                for block, of_block in zip(cells, numbers, strict=True):
                    corners = _FACES.get(block.family, ())
                    nodes = block.nodes[np.isin(of_block, elements)]
                    if side < len(corners) and len(nodes):
                        kind = FACE_TYPES[len(corners[side])]
                        faces[name].append(CellBlock(kind, nodes[:, corners[side]]))
        every = [*cells, *(cell for parts in faces.values() for cell in parts)]
        none = [np.zeros(len(cell.nodes), bool) for cell in every]
        sets = {}
        for name in filter(None, self.elements.by_name):
            members = self.elements.members(name)
            sets[name] = [np.isin(of_block, members) for of_block in numbers] + none[len(cells) :]
        for name, of_faces in faces.items():
            mine = {id(cell) for cell in of_faces}
            sets[name] = [mask | (id(c) in mine) for mask, c in zip(none, every, strict=True)]
        points = np.concatenate(self.points)
        node_sets = {name: np.zeros(len(points), bool) for name in self.nodes.by_name}
        for name, mask in node_sets.items():
            mask[self.nodes.members(name)] = True
        return Mesh(points, every, sets, node_sets, self.skipped)


def read_deck(path: Path) -> Mesh:
    """Read a deck; ScriptError names the line that cannot be read."""
    return _Deck(path).mesh()
