"""Meshes in LS-DYNA keyword decks: nodes, solids, shells, parts and sets.

Numbers are in columns, long columns or separated by commas (LS-DYNA Keyword User's Manual, vol. I).
"""

import re
from collections.abc import Iterator
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
    included,
    into,
    into_by_owner,
    table_of,
    wrong,
)

ENDINGS = (".k", ".key", ".dyn", ".kwd")
_SET = re.compile(r"SET_(NODE|SOLID|SHELL|PART|SEGMENT)(_LIST)?(_GENERATE)?(_TITLE)?")
# Type that a collapsed hexahedron becomes, its pairs of equal nodes, and its distinct nodes.
_COLLAPSED = (
    ("tetra", ((3, 4), (4, 5), (5, 6), (6, 7)), [0, 1, 2, 3]),
    ("pyramid", ((4, 5), (5, 6), (6, 7)), [0, 1, 2, 3, 4]),
    ("wedge", ((4, 5), (6, 7)), [0, 1, 4, 3, 2, 6]),
    ("wedge", ((2, 3), (6, 7)), [0, 1, 2, 4, 5, 6]),
    ("hexahedron", (), list(range(8))),
)


def _keywords(path: Path, above: tuple[Path, ...] = ()) -> Iterator[DeckKeyword]:
    text = path.read_text("utf-8", errors="replace").splitlines()
    lines = [(n, line) for n, line in enumerate(text, 1) if not line.startswith("$")]
    starts = [k for k, (_, line) in enumerate(lines) if line.startswith("*")]
    is_long = False
    for at, end in pairwise([*starts, len(lines)]):
        number, head = lines[at]
        name, *words = head[1:].upper().split() or [""]
        is_long |= name == "KEYWORD" and "LONG=Y" in words
        options = {"LONG": ""} if is_long or "+" in words else {}
        data = [line for _, line in lines[at + 1 : end]]
        keyword = DeckKeyword(name, options, data, number, path)
        if name == "END":
            return
        if any("&" in line for line in data) and name.startswith(("NODE", "ELEMENT")):
            raise wrong(keyword, "has parameters (&)", "numbers in their place")
        if name == "INCLUDE":
            for file in filter(None, map(str.strip, data)):
                yield from _keywords(included(keyword, file, (*above, path)), (*above, path))
        elif name in ("INCLUDE_TRANSFORM", "NODE_TRANSFORM"):
            raise wrong(keyword, "is not read", "the nodes where they belong")
        else:
            yield keyword


def _table(keyword: DeckKeyword, count: int, width: int = 10, ids: int = 1) -> np.ndarray:
    """Return numbers (n, count): `ids` columns of 8 or 10 characters, then columns of `width`.

    In long decks all columns have 20 characters.
    """
    is_long = "LONG" in keyword.options
    widths = [20] * count if is_long else [*[8 if width != 10 else 10] * ids, *[width] * count]
    lines = [line for line in keyword.lines if line.strip()]
    return table_of(keyword._replace(lines=lines), 1, count, widths[:count])


