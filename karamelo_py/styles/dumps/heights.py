"""Dump style heights: a deposit as a raster."""

from typing import Annotated, Literal

import numpy as np

from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.files import whole
from karamelo_py.output.rhythm import Every
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.terrain import NO_DATA
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import Dump


class HeightsDump(Dump):
    """Write the depth or the surface of a deposit as a raster (ESRI ASCII grid).

    Parameters
    ----------
    file
        File name with a ``*``, which becomes the step number; each snapshot is a separate file.
    cell
        Cell size of the raster: at least twice the point spacing, otherwise cells inside the
        deposit are empty.
    of
        ``depth``: volume of the points in a cell / area of the cell. ``top``: height of the
        upper face of the highest point in a cell; -9999 (NODATA) in empty cells.

    Example
    -------
    dump(d1, all, heights, 100, deposit.*.asc, 0.1)
    dump(d2, all, heights, 100, surface.*.asc, 0.1, top)

    Notes
    -----
    The raster covers the domain; in 2D it has one row. The sum of depth times cell area is the
    volume of the points. QGIS, ArcGIS, GDAL and region heights read the files.

    See Also
    --------
    region heights, dump particle
    """

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        cell: Annotated[float, Positive],
        of: Literal["depth", "top"] = "depth",
    ):
        super().__init__(hub, every, file)
        if not self.one_file_per_step:
            message, expected = "a raster has one snapshot", f"a name with *, such as d.*.{file}"
            raise ScriptError(message, argument="file", expected=expected)
        if hub.require_domain().dimension == 1:
            raise ScriptError(
                "heights need a horizontal direction", expected="dimension(2 or 3, ...)"
            )
        self.cell, self.of = cell, of

    def write(self) -> None:
        domain, d = self.hub.domain, self.hub.domain.dimension
        lo, hi = domain.lo[: d - 1], domain.hi[: d - 1]
        shape = np.maximum(np.ceil((hi - lo) / self.cell * (1 - 1e-9)), 1).astype(int)
        values = np.full(shape.prod(), 0.0 if self.of == "depth" else NO_DATA)
        for points in self.hub.fields.pieces(to_first=True):
            x, volume = points.position[points.present], points.particle("volume")
            cells = np.clip(((x[:, : d - 1] - lo) / self.cell).astype(int), 0, shape - 1)
            number = np.ravel_multi_index(tuple(cells.T), tuple(shape))
            if self.of == "depth":
                np.add.at(values, number, volume / self.cell ** (d - 1))
            else:
                np.maximum.at(values, number, x[:, d - 1] + volume ** (1 / d) / 2)
        rows = values.reshape(shape[0], -1).T[::-1]
        head = {"ncols": rows.shape[1], "nrows": rows.shape[0], "xllcorner": repr(float(lo[0])),
                "yllcorner": repr(float(lo[1])) if d == 3 else 0, "cellsize": repr(self.cell),
                "NODATA_value": int(NO_DATA)}  # fmt: skip
        lines = [f"{name} {value}" for name, value in head.items()]
        lines += [" ".join(map(repr, row)) for row in rows.tolist()]
        with whole(self.path()) as out:
            out.write(("\n".join(lines) + "\n").encode("ascii"))
