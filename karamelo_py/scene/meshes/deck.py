"""Content of keyword decks by part, merged into one mesh."""

import itertools
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.scene.meshes.data import FACE_TYPES, CellBlock, Mesh, OnDemand
from karamelo_py.script.errors import ScriptError

_MOST = 2**31  # largest size of an included file in bytes
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
SetItems = dict[str, list[np.ndarray | str]]  # numbers of items, and names of further sets


class DeckKeyword(NamedTuple):
    name: str
    options: dict[str, str]
    lines: list[str]
    number: int  # line number of the keyword
    file: Path


def wrong(keyword: DeckKeyword, error: str, expected: str | None = None) -> ScriptError:
    return ScriptError(
        f"{keyword.file.name}, line {keyword.number}: *{keyword.name} {error}",
        argument="file",
        expected=expected,
    )


def included(keyword: DeckKeyword, name: str, above: tuple[Path, ...]) -> Path:
    path = keyword.file.parent / name
    if path in above or not path.is_file() or path.stat().st_size > _MOST:
        raise wrong(keyword, f"of '{name}', which cannot be read", "a file next to the deck")
    return path


def table_of(keyword: DeckKeyword, least: int, most: int, widths: Sequence[int] = ()) -> np.ndarray:
    """Return numbers (n, most) from data lines, separated by commas or in columns of `widths`.

    Omitted numbers are 0. Raises ScriptError if a line has fewer than `least` numbers.
    """
    ends = list(itertools.accumulate(widths))
    starts = [0, *ends[:-1]]
    rows = []
    for line in keyword.lines:
        by_columns = widths and "," not in line
        row = (
            [line[a:b] for a, b in zip(starts, ends, strict=True)]
            if by_columns
            else (line.rstrip().rstrip(",").split(",")[:most])
        )
        rows.append([x if x.strip() else "0" for x in row] + ["0"] * (most - len(row)))
        if len(row) < least:
            raise wrong(keyword, f"has a line that is too short: {line.strip()}")
    try:
        return np.array(rows, float).reshape(-1, most)
    except ValueError:
        lines = zip(keyword.lines, rows, strict=True)
        bad = next(line for line, row in lines if not all(map(_is_number, row)))
        raise wrong(keyword, f"has a line that is not numbers: {bad.strip()}") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class DeckElements(NamedTuple):
    type: str  # meshio's type
    label: str  # name of the type in the deck
    numbers: np.ndarray  # (n,) element numbers
    nodes: np.ndarray  # (n, c) node numbers of the deck