def _elements(part: DeckPart, keyword: DeckKeyword) -> None:
    lines = [line for line in keyword.lines if line.strip()]
    kind = keyword.name.removeprefix("ELEMENT_")
    if not re.fullmatch(r"(T?SHELL|SOLID)(_ORTHO|_THICKNESS|_BETA|_MCID)?", kind):
        part.skipped[keyword.name] += len(lines)
        return
    more = {"ORTHO": 2}.get(kind.partition("_")[2], int("_" in kind))
    widths = (8, 10) if "LONG" not in keyword.options else (20, 20)
    first = lines[0] if lines else ""
    apart = kind.startswith("SOLID") and len(first.rstrip().rstrip(",")) <= 2 * widths[1]
    apart &= first.count(",") < 3
    step = 1 + apart + more
    width = widths[0]
    heads = keyword._replace(lines=lines[::step])
    table = table_of(heads, 2, 2 if apart else 10, [width] * (2 if apart else 10))
    nodes = table[:, 2:]
    if apart:
        rest = keyword._replace(lines=lines[1::step])
        nodes = table_of(rest, 4, 10, [width] * 10)[: len(table)]
    numbers, owners, nodes = (of.astype(np.int64) for of in (table[:, 0], table[:, 1], nodes))
    if len(nodes) < len(numbers):
        raise wrong(keyword, "ends in the middle of an element")
    into_by_owner(part.groups, owners, numbers)
    label = f"ELEMENT_{kind.partition('_')[0]}"
    if kind.startswith("SHELL"):
        is_triangle = (nodes[:, 3] == nodes[:, 2]) | (nodes[:, 3] == 0)
        sorts = [("triangle", is_triangle, [0, 1, 2]), ("quad", ~is_triangle, [0, 1, 2, 3])]
    else:
        full = (nodes[:, 8:] > 0).all(axis=1) & apart
        sorts, rest_of = [("tetra10", full, list(range(10)))], ~full
        nodes[:, 4:8] = np.where(nodes[:, 4:8] == 0, nodes[:, 3:4], nodes[:, 4:8])
        for name, equal, corners in _COLLAPSED:
            these = rest_of.copy()
            for a, b in equal:
                these &= nodes[:, a] == nodes[:, b]
            sorts.append((name, these, corners))
            rest_of = rest_of & ~these
    for name, these, corners in sorts:
        if these.any():
            chosen = nodes[these][:, corners]
            part.elements.append(DeckElements(name, label, numbers[these], chosen))


def _part(part: DeckPart, keyword: DeckKeyword, names: dict[str, str]) -> None:
    step = 2 if keyword.name == "PART" else len(keyword.lines)
    for title, line in zip(keyword.lines[::step], keyword.lines[1::step], strict=False):
        number = line.split(",")[0] if "," in line else line[:10]
        if number.strip().isdigit():
            names[number.strip()] = title.strip()


def _set(part: DeckPart, keyword: DeckKeyword, match: re.Match) -> None:
    kind, _, generated, titled = match.groups()
    lines = keyword.lines
    title = lines[0].strip() if titled and lines else ""
    header = _table(keyword._replace(lines=lines[bool(titled) :][:1]), 1)
    if not len(header):
        return
    rows = _table(keyword._replace(lines=lines[bool(titled) + 1 :]), 8).astype(np.int64)
    number = f"{kind}:{int(header[0, 0])}"
    for name in filter(None, (number, title.upper())):
        if kind == "SEGMENT":
            nodes = rows[:, :4]
            flat = (nodes[:, 3] == nodes[:, 2]) | (nodes[:, 3] == 0)
            faces = part.faces.setdefault(name, [])
            faces += [of for of in (nodes[flat, :3], nodes[~flat]) if len(of)]
            continue
        flat = rows[rows > 0]
        if generated:
            pairs = flat[: len(flat) // 2 * 2].reshape(-1, 2)
            flat = np.concatenate([np.arange(a, b + 1) for a, b in pairs] or [flat])
        if kind == "PART":
            for owner in flat:
                into(part.groups, name, str(owner))
        else:
            into(part.nodes if kind == "NODE" else part.groups, name, flat)


def read_lsdyna(path: Path) -> Mesh:
    """Read a deck; raises ScriptError with the line that cannot be read."""
    part, titles = DeckPart(), dict[str, str]()
    for keyword in _keywords(path):
        match = _SET.fullmatch(keyword.name)
        if keyword.name == "NODE":
            table = _table(keyword, 4, 16)
            part.add_nodes(table[:, 0].astype(np.int64), table[:, 1:])
        elif keyword.name.startswith("ELEMENT_"):
            _elements(part, keyword)
        elif keyword.name.startswith("PART"):
            _part(part, keyword, titles)
        elif match:
            _set(part, keyword, match)
    for number, title in titles.items():
        if title and number in part.groups and title.upper() not in part.groups:
            into(part.groups, title, number)
    merged = Merged(path)
    merged.add(DeckBody("", part))
    return merged.mesh()
