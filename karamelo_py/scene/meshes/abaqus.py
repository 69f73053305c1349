"""Meshes in Abaqus or CalculiX decks: parts, instances, sets, surfaces, generated nodes.

Keywords that move or copy nodes are errors (Abaqus Keywords Reference; CalculiX manual).
"""

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

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
    into,
    members,
    table_of,
    wrong,
)
from karamelo_py.scene.meshes.elements import SHAPES

_REFUSED = ("ELCOPY", "NMAP")
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


def _keywords(path: Path, above: tuple[Path, ...] = ()) -> Iterator[DeckKeyword]:
    lines = [line.lstrip() for line in path.read_text("utf-8", errors="replace").splitlines()]
    starts = [
        k for k, line in enumerate(lines) if line.startswith("*") and not line.startswith("**")
    ]
    for at, end in pairwise([*starts, len(lines)]):
        head, first = lines[at].rstrip(), at + 1
        while head.endswith(",") and first < end:
            head, first = head + lines[first].strip(), first + 1
        data = [line for line in lines[first:end] if line.strip() and not line.startswith("**")]
        name, *words = re.findall(r'(?:[^,"]|"[^"]*")+', head[1:]) or [""]
        options = {}
        for word in words:
            key, _, value = word.partition("=")
            options[key.strip().upper().replace(" ", "")] = value.strip().strip('"')
        keyword = DeckKeyword(" ".join(name.upper().split()), options, data, at + 1, path)
        yield keyword
        if keyword.name == "INCLUDE" and "INPUT" in options:
            yield from _keywords(included(keyword, options["INPUT"], above + (path,)))
        elif "INPUT" in options and keyword.name in ("NODE", "ELEMENT", "NSET", "ELSET"):
            raise wrong(keyword, "with INPUT is not read", "the lines in the deck, or *INCLUDE")


def _flat(keyword: DeckKeyword) -> np.ndarray:
    try:
        words = ",".join(keyword.lines).replace(" ", "").split(",")
        return np.array([word for word in words if word], np.int64)
    except ValueError:
        raise wrong(keyword, "has a line that is not whole numbers and commas") from None


