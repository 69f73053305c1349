"""Columns of numbers in files, or arrays from Python."""

import re
from collections.abc import Mapping
from math import isnan
from pathlib import Path

import numpy as np

from karamelo_py.language.kinds import TableFile
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.reading import read_text, refuse_decimal_commas
from karamelo_py.script.terms import number_of


class FileColumns:
    """Script argument: columns of a file or dump, or arrays passed to `Simulation`."""

    script_kind = "the name of a file of columns"

    def __init__(self, name: str, columns: Mapping[str, np.ndarray]):
        self.name = name
        self.columns = columns

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "FileColumns":
        arrays = hub.functions.get(argument.text)
        if isinstance(arrays, Mapping):
            return cls(
                "the table", {str(name): np.asarray(of, float) for name, of in arrays.items()}
            )
        path = TableFile.from_script(hub, argument)
        if path.suffix.lower() == ".xyz":
            return cls(str(path), read_xyz(path))
        return cls(str(path), _of_dump(hub, path) if _is_dump(path) else read_table(path))


def _is_dump(path: Path) -> bool:
    with path.open("rb") as file:
        return path.suffix in (".vtu", ".pvd", ".h5", ".hdf5", ".gz") or file.read(6) == b"ITEM: "


def _of_dump(hub: Scene, path: Path) -> dict[str, np.ndarray]:
    from karamelo_py.output import snapshots  # imports XML, which only dumps need

    *_, last = snapshots.read(path)
    domain = hub.require_domain()
    axes = "xyz"[: domain.dimension]
    columns = {
        name: values.astype(float)
        for name, values in last.columns.items()
        if name in axes
        or (re.fullmatch(f"v[{axes}]|s[123]{{2}}|T|volume|mass", name) and values.any())
    }
    velocity = last.columns.get("velocity", last.columns.get("Velocity"))
    if velocity is not None and "vx" not in last.columns:
        columns |= {f"v{axis}": velocity[:, k].astype(float) for k, axis in enumerate(axes)}
    if "volume" in columns:
        x = np.column_stack([columns[axis] for axis in axes])
        columns["volume"] = columns["volume"] / domain.depth(x)
    return columns


def read_xyz(path: Path) -> dict[str, np.ndarray]:
    """Read positions, velocities and masses from the last frame of an .xyz file.

    Rows contain element, x, y, z, unless the second line gives Properties (extended XYZ).
    """
    lines = read_text(path).rstrip().splitlines()
    begin, first = 0, 0
    while first < len(lines) or not lines:
        word, begin = "".join(lines[first : first + 1]).strip(), first + 2
        first = begin + int(word) if word.isdigit() else len(lines) + 1
        if first > len(lines):
            raise ScriptError(
                f"line {begin - 1} of {path}: {word}",
                expected="the number of points, a line of text, and a line for each point",
                argument="file",
            )
    stated = re.search(r'Properties="?([\w:]+)', lines[begin - 1])
    parts = (stated[1] if stated else "species:S:1:pos:R:3").split(":")
    names = {"pos": "xyz", "velo": ["vx", "vy", "vz"], "mass": ["mass"], "masses": ["mass"]}
    columns: dict[str, int] = {}
    at = 0
    for name, width in zip(parts[::3], map(int, parts[2::3]), strict=True):
        columns |= {of: at + k for k, of in enumerate(names.get(name, ()))}
        at += width
    rows = [line.split() for line in lines[begin:]]
    for number, row in enumerate(rows, begin + 1):
        if any(k >= len(row) or number_of(row[k]) is None for k in columns.values()):
            expected = f"columns {':'.join(parts)}"
            message = f"line {number} of {path}: {' '.join(row)}"
            raise ScriptError(message, expected=expected, argument="file")
    return {of: np.array([row[k] for row in rows], float) for of, k in columns.items()}


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Read columns separated by commas, semicolons or blanks; # begins a comment line.

    The first row may contain names; without names, columns are "1", "2", ...
    """
    rows = []
    try:
        text = read_text(path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ScriptError(f"{path} cannot be read: {reason}", argument="file") from None
    refuse_decimal_commas(path, text, "file")
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            cells = re.split(r"\s*[,;\t]\s*" if re.search("[,;\t]", line) else r"\s+", line.strip())
            rows.append((number, [cell.strip('" ') for cell in cells]))
    if not rows:
        raise ScriptError(f"{path} has no rows", expected="columns of numbers", argument="file")
    names = rows[0][1]
    if any(number_of(cell) is not None for cell in names):
        names = [str(k + 1) for k in range(len(names))]
    else:
        rows = rows[1:]
    table = []
    for number, cells in rows:
        values = [number_of(cell) for cell in cells]
        if len(values) != len(names) or None in values or any(map(isnan, values)):
            expected = f"{len(names)} numbers: {', '.join(names)}"
            message = f"line {number} of {path}: {' '.join(cells)}"
            raise ScriptError(message, expected=expected, argument="file")
        table.append(values)
    return dict(zip(names, np.array(table, float).reshape(-1, len(names)).T, strict=True))
