"""dump hdf5 and grid/hdf5: arrays by time and id."""

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.output.fields import PIECE
from karamelo_py.output.files import reported, whole
from karamelo_py.output.hdf5_file import reading
from karamelo_py.output.vtkhdf import VERSION, describe
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import OfNodes, OfPoints, TableDump, TableRows

# Higher levels than 1 take twice as long and save only a few per cent.
STORED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
CHUNK = 1 << 16
OF_A_COLUMN = 1 << 14  # bytes that HDF5 may need to find the chunks of a column


class SnapshotRows(NamedTuple):
    time: float
    step: int
    last: int
    tables: Iterable[TableRows]


class Hdf5Dump(TableDump):
    """A dump as arrays (snapshot, row). Rows without a value (deleted points) hold NaN.

    Parameters
    ----------
    file
        File name. With a ``*``, which becomes the step number, each snapshot is a separate file.
    """

    remembers = ("_snapshots",)
    to_first = True
    _snapshots = 0

    def write(self) -> None:
        update = self.hub.update
        snapshot = SnapshotRows(update.time, update.step, self.extent()[1], self.tables())
        self._add(self.path(), self._snapshots, snapshot)
        self._snapshots += 1

    def _add(self, path: Path, k: int, snapshot: SnapshotRows) -> None:
        import h5py

        if k == 0 or self.one_file_per_step:
            # Made in memory first, since HDF5 cannot close a file on a full disk.
            with h5py.File("new", "w", driver="core", backing_store=False, libver=VERSION) as root:
                self._prepare(root, snapshot.last)
                root.flush()
                image = root.id.get_file_image()
            with whole(path) as file:
                file.write(image)
                file.flush()
                self._go_on(Path(file.name), 0, snapshot)
            return
        self._go_on(path, k, snapshot)

    def _go_on(self, path: Path, k: int, snapshot: SnapshotRows) -> None:
        self._reserve(path, snapshot.last)
        try:
            with _opened_to_append(path) as root:
                try:
                    self._append(root, k, snapshot)
                except BaseException:
                    for name in ("time", "step", *self.columns):
                        root[name].resize(k, axis=0)
                    raise
        except (
            OSError,
            RuntimeError,
        ) as error:  # h5py raises both types, with the message of the operating system
            reason = re.search("error message = '([^']*)'", str(error))
            message = reason[1] if reason else str(error).splitlines()[0]
            raise ScriptError(f"cannot write {path}: {message}") from error

    def _reserve(self, path: Path, last: int) -> None:
        """Raise an error if the disk lacks space for a snapshot, which HDF5 would not report."""
        if not hasattr(os, "posix_fallocate"):
            return
        rows = max(last, 1)
        chunk = min(rows, CHUNK)
        each = 8 * chunk * (rows // chunk + 1)
        room = (each + OF_A_COLUMN) * (len(self.columns) + 2) + OF_A_COLUMN
        with reported(path), path.open("r+b") as file:
            size = file.seek(0, os.SEEK_END)
            try:
                os.posix_fallocate(file.fileno(), size, room)
            finally:
                file.truncate(size)

    def resumed(self) -> None:
        """Continue a copy of the file that an earlier run wrote, with the bytes of one long run.

        HDF5 cannot write to a file that was open when a program was killed.
        """
        path, count = self.path(), self._snapshots
        if count == 0 or self.one_file_per_step:
            return
        again = path.with_name(f"{path.name}.again")
        try:
            with reading(path) as old:
                if len(old["step"]) < count:
                    raise OSError
                for k in range(count):
                    self._add(again, k, self._past(old, k))
            os.replace(again, path)
        except (OSError, RuntimeError, KeyError, ValueError, ScriptError):
            again.unlink(missing_ok=True)
            self.warn_of_absence()
            self._snapshots = 0

    def _past(self, old: Any, k: int) -> SnapshotRows:
        def tables(begins: Iterable[int]) -> Iterator[TableRows]:
            for begin in begins:
                rows = slice(begin, begin + PIECE)
                columns = [old[name][k, rows] for name in self.columns]
                at = np.flatnonzero(~np.isnan(columns).all(axis=0))
                ids, types = old["id"][rows][at], old["type"][rows][at]
                yield TableRows(ids, types, [column[at] for column in columns])

        begins = range(0, len(old["id"]), PIECE)
        last_ids = (int(table.ids[-1]) for table in tables(reversed(begins)) if len(table.ids))
        time, step = float(old["time"][k]), int(old["step"][k])
        return SnapshotRows(time, step, next(last_ids, self._first - 1), tables(begins))

    @property
    def _first(self) -> int:
        return int(self.rows_are == "points")

    def _prepare(self, root: Any, last: int) -> None:
        root.attrs["title"] = f"{self.rows_are} of a scene of karamelo-py"
        root.attrs["domain"] = np.array([self.hub.domain.lo, self.hub.domain.hi])
        rows = max(last, 1)
        for name, kind in (("time", float), ("step", np.int64)):
            root.create_dataset(name, (0,), kind, maxshape=(None,), chunks=(1024,))
        for name in ("id", "type"):
            root.create_dataset(name, (0,), np.int64, maxshape=(None,), chunks=(CHUNK,), **STORED)
        for name in ("time", "id"):
            root[name].make_scale(name)
        for name in self.columns:
            root.create_dataset(
                name,
                (0, 0),
                float,
                maxshape=(None, None),
                chunks=(1, min(rows, CHUNK)),
                fillvalue=np.nan,
                **STORED,
            )
        if units := self.hub.output.units:
            for name in ("time", *self.columns):
                root[name].attrs["units"] = units.of_column(name)
        for name in ("step", "type", *self.columns):
            scales = {"step": ["time"], "type": ["id"]}.get(name, ["time", "id"])
            for axis, scale in enumerate(scales):
                root[name].dims[axis].attach_scale(root[scale])

    def _append(self, root: Any, k: int, snapshot: SnapshotRows) -> None:
        first = self._first
        count = max(snapshot.last + 1 - first, len(root["id"]))
        if count > len(root["id"]):
            for name in ("id", "type"):
                root[name].resize((count,))
            for begin in range(0, count, PIECE):
                end = min(begin + PIECE, count)
                root["id"][begin:end] = np.arange(first + begin, first + end)
        for name, number in (("time", snapshot.time), ("step", snapshot.step)):
            root[name].resize((k + 1,))
            root[name][k] = number
        # Hold references: a garbage-collected array flushes its chunks, and hides errors.
        arrays = {name: root[name] for name in ("id", "type", *self.columns)}
        for name in self.columns:
            arrays[name].resize((k + 1, count))
        for table in snapshot.tables:
            at = table.ids - first
            # Blocks of fixed size make the bytes of the file independent of the size of the tables.
            for begin in range(0, count, PIECE):
                block, here = (
                    slice(begin, min(begin + PIECE, count)),
                    slice(*np.searchsorted(at, (begin, begin + PIECE))),
                )
                if here.start == here.stop:
                    continue
                rows = at[here] - begin
                types = arrays["type"][block]
                if (types[rows] != table.types[here]).any():
                    types[rows] = table.types[here]
                    arrays["type"][block] = types
                row = np.full(len(types), np.nan)
                for name, column in zip(self.columns, table.columns, strict=True):
                    row[rows] = column[here]
                    arrays[name][k, block] = row
        for array in arrays.values():
            array.flush()
        root.flush()


def _opened_to_append(path: Path) -> Any:
    """Open a file that stays readable if the program dies.

    A file left by a killed program can be opened with swmr=True if it was written in this mode from
    the start. Setting `h5py.File.swmr_mode` later has no such effect.
    """
    import h5py

    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    if hasattr(access, "set_file_locking"):
        access.set_file_locking(False, True)
    mode = h5py.h5f.ACC_RDWR | h5py.h5f.ACC_SWMR_WRITE
    return h5py.File(h5py.h5f.open(os.fsencode(path), mode, fapl=access))


class Hdf5(OfPoints, Hdf5Dump):
    """Write the material points to one compressed binary file, which h5py and xarray read.

    Each column is an array (snapshot, id), with NaN for deleted points. The file is readable after
    every snapshot. In ParaView, open the file of the same name with the ending ``.vtkhdf``, which
    refers to all snapshots.

    Notes
    -----
    In Python::

        points = xarray.open_dataset("points.h5", engine="h5netcdf")
        points.seq.sel(time=0.5, method="nearest").max()
        h5py.File("points.h5")["seq"][-1]

    If the program was killed while writing, open the file with ``h5py.File(name, swmr=True)``. If
    the disk was full, the file contains the snapshots that were complete.

    Example
    -------
    dump(d1, all, hdf5, 100, points.h5, x, y, z, vx, vy, vz, seq)

    See Also
    --------
    dump particle, dump grid/hdf5
    """

    def write(self) -> None:
        super().write()
        if self.path().suffix != ".vtkhdf":
            describe(self.path(), self.columns, self.hub.domain.dimension)


class GridHdf5(OfNodes, Hdf5Dump):
    """Write the nodes of the background grids to one compressed binary file.

    The format is the same as in dump hdf5.

    Parameters
    ----------
    occupied
        true: nodes without mass are NaN.

    Example
    -------
    dump(d2, all, grid/hdf5, 100, nodes.h5, vx, vy, mass, occupied=true)

    See Also
    --------
    dump grid, dump hdf5
    """
