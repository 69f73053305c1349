"""Dumps of tables: a row for each point or node, and the columns asked for."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.language.signature import OutputFile
from karamelo_py.output.fields import check_columns
from karamelo_py.output.rhythm import Every
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import Dump

POSITIONS = ("x", "y", "z")
# Written with every row, so asking for them again adds nothing. `tag` is Karamelo's second name of
# the id.
LEADING = ("id", "type", "tag")


class TableRows(NamedTuple):
    """Some rows, in the order of their ids: identities and types, (n,) whole numbers; columns."""

    ids: np.ndarray
    types: np.ndarray
    columns: list[np.ndarray]


class TableDump(Dump):
    """A dump of ``id type x y z`` and the columns asked for, in the form that `write` gives it.

    What the rows are is said by `OfPoints` or `OfNodes`, which stands in front of this class among
    the bases of a style.

    Attributes
    ----------
    absent
        Columns that are always 0.
    rows_are
        What a row is about.
    to_first
        Whether the first of several processes alone gets the tables, which all go through once.
    counts_rows
        Whether it asks for the extent before.
    """

    absent: Sequence[str] = ()
    rows_are = "points"
    to_first = False
    counts_rows = True

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        *columns: str,
    ):
        known = [*LEADING, *self.names(hub)]
        if str(file) in known:
            raise ScriptError(
                f"'{file}' is a column, not a file",
                argument="file",
                expected="the file name in front of the columns",
                hint=f"dump_*.LAMMPS, {file}",
            )
        check_columns(columns, known, first=2)
        wanted = [name for name in dict.fromkeys(columns) if name not in LEADING]
        # A viewer needs all three positions; where some are not asked for they come first.
        if not set(POSITIONS) <= set(wanted):
            wanted = [*POSITIONS, *(name for name in wanted if name not in POSITIONS)]
        super().__init__(hub, every, file, *wanted)
        self.warn_of_absent(columns, self.absent, self.rows_are)

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        """List names of the columns that can be written."""
        raise NotImplementedError

    def extent(self) -> tuple[int, int]:
        """Count number of rows, and the largest id."""
        raise NotImplementedError

    def tables(self) -> Iterator[TableRows]:
        """Give all rows in the order of their ids, in pieces whose columns fit into memory."""
        raise NotImplementedError

    def take_part(self) -> None:
        """Give the first of several processes the own rows, or do what it does."""
        if not self.to_first:
            super().take_part()
            return
        if self.counts_rows:
            self.extent()
        for _ in self.tables():
            pass

    def table(self) -> TableRows:
        """Give all rows."""
        ids, types, columns = zip(*self.tables(), strict=True)
        joined = (np.concatenate(same) for same in zip(*columns, strict=True))
        return TableRows(np.concatenate(ids), np.concatenate(types), list(joined))


class OfPoints:
    """Rows are the material points.

    Parameters
    ----------
    columns
        What to write of each point: x y z (position), x0 y0 z0 (first position), vx vy vz
        (velocity), s11 s22 s33 s12 s13 s23 (Cauchy stress), e11 ... e23 (strain), seq (von Mises
        stress), volume, mass and so on. ``x, y, z`` by default.
    """

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        """List names of the columns that can be written."""
        return hub.fields.particle_names()

    @property
    def absent(self) -> Sequence[str]:
        """Columns that are 0 because no point keeps them."""
        return self.hub.fields.absent_at_points()

    def extent(self) -> tuple[int, int]:
        """Count number of the points that there are, and the last of them."""
        present = self.hub.fields.present
        count = int(np.count_nonzero(present))
        return count, len(present) - int(present[::-1].argmax()) if count else 0

    def tables(self) -> Iterator[TableRows]:
        """Give number and solid of each point, and its columns."""
        for fields in self.hub.fields.pieces(to_first=self.to_first):
            ids, types = (fields.particle(name).astype(np.int64) for name in ("id", "type"))
            yield TableRows(ids, types, [fields.particle(name) for name in self.columns])


class OfNodes:
    """Rows are the nodes of the background grids, or with `occupied` those that have mass.

    Parameters
    ----------
    columns
        What to write of each node: x y z (position), vx vy vz (velocity), vx_update ... (velocity
        after the momentum update), fx fy fz (total force), mass, T where heat flows. ``x, y, z`` by
        default.
    occupied
        true: leave out nodes without mass, which makes the files of a large and sparsely filled
        domain small.
    """

    rows_are = "nodes"

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        *columns: str,
        occupied: bool = False,
    ):
        super().__init__(hub, every, file, *columns)
        self.occupied = occupied

    @property
    def absent(self) -> Sequence[str]:
        """Columns that are 0 in this scene."""
        return self.hub.fields.absent_at_nodes()

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        """List names of the columns that can be written."""
        return hub.fields.node_names()

    def extent(self) -> tuple[int, int]:
        """Count number of the nodes that are written, and the last of them."""
        fields = self.hub.fields
        return (
            fields.occupied_nodes if self.occupied else (fields.node_count, fields.node_count - 1)
        )

    def tables(self) -> Iterator[TableRows]:
        """Give number and grid of each node, and its columns."""
        for nodes in self.hub.fields.node_pieces(self.columns, to_first=self.to_first):
            rows = np.flatnonzero(nodes.node("mass") > 0) if self.occupied else slice(None)
            yield TableRows(
                *(nodes.node(name)[rows] for name in ("id", "type")),
                [nodes.node(name)[rows] for name in self.columns],
            )
