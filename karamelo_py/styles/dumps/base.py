"""Base of dumps; tables of points and of nodes."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.fields import check_columns
from karamelo_py.output.files import discarded, folder_of_discarded
from karamelo_py.output.log import begins_anew
from karamelo_py.output.revolve import revolved
from karamelo_py.output.rhythm import Every, Rhythmic
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


class Dump(Rhythmic):
    """Base of the dump styles: `write` is called when the dump is due.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``. The first and the last state of a run are
        always written.
    file
        File name. The first ``*`` becomes the step number; without ``*``, one file holds all
        snapshots.
    columns
        Content of the dump, interpreted by the style.
    """

    def __init__(self, hub: Hub, every: Every, file: OutputFile, *columns: str):
        self.hub = hub
        self.every = every
        self.file = Path(file)
        hub.output.check_file(self.file)
        self.columns = columns
        self.last_step: int | None = None

    @property
    def one_file_per_step(self) -> bool:
        return "*" in str(self.file)

    def path(self) -> Path:
        folder, file = folder_of_discarded(), self.file
        folder, file = (self.hub.folder, file) if folder is None else (folder, file.name)
        return folder / str(file).replace("*", str(self.hub.update.step), 1)

    def take_part(self) -> None:
        """Take part in the exchange of data on ranks other than 0, which write nothing."""
        with discarded():
            self.write()

    def warn_of_absence(self) -> None:
        self.hub.warn(begins_anew(self.path()), mark=self.mark)

    def warn_of_absent(self, columns: Sequence[str], absent: Sequence[str], owner: str) -> None:
        empty = [name for name in dict.fromkeys(columns) if name in absent]
        if empty:
            self.hub.warn(f"dump: {', '.join(empty)} will be 0: {owner} have no such field")


POSITIONS = ("x", "y", "z")
# Rows begin with these columns anyway. In Karamelo, `tag` is another name of the id.
LEADING = ("id", "type", "tag")


class TableRows(NamedTuple):
    ids: np.ndarray
    types: np.ndarray
    columns: list[np.ndarray]


class TableDump(Dump):
    """A dump of ``id type x y z`` and the requested columns; `write` determines the format.

    `OfPoints` or `OfNodes`, which must come first among the bases, defines the `names` of columns,
    the `absent` ones (always 0), the `extent` (number of rows, largest id), and `tables`, pieces of
    rows sorted by id that fit into memory.

    Attributes
    ----------
    to_first
        Whether only rank 0 gets the tables. All ranks must iterate over them once.
    counts_rows
        Whether `write` reads the extent first.
    """

    to_first = False
    counts_rows = True
    copies: int | None = None  # number of copies around the axis (`revolve`)

    def __init__(self, hub: Hub, every: Every, file: OutputFile, *columns: str):
        columns_available = [*LEADING, *self.names(hub)]
        if str(file) in columns_available:
            message = f"'{file}' is a column, not a file"
            expected = "the file name in front of the columns"
            hint = f"dump_*.LAMMPS, {file}"
            raise ScriptError(message, argument="file", expected=expected, hint=hint)
        check_columns(columns, columns_available, first=2)
        wanted = [name for name in dict.fromkeys(columns) if name not in LEADING]
        # Viewers need all three coordinates.
        if not set(POSITIONS) <= set(wanted):
            wanted = [*POSITIONS, *(name for name in wanted if name not in POSITIONS)]
        super().__init__(hub, every, file, *wanted)
        self.warn_of_absent(columns, self.absent, self.rows_are)

    def take_part(self) -> None:
        if not self.to_first:
            super().take_part()
            return
        if self.counts_rows:
            self.extent()
        for _ in self.tables():
            pass

    def table(self) -> TableRows:
        ids, types, columns = zip(*self.tables(), strict=True)
        joined = (np.concatenate(same) for same in zip(*columns, strict=True))
        return TableRows(np.concatenate(ids), np.concatenate(types), list(joined))


class OfPoints:
    """Rows are the material points.

    Parameters
    ----------
    columns
        Columns for each point: x y z (position, the default), x0 y0 z0 (initial position), vx vy vz
        (velocity), s11 s22 s33 s12 s13 s23 (Cauchy stress), e11 ... e23 (strain), seq (von Mises
        stress), p (pressure), rho (density), volume, mass and so on.
    revolve
        For axisymmetric scenes: write a 3D body, with this number of copies of each point around
        the axis. Positions, velocities, stress and strain are rotated to each copy. Under twist,
        they include the rotation about the axis.
    """

    rows_are = "points"

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        *columns: str,
        revolve: Annotated[int, Positive] | None = None,
    ):
        super().__init__(hub, every, file, *columns)
        self.copies = revolve
        if revolve is not None and not isinstance(hub.require_domain().kin, Axisymmetric):
            message = "only bodies of revolution in 2D have copies around an axis"
            expected = "axisymmetric(true) before this line, or no revolve"
            raise ScriptError(message, argument="revolve", expected=expected)

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        return hub.fields.particle_names()

    @property
    def absent(self) -> Sequence[str]:
        return self.hub.fields.absent_at_points()

    def extent(self) -> tuple[int, int]:
        present = self.hub.fields.present
        count, copies = int(np.count_nonzero(present)), self.copies or 1
        last = len(present) - int(present[::-1].argmax()) if count else 0
        return copies * count, last + (copies - 1) * len(present)

    def tables(self) -> Iterator[TableRows]:
        for fields in self.hub.fields.pieces(to_first=self.to_first):
            ids, types = (fields.particle(name).astype(np.int64) for name in ("id", "type"))
            copies = self.copies or 0
            if not copies:
                yield TableRows(ids, types, [fields.particle(name) for name in self.columns])
            for k in range(copies):
                columns = revolved(self.columns, fields.particle, 2 * np.pi * k / copies)
                yield TableRows(ids + k * len(self.hub.fields.present), types, columns)


class OfNodes:
    """Rows are the nodes of the background grids.

    Parameters
    ----------
    columns
        Columns for each node: x y z (position, the default), vx vy vz (velocity), vx_update ...
        (velocity after the momentum update), fx fy fz (total force), mass, T if heat flows.
    occupied
        true: omit nodes without mass, which makes files of sparsely filled domains small.
    """

    rows_are = "nodes"

    def __init__(
        self, hub: Hub, every: Every, file: OutputFile, *columns: str, occupied: bool = False
    ):
        super().__init__(hub, every, file, *columns)
        self.occupied = occupied

    @property
    def absent(self) -> Sequence[str]:
        return self.hub.fields.absent_at_nodes()

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        return hub.fields.node_names()

    def extent(self) -> tuple[int, int]:
        fields = self.hub.fields
        if self.occupied:
            return fields.occupied_nodes
        return fields.node_count, fields.node_count - 1

    def tables(self) -> Iterator[TableRows]:
        for nodes in self.hub.fields.node_pieces(self.columns, to_first=self.to_first):
            rows = np.flatnonzero(nodes.node("mass") > 0) if self.occupied else slice(None)
            yield TableRows(
                *(nodes.node(name)[rows] for name in ("id", "type")),
                [nodes.node(name)[rows] for name in self.columns],
            )