class DeckPart:
    def __init__(self) -> None:
        self.numbers: list[np.ndarray] = []
        self.places: list[np.ndarray] = []
        self.elements: list[DeckElements] = []
        self.skipped: Counter[str] = Counter()
        self.nodes: SetItems = {}
        self.groups: SetItems = {}
        self.sides: dict[str, list[tuple[str, str]]] = {}  # (element or set, S1 or S2 ...)
        self.faces: dict[str, list[np.ndarray]] = {}  # node numbers of the deck (n, c)
        self.system: Callable[[np.ndarray], np.ndarray] = lambda x: x  # applied to later nodes

    def add_nodes(self, numbers: np.ndarray, places: np.ndarray) -> None:
        self.numbers.append(numbers)
        self.places.append(places)

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ascending node numbers (n,) and positions, as last defined in the deck."""
        if not self.numbers:
            return np.empty(0, np.int64), np.empty((0, 3))
        numbers, places = np.concatenate(self.numbers), np.concatenate(self.places)
        unique, last = np.unique(numbers[::-1], return_index=True)
        return unique, places[::-1][last]


class DeckBody(NamedTuple):
    name: str
    part: DeckPart
    move: Callable[[np.ndarray], np.ndarray] = lambda x: x


def cylindrical(x: np.ndarray) -> np.ndarray:
    angle = np.radians(x[:, 1])
    return np.stack([x[:, 0] * np.cos(angle), x[:, 0] * np.sin(angle), x[:, 2]], axis=1)


def into(sets: dict, name: str | None, item: np.ndarray | str) -> None:
    if name:
        sets.setdefault(name.upper(), []).append(item)


def into_by_owner(sets: SetItems, owners: np.ndarray, numbers: np.ndarray) -> None:
    """Add numbers (n,) to the sets named by `owners` (n,), such as parts or properties."""
    order = np.argsort(owners, kind="stable")
    names, first = np.unique(owners[order], return_index=True)
    for name, of in zip(names, np.split(numbers[order], first[1:]), strict=True):
        into(sets, str(name), of)


def members(sets: SetItems, name: str) -> np.ndarray:
    if name.lstrip("-").isdigit() and name not in sets:
        return np.array([int(name)])
    return np.unique(np.concatenate([np.empty(0, np.int64), *_resolved(sets, name, ())]))


def _resolved(sets: SetItems, name: str, above: tuple[str, ...]) -> Iterator[np.ndarray]:
    for item in sets.get(name.upper(), ()):
        if not isinstance(item, str):
            yield item
        elif item not in above:
            yield from _resolved(sets, item, (*above, name))


class Numbering(NamedTuple):
    deck: np.ndarray  # (n,) numbers in the deck, ascending
    mesh: np.ndarray  # (n,) numbers in the mesh

    def of(self, numbers: np.ndarray) -> np.ndarray:
        """Return the numbers (m,) in the mesh for numbers in the deck, -1 where there is none."""
        if not len(self.deck):
            return np.full(len(numbers), -1)
        at = np.minimum(np.searchsorted(self.deck, numbers), len(self.deck) - 1)
        return np.where(self.deck[at] == numbers, self.mesh[at], -1)

    def listed(self, numbers: np.ndarray) -> np.ndarray:
        of_mesh = self.of(numbers)
        return of_mesh[of_mesh >= 0]


NO_NUMBERS = Numbering(np.empty(0, np.int64), np.empty(0, np.int64))


class Sets:
    """Sets by name; each is a function that returns numbers in the mesh, as there may be many."""

    def __init__(self) -> None:
        self.by_name: dict[str, list[Callable[[], np.ndarray]]] = defaultdict(list)
        self.numbering: dict[str, Numbering] = {}

    def add(self, name: str, instance: str, items: SetItems | np.ndarray, key: str = "") -> None:
        """Add items of an instance, or its set `key` of items, to the set `name`."""
        numbering = self.numbering.get(instance, NO_NUMBERS)

        def listed() -> np.ndarray:
            of_deck = members(items, key) if isinstance(items, dict) else items
            return numbering.listed(of_deck)

        self.by_name[name].append(listed)

    def extend(self, name: str, other: str) -> None:
        self.by_name[name] += list(self.by_name.get(other, ()))

    def listed(self, name: str) -> np.ndarray:
        parts = (listed() for listed in self.by_name.get(name, ()))
        return np.concatenate([np.empty(0, np.int64), *parts])


def _names(body: DeckBody, name: str) -> set[str]:
    return {name, f"{body.name}.{name}"} if body.name else {name}


class Merged:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.points: list[np.ndarray] = []
        # Numbers (n,) and nodes (n, c), by type and label.
        self.blocks: dict[tuple[str, str], list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
        self.count = 0
        self.nodes, self.elements = Sets(), Sets()
        self.surfaces: dict[str, list[tuple[int, np.ndarray]]] = defaultdict(list)
        self.faces: dict[str, list[CellBlock]] = defaultdict(list)
        self.skipped: Counter[str] = Counter()

    def add(self, body: DeckBody) -> None:
        numbers, places = body.part.table()
        table = Numbering(numbers, np.arange(len(numbers)) + sum(map(len, self.points)))
        self.nodes.numbering[body.name] = table
        self.points.append(body.move(places))
        self.skipped.update(body.part.skipped)
        numbered = [np.empty((2, 0), np.int64)]
        for kind, label, numbers, nodes in body.part.elements:
            of_mesh = table.of(nodes.ravel()).reshape(nodes.shape)
            if (of_mesh < 0).any():
                row, column = np.argwhere(of_mesh < 0)[0]
                raise ScriptError(
                    f"{self.path.name}: element {numbers[row]} has the node "
                    f"{nodes[row, column]}, which is not defined",
                    argument="file",
                )
            rows = self.count + np.arange(len(nodes))
            self.blocks[kind, label].append((rows, of_mesh))
            self.count += len(nodes)
            numbered.append(np.stack([numbers, rows]))
        pairs = np.concatenate(numbered, axis=1)
        elements = Numbering(*pairs[:, np.argsort(pairs[0], kind="stable")])
        self.elements.numbering[body.name] = elements
        self.elements.add(body.name, body.name, elements.deck)
        for of_part, sets in ((body.part.nodes, self.nodes), (body.part.groups, self.elements)):
            for name in of_part:
                for key in _names(body, name):
                    sets.add(key, body.name, of_part, name)
        self.add_surfaces(body)
        for name, faces in body.part.faces.items():
            for nodes in faces:
                of_mesh = table.of(nodes.ravel()).reshape(nodes.shape)
                complete = of_mesh[(of_mesh >= 0).all(axis=1)]
                self.faces[name].append(CellBlock(FACE_TYPES[nodes.shape[1]], complete))

    def add_surfaces(self, body: DeckBody) -> None:
        numbering = self.elements.numbering.get(body.name, NO_NUMBERS)
        for name, items in body.part.sides.items():
            for side in range(6):
                owners = [of for of, face in items if face == f"S{side + 1}"]
                numbers = [int(of) for of in owners if of.isdigit()]
                elements = [numbering.listed(np.array(numbers, np.int64))]
                for of in owners:
                    of_body = f"{body.name}.{of}"
                    if not of.isdigit():
                        in_body = of_body in self.elements.by_name
                        elements.append(self.elements.listed(of_body if in_body else of))
                for key in _names(body, name) if owners else ():
                    self.surfaces[key].append((side, np.concatenate(elements)))

    def mesh(self) -> Mesh:
        cells, numbers = [], []
        for (kind, label), parts in self.blocks.items():
            of_block, nodes = map(np.concatenate, zip(*parts, strict=True))
            numbers.append(of_block)
            cells.append(CellBlock(kind, nodes, label=label))
        faces = self.faces
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
        points = np.concatenate(self.points)

        def masks_of(name: str) -> list[np.ndarray]:
            if name in faces:
                mine = {id(cell) for cell in faces[name]}
                return [mask | (id(c) in mine) for mask, c in zip(none, every, strict=True)]
            wanted = self.elements.listed(name)
            return [np.isin(of_block, wanted) for of_block in numbers] + none[len(cells) :]

        def mask_of(name: str) -> np.ndarray:
            mask = np.zeros(len(points), bool)
            mask[self.nodes.listed(name)] = True
            return mask

        names = dict.fromkeys([*filter(None, self.elements.by_name), *faces])
        sets = OnDemand(names, masks_of)
        return Mesh(points, every, sets, OnDemand(self.nodes.by_name, mask_of), self.skipped)
