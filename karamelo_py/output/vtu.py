"""Unstructured grids in VTK's XML format, written in pieces (VTK File Formats, 2015).

A file stores one array after another, but rows arrive with all columns. Therefore compressed blocks
go to unnamed temporary files until the last row has arrived.
"""

import sys
import tempfile
import zlib
from base64 import b64encode
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

KINDS = {"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "hexahedron": 12}
TYPES = {np.dtype(np.float64): "Float64", np.dtype(np.int64): "Int64"}
BLOCK = 1 << 15  # bytes that are compressed together
COMPRESSION = 4  # 33 % of the time of level 6, for slightly larger files
IN_MEMORY = 1 << 16  # bytes of an array that stay in memory
PIECE = 3 << 16  # bytes that are encoded together, a multiple of 3, so that padding is not needed


ARRAYS = {
    "velocity": "vx vy vz", "force": "fx fy fz",
    "total stress": "t11 t22 t33 t12 t23 t13",
    "stress": "s11 s22 s33 s12 s23 s13", "strain": "e11 e22 e33 e12 e23 e13",
}  # fmt: skip


def arrays_of(names: Sequence[str], dimension: int) -> dict[str, list[str]]:
    """Return arrays by name, if `names` contains all their components that `dimension` has."""

    def vanishes(name: str) -> bool:
        axes = {"xyz123".index(axis) % 3 for axis in name[1:]}
        return max(axes) >= dimension and (len(axes) > 1 or name[1] in "yz")

    arrays = {array: columns.split() for array, columns in ARRAYS.items()}
    return {
        array: columns
        for array, columns in arrays.items()
        if columns[0] in names and all(name in names or vanishes(name) for name in columns)
    }


class Column:
    def __init__(self, name: str, folder: Path):
        self.name = name
        self._kind = ""
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY, dir=str(folder))  # noqa: SIM115
        self._sizes: list[int] = []
        self._rest = b""
        self._last = 0

    def add(self, rows: np.ndarray) -> None:
        components = f' NumberOfComponents="{rows.shape[1]}"' if rows.ndim == 2 else ""
        self._kind = f'type="{TYPES[rows.dtype]}" Name="{self.name}"{components}'
        self._rest += rows.tobytes()
        whole = len(self._rest) // BLOCK * BLOCK
        for begin in range(0, whole, BLOCK):
            self._pack(self._rest[begin : begin + BLOCK])
        self._rest = self._rest[whole:]

    def _pack(self, block: bytes) -> None:
        packed = zlib.compress(block, COMPRESSION)
        self._sizes.append(len(packed))
        self._last = len(block)
        self._file.write(packed)

    def write(self, out: BinaryIO) -> None:
        if self._rest:
            self._pack(self._rest)
        head = [len(self._sizes), BLOCK, self._last % BLOCK, *self._sizes]
        out.write(f'<DataArray {self._kind} format="binary">'.encode())
        out.write(b64encode(np.array(head, np.uint32).tobytes()))
        self._file.seek(0)
        while piece := self._file.read(PIECE):
            out.write(b64encode(piece))
        out.write(b"</DataArray>")
        self._file.close()


class Vtu:
    """A file of points, with columns `names`, and of cells.

    The temporary files in `folder` are as large as the file together.
    """

    def __init__(self, names: Iterable[str], folder: Path):
        self.points = Column("Points", folder)
        self.columns = [Column(name, folder) for name in names]
        self.cells = [Column(name, folder) for name in ("connectivity", "offsets", "types")]
        self.counts = [0, 0]

    def add_points(self, x: np.ndarray, columns: Iterable[np.ndarray]) -> None:
        self.points.add(np.ascontiguousarray(x, float))
        for column, rows in zip(self.columns, columns, strict=True):
            column.add(rows)
        self.counts[0] += len(x)

    def add_cells(self, kind: str, corners: np.ndarray) -> None:
        count, each = corners.shape
        ends = each * np.arange(self.counts[1] + 1, self.counts[1] + count + 1, dtype=np.int64)
        arrays = corners.ravel(), ends, np.full(count, KINDS[kind], np.int64)
        for column, rows in zip(self.cells, arrays, strict=True):
            column.add(rows)
        self.counts[1] += count

    def write(self, out: BinaryIO) -> None:
        points, cells = self.counts
        out.write(
            f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
            f'byte_order="{sys.byteorder.capitalize()}Endian" compressor="vtkZLibDataCompressor">'
            f'<UnstructuredGrid><Piece NumberOfPoints="{points}" NumberOfCells="{cells}">'.encode()
        )
        groups = {"Points": [self.points], "Cells": self.cells, "PointData": self.columns}
        for name, arrays in groups.items():
            out.write(f"<{name}>".encode())
            for array in arrays:
                array.write(out)
            out.write(f"</{name}>".encode())
        out.write(b"</Piece></UnstructuredGrid></VTKFile>\n")
