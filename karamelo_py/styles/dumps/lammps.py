"""The LAMMPS text format of dumps, which OVITO, ParaView (by readers) and most scripts open."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import Annotated, Protocol

import numpy as np

from karamelo_py.kernels.text import rows
from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.files import continued, whole
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import Dump

POSITIONS = ("x", "y", "z")
# Written in front of every row, so asking for them again adds nothing. `tag` is Karamelo's second
# name of the id.
LEADING = ("id", "type", "tag")
# A third of the time of level 6 for 4 % more bytes.
COMPRESSION = 4


class Encoder(Protocol):
    """Turns text into the bytes of a file; the interface of ``zlib.compressobj``."""

    def compress(self, data: bytes) -> bytes:
        """Bytes that can be written now."""

    def flush(self) -> bytes:
        """The last bytes of the file."""

    def copy(self) -> Encoder:
        """An independent encoder in the same state."""


class Plain:
    """Leaves text as it is."""

    def compress(self, data: bytes) -> bytes:
        """The same bytes."""
        return data

    def flush(self) -> bytes:
        """Nothing is left."""
        return b""

    def copy(self) -> Plain:
        """Itself, as it has no state."""
        return self


class LammpsDump(Dump):
    """A dump in LAMMPS text format: ``id type x y z``, then the columns asked for.

    A style says which rows there are: `names` and `field`.

    Attributes
    ----------
    absent
        Columns that are always 0.
    rows_are
        What a row is about.
    """

    absent: Sequence[str] = ()
    rows_are = "points"

    def __init__(
        self,
        hub: Hub,
        every: Annotated[int, Positive],
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
        self.check_columns(columns, known, first=2)
        wanted = [name for name in dict.fromkeys(columns) if name not in LEADING]
        # A viewer needs all three positions; where some are not asked for they come first.
        if not set(POSITIONS) <= set(wanted):
            wanted = [*POSITIONS, *(name for name in wanted if name not in POSITIONS)]
        super().__init__(hub, every, file, *wanted)
        self.warn_of_absent(columns, self.absent, self.rows_are)
        # Of a file with all snapshots: where the next one goes, and the encoder's state there.
        self._end = 0
        self._encoder: Encoder | None = None

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        """Names of the columns that can be written."""
        raise NotImplementedError

    def ids(self) -> tuple[np.ndarray, np.ndarray]:
        """Integers (n,): identity and type of each row."""
        raise NotImplementedError

    def field(self, name: str) -> np.ndarray:
        """(n,) values of a column."""
        raise NotImplementedError

    def encoder(self) -> Encoder:
        """What the text goes through on its way to a new file."""
        return Plain()

    def write(self) -> None:
        """Write one snapshot: to a file of its own, or after those before it."""
        if self.one_file_per_step:
            encoder = self.encoder()
            with whole(self.path()) as file:
                for text in self._snapshot():
                    file.write(encoder.compress(text))
                file.write(encoder.flush())
            return
        # The file is whole after every snapshot: its last bytes are written each time and
        # overwritten by the next snapshot. (Compressed snapshots of their own one after another
        # would do for gunzip, but OVITO reads the first only.)
        start, before = self._end, self._encoder or self.encoder()
        encoder = before.copy()
        tail = before.copy().flush() if start else b""
        with continued(self.path(), start, tail) as file:
            for text in self._snapshot():
                file.write(encoder.compress(text))
            end = file.tell()
            file.write(encoder.copy().flush())
        self._end, self._encoder = end, encoder

    def _snapshot(self) -> Iterator[bytes]:
        """The text of the present state, piece by piece."""
        ids, types = self.ids()
        yield header(self.hub, len(ids), ["id", "type", *self.columns])
        yield from rows([ids, types, *(self.field(name) for name in self.columns)])


class Gzipped:
    """Mixed into a text dump: the same text, gzipped."""

    def encoder(self) -> Encoder:
        """A gzip stream without name and date, so that the same run gives the same bytes."""
        return zlib.compressobj(COMPRESSION, zlib.DEFLATED, 16 + zlib.MAX_WBITS)


def header(hub: Hub, count: int, names: Sequence[str]) -> bytes:
    """The lines above the rows of a snapshot."""
    domain = hub.domain
    bounds = []
    for axis in range(3):
        lo, hi = float(domain.lo[axis]), float(domain.hi[axis])
        if axis >= domain.dimension:
            # OVITO takes a box of no thickness for degenerate; one cell about zero is right for a
            # slice of unit width.
            lo, hi = -0.5 * domain.h, 0.5 * domain.h
        bounds.append(f"{lo:.10g} {hi:.10g}")
    lines = [
        "ITEM: TIMESTEP",
        str(hub.update.step),
        "ITEM: TIME",
        f"{hub.update.time:.16g}",
        "ITEM: NUMBER OF ATOMS",
        str(count),
        "ITEM: BOX BOUNDS sm sm sm",
        *bounds,
        "ITEM: ATOMS " + " ".join(names),
    ]
    return ("\n".join(lines) + "\n").encode("ascii")
