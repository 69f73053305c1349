"""dump vtk and grid/vtk: points or cells, for ParaView."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from karamelo_py.language.signature import OutputFile
from karamelo_py.output.files import whole
from karamelo_py.output.rhythm import Every
from karamelo_py.output.vtu import Vtu, arrays_of
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import boxes
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import POSITIONS, OfNodes, OfPoints, TableDump


class VtkDump(TableDump):
    """A dump as a series of VTU files, and a PVD file with the time of each.

    Parameters
    ----------
    file
        File name with a ``*``, which becomes the step number, and the ending ``.vtu``.
    """

    remembers = ("_series",)
    to_first, counts_rows = True, False

    def __init__(self, hub: Hub, every: Every, file: OutputFile, *columns: str):
        super().__init__(hub, every, file, *columns)
        if not self.one_file_per_step or self.file.suffix != ".vtu":
            stem = self.file.name.replace("*", "").partition(".")[0]
            message = f"{file} is not a name for a series of files"
            expected = "a file name with a * and the ending .vtu"
            hint = f"{stem or 'points'}.*.vtu"
            raise ScriptError(message, argument="file", expected=expected, hint=hint)
        if self.index.is_file() and b"VTKFile" not in self.index.read_bytes()[:200]:
            raise ScriptError(
                f"{self.index.name}, which would list the snapshots, exists and is not such a list",
                argument="file",
                expected="another name",
            )
        self._series: list[tuple[float, str]] = []

    @property
    def index(self) -> Path:
        stem = str(self.file)[: -len(".vtu")].replace("*", "", 1).rstrip("._-")
        return self.hub.folder / f"{stem}.pvd"

    def write(self) -> None:
        path = self.path()
        with whole(path) as file:
            names = [name for name in self.columns if name not in POSITIONS]
            arrays = arrays_of(names, self.hub.domain.dimension)
            vtu = Vtu(["id", "type", *names, *arrays], path.parent)
            kept: list[np.ndarray] = []
            for table in self.tables():
                columns = dict(zip(self.columns, table.columns, strict=True))
                x = np.column_stack([columns.pop(name) for name in POSITIONS])
                zero = np.zeros(len(x))
                vectors = [
                    np.column_stack([columns.get(name, zero) for name in components])
                    for components in arrays.values()
                ]
                vtu.add_points(x, [table.ids, table.types, *columns.values(), *vectors])
                self.connect(vtu, table.ids, kept)
            self.complete(vtu, kept)
            vtu.write(file)
        self._series.append((self.hub.update.time, path.name))
        rows = [f'<DataSet timestep="{t:.16g}" file={quoteattr(n)}/>\n' for t, n in self._series]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
        with whole(self.index) as file:
            file.write((head + "".join(rows) + "</Collection>\n</VTKFile>\n").encode())

    def connect(self, vtu: Vtu, ids: np.ndarray, kept: list[np.ndarray]) -> None:
        """Add the cells of the latest points to `vtu`, or append data for `complete` to `kept`."""

    def complete(self, vtu: Vtu, kept: list[np.ndarray]) -> None:
        """Add the cells that can only be made when all points are known."""


class Vtk(OfPoints, VtkDump):
    """Write the material points as a series of VTU files, which ParaView opens.

    Open the file of the same name with the ending ``.pvd``, which lists all snapshots. Velocity,
    force, stress and strain are also written as one array each if all components are requested, for
    ParaView's filters Glyph, Warp By Vector and Tensor Glyph.

    Example
    -------
    dump(d1, all, vtk, 100, points.*.vtu, vx, vy, vz, seq)

    See Also
    --------
    dump particle, dump grid/vtk
    """

    def connect(self, vtu: Vtu, ids: np.ndarray, kept: list[np.ndarray]) -> None:
        last = vtu.counts[0]
        vtu.add_cells("vertex", np.arange(last - len(ids), last)[:, None])


KINDS = {1: "line", 2: "quad", 3: "hexahedron"}
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


class GridVtk(OfNodes, VtkDump):
    """Write the background grids, with values at their nodes, as a series of VTU files.

    In ParaView open the file of the same name with the ending ``.pvd``.

    Parameters
    ----------
    occupied
        true: omit nodes without mass, and cells with such a node.

    Example
    -------
    dump(d2, all, grid/vtk, 100, grid.*.vtu, vx, vy, mass)

    See Also
    --------
    dump grid, dump vtk
    """

    def connect(self, vtu: Vtu, ids: np.ndarray, kept: list[np.ndarray]) -> None:
        if self.occupied:
            kept.append(ids)

    def complete(self, vtu: Vtu, kept: list[np.ndarray]) -> None:
        written = np.concatenate(kept) if kept else np.empty(0, np.int64)
        d = self.hub.domain.dimension
        for lattice in self.hub.lattices:
            last = [count - 2 for count in lattice.shape[:d]]
            steps = np.append(np.cumprod(lattice.shape[:0:-1])[::-1], 1)[:d]
            corners = np.array(CORNERS[: 2**d])[:, :d] @ steps
            for index in boxes([0] * d, last, 2**d):
                nodes = (lattice.first + index @ steps)[:, None] + corners
                if self.occupied:
                    rows = np.searchsorted(written[:-1], nodes)
                    nodes = (
                        rows[(written[rows] == nodes).all(axis=1)] if len(written) else nodes[:0]
                    )
                vtu.add_cells(KINDS[d], nodes)
