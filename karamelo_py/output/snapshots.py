"""Readers of particle dumps: LAMMPS text (or gzipped), HDF5, VTU."""

import gzip
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from karamelo_py.output.hdf5_file import reading
from karamelo_py.output.units import LENGTHS, Units
from karamelo_py.script.errors import ScriptError

TEXTS = ("element", "typelabel")  # columns of LAMMPS that are texts


class Snapshot(NamedTuple):
    step: int
    time: float  # time of the state, NaN if unknown
    columns: dict[str, np.ndarray]  # columns (n,) by name, with x, y, z
    lo: np.ndarray  # (3,) lower corner of the domain, or of the points
    hi: np.ndarray
    units: Mapping[str, str] = {}


def read(path: Path, first: int = 0) -> Iterator[Snapshot]:
    """Yield snapshots from number `first` on. Raises ScriptError if the file is not a dump."""
    readers: dict[str, Callable[[Path, int], Iterator[Snapshot]]] = {
        ".h5": _hdf5, ".hdf5": _hdf5, ".vtu": _vtu, ".pvd": _pvd,
    }  # fmt: skip
    reader = readers.get(path.suffix, _lammps)
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        raise ScriptError(f"{path} is {kind}", expected="a file of dump particle, hdf5 or vtk")
    try:
        yield from reader(path, first)
    except ScriptError:
        raise
    except Exception as error:  # damaged files raise many kinds of exceptions
        reason = error.strerror if isinstance(error, OSError) else None
        raise ScriptError(
            f"{path} cannot be read: {reason}"
            if reason
            else f"{path} is not a dump of points, or it is damaged",
            expected="a file that dump particle, hdf5 or vtk has written",
        ) from error


def _lammps(path: Path, first: int) -> Iterator[Snapshot]:
    opener, units = (gzip.open if path.suffix == ".gz" else open), None
    with opener(path, "rt", encoding="ascii") as file:
        step, time, count, box, tilted = 0, 0.0, 0, np.zeros((3, 2)), False
        while line := file.readline():
            if not line.startswith("ITEM: "):
                raise ValueError(line)
            item = line.removeprefix("ITEM: ").split()
            if item[0] == "TIMESTEP":
                step = int(file.readline())
            elif item[0] == "TIME":
                time = float(file.readline())
            elif item[0] == "NUMBER":
                count = int(file.readline())
            elif item[0] == "BOX":
                box = np.array([file.readline().split()[:2] for _ in range(3)], float)
                tilted = "xy" in item
            elif item[0] == "ATOMS" and first > 0:
                first -= sum(1 for _ in islice(file, count)) == count
            elif item[0] == "ATOMS":
                numbers = [k for k, name in enumerate(item[1:]) if name not in TEXTS]
                table = np.empty((0, len(numbers)))
                if count:
                    table = np.loadtxt(file, max_rows=count, ndmin=2, usecols=numbers)
                columns = dict(zip((item[1 + k] for k in numbers), table.T, strict=True))
                _place(path, columns, box, tilted)
                named: dict[str, str] = (
                    {name: units.of_column(name) for name in (*columns, "time")} if units else {}
                )
                yield Snapshot(step, time, columns, *box.T, named)
            elif item[0] == "UNITS":
                words = file.readline().split()
                units = Units(*words) if words[0] in LENGTHS else None  # others are LAMMPS's
            else:
                file.readline()


def _place(path: Path, columns: dict[str, np.ndarray], box: np.ndarray, tilted: bool) -> None:
    """Add id, type, x, y, z to the columns; positions may be unwrapped (xu) or scaled (xs)."""
    count = len(next(iter(columns.values()), ()))
    columns.setdefault("id", np.arange(1.0, count + 1))
    columns.setdefault("type", np.ones(count))
    for axis, (lo, hi) in zip("xyz", box, strict=True):
        scaled = columns.get(f"{axis}s", columns.get(f"{axis}su"))
        if axis not in columns and f"{axis}u" in columns:
            columns[axis] = columns[f"{axis}u"]
        elif axis not in columns and scaled is not None and not tilted:
            columns[axis] = lo + scaled * (hi - lo)
        elif axis == "z":
            columns.setdefault(axis, np.zeros(count))
        elif axis not in columns:
            raise ScriptError(
                f"{path} has no column {axis}" + " in a tilted box" * (scaled is not None),
                expected=f"a dump with {axis}, {axis}u, or {axis}s of a box that is not tilted",
            )


def _hdf5(path: Path, first: int) -> Iterator[Snapshot]:
    with reading(path) as root:
        names = [name for name in root if root[name].ndim == 2]
        moments = zip(root["step"][first:], root["time"][first:], strict=True)
        units = {name: root[name].attrs.get("units", "") for name in (*names, "time")}
        for k, (step, time) in enumerate(moments, first):
            columns = {name: root[name][k] for name in names}
            columns |= {name: root[name][:] for name in ("id", "type")}
            exists = ~np.isnan(columns["x"])
            columns = {name: column[exists] for name, column in columns.items()}
            yield Snapshot(int(step), float(time), columns, *root.attrs["domain"], units)


def _pvd(path: Path, first: int) -> Iterator[Snapshot]:
    for entry in [*ElementTree.parse(path).iter("DataSet")][first:]:
        yield from _vtu(path.parent / entry.attrib["file"], 0, float(entry.attrib["timestep"]))


def _vtu(path: Path, _: int, time: float = np.nan) -> Iterator[Snapshot]:
    import meshio

    mesh = meshio.vtu.read(path)  # meshio.read would end the program after an error
    number = re.search(r"(\d+)\D*$", path.stem)
    columns = dict(zip("xyz", mesh.points.T, strict=True)) | mesh.point_data
    lo, hi = mesh.points.min(axis=0), mesh.points.max(axis=0)
    margin = np.where(hi > lo, 0.03 * (hi - lo).max(), 0)
    lo, hi = lo - margin, hi + margin
    yield Snapshot(int(number[1]) if number else 0, time, columns, lo, hi)