def _rows(keyword: DeckKeyword, count: int) -> np.ndarray:
    """Return elements (n, count); an element may continue over several lines.

    As in CalculiX, surplus numbers on the last line, such as inner nodes of C3D8I, are ignored.
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
        raise wrong(keyword, f"has lines that are not {count} whole numbers for a {kind}")
    return np.array(rows).reshape(-1, count)


def _spherical(x: np.ndarray) -> np.ndarray:
    turn, rise = np.radians(x[:, 1]), np.radians(x[:, 2])
    flat = x[:, 0] * np.cos(rise)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), x[:, 0] * np.sin(rise)], axis=1)


def _system(keyword: DeckKeyword) -> Callable[[np.ndarray], np.ndarray]:
    if not keyword.lines:
        return lambda x: x
    points = table_of(keyword, 3, 6)
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


def _motion(keyword: DeckKeyword) -> Callable[[np.ndarray], np.ndarray]:
    rows = [table_of(keyword._replace(lines=[line]), 1, 7)[0] for line in keyword.lines[:2]]
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


class _Deck:
    def __init__(self, path: Path):
        self.path = path
        self.parts: dict[str, DeckPart] = {}
        self.instances: list[DeckBody] = []
        self.whole = self.scope = DeckPart()
        # Sets of the assembly: True for nodes, name, instance, items numbered in the instance.
        self.assembly: list[tuple[bool, str, str, list]] = []
        for keyword in _keywords(path):
            reads = _READ.get(keyword.name)
            if keyword.name in _REFUSED:
                raise wrong(keyword, "is not read", "the nodes and elements written out")
            if keyword.name == "STEP":
                break
            if reads:
                reads(self, keyword)

    def _part(self, keyword: DeckKeyword) -> None:
        self.scope = self.parts.setdefault(keyword.options.get("NAME", "").upper(), DeckPart())

    def _end_part(self, _: DeckKeyword) -> None:
        self.scope = self.whole

    def _instance(self, keyword: DeckKeyword) -> None:
        name = keyword.options.get("PART", "").upper()
        if name not in self.parts:
            raise wrong(keyword, f"of the part '{name}', which is not defined above")
        part = self.parts[name]
        self.instances.append(
            DeckBody(keyword.options.get("NAME", "").upper(), part, _motion(keyword))
        )
        self.scope = part

    def _system(self, keyword: DeckKeyword) -> None:
        self.scope.system = _system(keyword)

    def _node(self, keyword: DeckKeyword) -> None:
        table = table_of(keyword, 1, 4)
        kind = (keyword.options.get("SYSTEM") or "R")[0].upper()
        maps = {"R": lambda x: x, "C": cylindrical, "S": _spherical}
        if kind not in maps:
            raise wrong(keyword, f"has the system '{kind}'", "R, C or S")
        places = self.scope.system(maps[kind](table[:, 1:]))
        self._add_nodes(keyword, table[:, 0].astype(np.int64), places)

    def _add_nodes(self, keyword: DeckKeyword, numbers: np.ndarray, places: np.ndarray) -> None:
        self.scope.add_nodes(numbers, places)
        into(self.scope.nodes, keyword.options.get("NSET"), numbers)

    def _ngen(self, keyword: DeckKeyword) -> None:
        if keyword.options.get("LINE", "").upper()[:1] in ("C", "P"):
            raise wrong(keyword, "along a curve is not read", "the nodes written out")
        for first, last, step in table_of(keyword, 2, 3).astype(np.int64):
            numbers = np.arange(first, last + 1, step or 1)
            ends = self._places(keyword, np.array([first, last]))
            fraction = (numbers - first) / max(last - first, 1)
            self._add_nodes(keyword, numbers, ends[0] + fraction[:, None] * (ends[1] - ends[0]))

    def _ncopy(self, keyword: DeckKeyword) -> None:
        options = keyword.options
        if "SHIFT" not in options or "MULTIPLE" in options:
            raise wrong(keyword, "without SHIFT, or with MULTIPLE, is not read")
        old = members(self.scope.nodes, options.get("OLDSET", ""))
        change = options.get("CHANGENUMBER", "")
        if not change.isdigit():
            raise wrong(keyword, "needs CHANGE NUMBER, a whole number")
        self._add_nodes(keyword, old + int(change), _motion(keyword)(self._places(keyword, old)))
        into(self.scope.nodes, options.get("NEWSET"), old + int(change))

    def _nfill(self, keyword: DeckKeyword) -> None:
        if {"BIAS", "SINGULAR"} & keyword.options.keys():
            raise wrong(keyword, "with BIAS or SINGULAR is not read", "the nodes written out")
        for line in keyword.lines:
            low, high, count, step = (word.strip() for word in (line + ",,,").split(",")[:4])
            a = members(self.scope.nodes, low)
            b = members(self.scope.nodes, high)
            start, end = self._places(keyword, a), self._places(keyword, b)
            for k in range(1, int(count or 1)):
                places = start + k / int(count) * (end - start)
                self._add_nodes(keyword, a + k * int(step or 1), places)

    def _places(self, keyword: DeckKeyword, numbers: np.ndarray) -> np.ndarray:
        defined, places = self.scope.table()
        at = np.searchsorted(defined, numbers)
        if not len(defined) or (defined[np.minimum(at, len(defined) - 1)] != numbers).any():
            raise wrong(keyword, "names a node that is not defined above")
        return places[at]

    def _element(self, keyword: DeckKeyword) -> None:
        name = keyword.options.get("TYPE", "").upper()
        kind = _kind(name)
        if kind is None:
            self.scope.skipped[name or "without a type"] += len(keyword.lines)
            return
        family, count = kind
        of_mesh = family if count == len(SHAPES[family].corners) else f"{family}{count}"
        table = _rows(keyword, count + 1)
        if of_mesh == "line3":  # Abaqus lists the middle node second
            table = table[:, [0, 1, 3, 2]]
        self.scope.elements.append(DeckElements(of_mesh, name, table[:, 0], table[:, 1:]))
        into(self.scope.groups, keyword.options.get("ELSET"), table[:, 0])

    def _elgen(self, keyword: DeckKeyword) -> None:
        for row in table_of(keyword, 2, 10).astype(np.int64):
            named = [e for e in self.scope.elements if row[0] in e.numbers]
            if not named and self.scope.skipped:
                continue
            if not named:
                raise wrong(keyword, f"of element {row[0]}, which is not defined above")
            kind, label, numbers, nodes = named[-1]
            numbers, nodes = numbers[numbers == row[0]], nodes[numbers == row[0]]
            for count, by_nodes, by_number in row[1:].reshape(3, 3):
                steps = np.arange(max(count, 1))[:, None]
                numbers = (numbers + steps * (by_number or 1)).ravel()
                nodes = (nodes[None] + steps[:, :, None] * (by_nodes or 1)).reshape(
                    -1, nodes.shape[1]
                )
            self.scope.elements.append(DeckElements(kind, label, numbers[1:], nodes[1:]))
            into(self.scope.groups, keyword.options.get("ELSET"), numbers)

    def _set(self, keyword: DeckKeyword) -> None:
        is_nodes = keyword.name == "NSET"
        name = keyword.options.get(keyword.name, "")
        items: list[np.ndarray | str] = []
        if "GENERATE" in keyword.options:
            for first, last, step in table_of(keyword, 2, 3).astype(np.int64):
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
            into(self.scope.nodes if is_nodes else self.scope.groups, name, item)

    def _surface(self, keyword: DeckKeyword) -> None:
        name = keyword.options.get("NAME", "").upper()
        if keyword.options.get("TYPE", "ELEMENT").upper() == "NODE":
            for line in keyword.lines:
                into(self.scope.nodes, name, line.split(",")[0].strip().upper())
            return
        for line in keyword.lines:
            of, face = (word.strip().upper() for word in (line + ",").split(",")[:2])
            self.scope.sides.setdefault(name, []).append((of, face))

    def mesh(self) -> Mesh:
        bodies = self.instances or [DeckBody(name, part) for name, part in self.parts.items()]
        whole = DeckBody("", self.whole)
        if self.whole.numbers or not bodies:
            bodies = [*bodies, whole]
        merged = Merged(self.path)
        for body in bodies:
            merged.add(body)
        for is_nodes, name, instance, items in self.assembly:
            sets = merged.nodes if is_nodes else merged.elements
            owner = instance if instance in sets.numbering else bodies[-1].name
            for item in items:
                if isinstance(item, str):
                    sets.extend(name, f"{instance}.{item}")
                else:
                    sets.add(name, owner, item)
        if self.instances:  # sets of the assembly may contain INSTANCE.SET and other sets
            pairs = (self.whole.nodes, merged.nodes), (self.whole.groups, merged.elements)
            for of_deck, sets in pairs:
                for name, items in of_deck.items():
                    for item in items:
                        if isinstance(item, str):
                            sets.extend(name, item)
            merged.add_surfaces(whole)
        return merged.mesh()


_READ: dict[str, Callable[[_Deck, DeckKeyword], None]] = {
    "PART": _Deck._part, "END PART": _Deck._end_part, "INSTANCE": _Deck._instance,
    "END INSTANCE": _Deck._end_part, "SYSTEM": _Deck._system, "NODE": _Deck._node,
    "NGEN": _Deck._ngen, "NCOPY": _Deck._ncopy, "NFILL": _Deck._nfill, "ELEMENT": _Deck._element,
    "ELGEN": _Deck._elgen, "NSET": _Deck._set, "ELSET": _Deck._set, "SURFACE": _Deck._surface,
}  # fmt: skip


def read_deck(path: Path) -> Mesh:
    """Read a deck; raises ScriptError with the line that cannot be read."""
    return _Deck(path).mesh()
