"""The LAMMPS text format of dumps, which OVITO, ParaView (by readers) and most scripts open."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Protocol

from karamelo_py.kernels.text import rows
from karamelo_py.output.files import continued, whole
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.dumps.table import TableDump

# A third of the time of level 6 for 4 % more bytes.
COMPRESSION = 4
PIECE = 1 << 20  # bytes


class Encoder(Protocol):
    """Turns text into the bytes of a file; the interface of ``zlib.compressobj``."""

    def compress(self, data: bytes) -> bytes:
        """Return bytes that can be written now."""

    def flush(self) -> bytes:
        """Return the last bytes of the file."""

    def copy(self) -> Encoder:
        """Make an independent encoder in the same state."""


class Plain:
    """Leaves text as it is."""

    def compress(self, data: bytes) -> bytes:
        """Return the same bytes."""
        return data

    def flush(self) -> bytes:
        """Nothing is left."""
        return b""

    def copy(self) -> Plain:
        """Itself, as it has no state."""
        return self


class LammpsDump(TableDump):
    """A dump in LAMMPS text format."""

    # Of a file with all snapshots: where the next one goes, how much text there is up to there, and
    # the encoder's state.
    remembers = ("_end", "_length")
    to_first = True
    _end = 0
    _length = 0
    _encoder: Encoder | None = None

    def encoder(self) -> Encoder:
        """Make the encoder of the text of a new file."""
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
        length = self._length
        with continued(self.path(), start, tail) as file:
            for text in self._snapshot():
                length += len(text)
                file.write(encoder.compress(text))
            end = file.tell()
            file.write(encoder.copy().flush())
        self._end, self._length, self._encoder = end, length, encoder

    def resumed(self) -> None:
        """Go on in the file of an earlier run, behind what was its last snapshot then."""
        if self._end == 0:
            return
        path = self.path()
        if not path.is_file() or path.stat().st_size < self._end:
            self.begin_anew()
            return
        # What an encoder has kept for the bytes to come is not in the file, but follows from it.
        self._encoder = self.encoder()
        with self.opened(path) as file:
            for begin in range(0, self._length, PIECE):
                self._encoder.compress(file.read(min(PIECE, self._length - begin)))

    def begin_anew(self) -> None:
        """Begin a new file: that of the earlier run is not there."""
        self.warn_of_absence()
        self._end = self._length = 0

    @staticmethod
    def opened(path: Path) -> BinaryIO:
        """Open the text of a file."""
        return path.open("rb")

    def _snapshot(self) -> Iterator[bytes]:
        """Write the text of the present state, piece by piece."""
        yield header(self.hub, self.extent()[0], ["id", "type", *self.columns])
        for ids, types, columns in self.tables():
            yield from rows([ids, types, *columns])


class Gzipped:
    """Mixed into a text dump: the same text, gzipped.

    Parameters
    ----------
    file
        File name, best with the ending ``.gz``. The first ``*`` becomes the step number; without
        ``*`` all snapshots follow each other in one file.
    """

    def encoder(self) -> Encoder:
        """Make a gzip stream without name and date, so that the same run gives the same bytes."""
        return zlib.compressobj(COMPRESSION, zlib.DEFLATED, 16 + zlib.MAX_WBITS)

    @staticmethod
    def opened(path: Path) -> BinaryIO:
        """Open the text of a file."""
        return gzip.open(path)


def bounds(domain: Domain) -> list[tuple[float, float]]:
    """List the ends of the box along each axis.

    OVITO takes a box of no thickness for degenerate; one cell about zero is right for a slice of
    unit width.
    """
    ends = zip(domain.lo.tolist(), domain.hi.tolist(), strict=True)
    return [*ends][: domain.dimension] + [(-0.5 * domain.h, 0.5 * domain.h)] * (
        3 - domain.dimension
    )


def header(hub: Hub, count: int, names: Sequence[str]) -> bytes:
    """Write the lines above the rows of a snapshot."""
    units = hub.output.units
    lines = [
        *(["ITEM: UNITS", str(units)] if units else []),
        "ITEM: TIMESTEP",
        str(hub.update.step),
        "ITEM: TIME",
        f"{hub.update.time:.16g}",
        "ITEM: NUMBER OF ATOMS",
        str(count),
        "ITEM: BOX BOUNDS sm sm sm",
        *(f"{lo:.10g} {hi:.10g}" for lo, hi in bounds(hub.domain)),
        "ITEM: ATOMS " + " ".join(names),
    ]
    return ("\n".join(lines) + "\n").encode("ascii")
