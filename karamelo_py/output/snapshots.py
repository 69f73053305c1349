"""Dumps of points read back: LAMMPS text (gzipped or not), HDF5, VTU."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.script.errors import ScriptError


class Snapshot(NamedTuple):
    """The points at one moment.

    Attributes
    ----------
    step, time
        When.
    columns
        (n,) arrays by name, with x, y and z among them.
    lo, hi
        (3,) corners of the domain, or of the points where the file does not say.
    """

    step: int
    time: float
    columns: dict[str, np.ndarray]
    lo: np.ndarray
    hi: np.ndarray


def read(path: Path) -> Iterator[Snapshot]:
    """The snapshots in a file, in their order.

    Raises
    ------
    ScriptError
        If the file cannot be read, or is no dump.
    """
    readers = {".h5": _hdf5, ".hdf5": _hdf5, ".vtu": _vtu}
    reader = readers.get(path.suffix, _lammps)
    try:
        yield from reader(path)
    except (OSError, ValueError, KeyError, StopIteration, RuntimeError, SystemExit) as error:
        reason = getattr(error, "strerror", None)
        raise ScriptError(
            f"{path} cannot be read: {reason}" if reason else f"{path} is not a dump of points",
            expected="a file that dump particle, hdf5 or vtk has written",
        ) from error


def _lammps(path: Path) -> Iterator[Snapshot]:
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="ascii") as file:
        step, time, count, box = 0, 0.0, 0, np.zeros((3, 2))
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
            elif item[0] == "ATOMS":
                table = np.loadtxt(file, max_rows=count, ndmin=2) if count else np.empty((0, 99))
                columns = dict(zip(item[1:], table.T, strict=count > 0))
                yield Snapshot(step, time, columns, *box.T)
            else:
                file.readline()


def _hdf5(path: Path) -> Iterator[Snapshot]:
    import h5py

    # Also one that a killed program has left, or a running one writes.
    with h5py.File(path, "r", libver="latest", swmr=True, locking=False) as root:
        names = [name for name in root if root[name].ndim == 2]
        for k, (step, time) in enumerate(zip(root["step"][:], root["time"][:], strict=True)):
            columns = {name: root[name][k] for name in names}
            columns |= {name: root[name][:] for name in ("id", "type")}
            there = ~np.isnan(columns["x"])
            columns = {name: column[there] for name, column in columns.items()}
            yield Snapshot(int(step), float(time), columns, *root.attrs["domain"])


def _vtu(path: Path) -> Iterator[Snapshot]:
    import meshio

    mesh = meshio.read(path)
    step = int(path.stem.rpartition(".")[2]) if path.stem.rpartition(".")[2].isdigit() else 0
    columns = dict(zip("xyz", mesh.points.T, strict=True)) | mesh.point_data
    times = [float(t) for t in mesh.field_data.get("TimeValue", [np.nan])]
    yield Snapshot(step, times[0], columns, mesh.points.min(axis=0), mesh.points.max(axis=0))
