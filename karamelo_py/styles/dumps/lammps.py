"""dump particle, grid and variants: formats of LAMMPS."""

import gzip
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.files import continued, whole
from karamelo_py.output.rhythm import Every
from karamelo_py.output.text import rows
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.dumps.base import OfNodes, OfPoints, TableDump

# Level 4 takes 33 % of the time of level 6 (zlib's default) and gives 4 % more bytes.
COMPRESSION = 4
PIECE = 1 << 20
# First bytes of the binary format (LAMMPS manual, dump, second revision).
MAGIC = b"DUMPCUSTOM"
ENDIAN, REVISION = 1, 2
ELEMENT = "element"
# Style of the box sides: shrink-wrapped, with a minimum extent.
SHRUNK, AT_LEAST = 2, 3


class Plain:
    """The interface of ``zlib.compressobj`` without compression."""

    def compress(self, data: bytes) -> bytes:
        return data

    def flush(self) -> bytes:
        return b""

    def copy(self) -> Any:
        return self


class LammpsDump(TableDump):
    # For one file with all snapshots: position of the next snapshot, and length of all text.
    remembers = ("_end", "_length")
    to_first = True
    _end = 0
    _length = 0
    _encoder: Any = None
    named = False  # True: the format with the column ELEMENT
    encoder: Any = Plain
    opened: Any = staticmethod(partial(open, mode="rb"))

    def write(self) -> None:
        if self.one_file_per_step:
            encoder = self.encoder()
            with whole(self.path()) as file:
                for text in self._snapshot():
                    file.write(encoder.compress(text))
                file.write(encoder.flush())
            return
        # The last bytes close the file, so that it is complete; the next snapshot overwrites them.
        # (OVITO reads only the first of separately compressed snapshots.)
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
        if self._end == 0:
            return
        path = self.path()
        if not path.is_file() or path.stat().st_size < self._end:
            self.warn_of_absence()
            self._end = self._length = 0
            return
        # The file does not contain the state of the encoder; encoding the text again restores it.
        self._encoder = self.encoder()
        with self.opened(path) as file:
            for begin in range(0, self._length, PIECE):
                self._encoder.compress(file.read(min(PIECE, self._length - begin)))

    def box(self) -> list[tuple[float, float]]:
        ends = box(self.hub)
        around = (-ends[0][1], ends[0][1])
        return [around, ends[1], around] if self.copies else ends

    def _snapshot(self) -> Iterator[bytes]:
        update, units = self.hub.update, self.hub.output.units
        ends = ["pp" if k in self.hub.domain.periodic else "sm" for k in range(3)]
        lines = [
            *(["ITEM: UNITS", str(units)] if units else []),
            "ITEM: TIME",  # read_dump of LAMMPS expects the time first
            f"{update.time:.16g}",
            "ITEM: TIMESTEP",
            str(update.step),
            "ITEM: NUMBER OF ATOMS",
            str(self.extent()[0]),
            f"ITEM: BOX BOUNDS {' '.join(ends)}",
            *(f"{lo:.10g} {hi:.10g}" for lo, hi in self.box()),
            "ITEM: ATOMS " + " ".join(["id", "type", *self.columns, *[ELEMENT] * self.named]),
        ]
        yield ("\n".join(lines) + "\n").encode("ascii")
        names = list(self.hub.solids)
        for ids, types, columns in self.tables():
            if not self.named:
                yield from rows([ids, types, *columns])
                continue
            for begin, end in pairwise([0, *np.flatnonzero(np.diff(types)) + 1, len(types)]):
                name = b" %s\n" % names[types[begin] - 1].encode() if end > begin else b""
                for text in rows([column[begin:end] for column in (ids, types, *columns)]):
                    yield text.replace(b"\n", name)


def box(hub: Hub) -> list[tuple[float, float]]:
    """Return the bounds of the domain along three axes; OVITO refuses a box of zero thickness."""
    domain = hub.domain
    used = slice(domain.dimension)
    thin = [(-0.5 * domain.h, 0.5 * domain.h)] * (3 - domain.dimension)
    return [*zip(domain.lo[used].tolist(), domain.hi[used].tolist(), strict=True), *thin]


class Gzipped:
    """Mix-in for text dumps: the same text, gzipped.

    Parameters
    ----------
    file
        File name, preferably with the ending ``.gz``; a ``*`` works as in dump particle.
    """

    def encoder(self) -> Any:
        """Return a gzip encoder without name and date, for reproducible bytes."""
        return zlib.compressobj(COMPRESSION, zlib.DEFLATED, 16 + zlib.MAX_WBITS)

    opened = staticmethod(gzip.open)


class BinaryRows:
    """Mix-in for text dumps: the same rows as little-endian double-precision numbers.

    Parameters
    ----------
    file
        File name, preferably with the ending ``.bin``; a ``*`` works as in dump particle.
    """

    def _snapshot(self) -> Iterator[bytes]:
        update = self.hub.update
        count, names = self.extent()[0], ["id", "type", *self.columns]
        line = " ".join(names).encode("ascii")
        yield struct.pack("<q", -len(MAGIC)) + MAGIC + struct.pack("<ii", ENDIAN, REVISION)
        yield struct.pack("<qqi", update.step, count, 0)  # 0: the box is not skewed
        yield struct.pack("<6i6d", *[SHRUNK, AT_LEAST] * 3, *np.ravel(self.box()))
        yield struct.pack("<iibd", len(names), 0, 1, update.time)  # no units, but a time
        yield struct.pack("<i", len(line)) + line
        yield struct.pack("<ii", 1, count * len(names))
        for ids, types, columns in self.tables():
            yield np.column_stack([ids, types, *columns]).astype("<f8", copy=False).tobytes()


class Particle(OfPoints, LammpsDump):
    """Write the material points in LAMMPS text format, which OVITO opens.

    Each row begins with the point's number (``id``, constant during the run) and the number of its
    solid (``type``, from 1). Positions are always written. The header contains the step, and the
    time as ``ITEM: TIME``. The column ``element`` is the name of the solid, OVITO's particle type.

    Example
    -------
    dump(d1, all, particle, 100, dump_p.*.LAMMPS, x, y, z, vx, vy, vz, s11, s22, s12)
    dump(d2, all, particle, 100, named.*.LAMMPS, seq, element)
    """

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        *columns: str,
        revolve: Annotated[int, Positive] | None = None,
    ):
        super().__init__(hub, every, file, *columns, revolve=revolve)
        self.named = ELEMENT in self.columns
        self.columns = tuple(name for name in self.columns if name != ELEMENT)

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        return [*OfPoints.names(hub), ELEMENT]


class GridDump(OfNodes, LammpsDump):
    """Write the nodes of the background grids in LAMMPS text format, which OVITO opens.

    Each row begins with the node's number (``id``, from 0, z fastest, then y, then x) and the
    number of its grid (``type``, from 1). Positions are always written.

    Methods ulmpm and ulcpdi have one grid; tlmpm and tlcpdi have one for each solid, over its
    reference shape; ulmpm/contacts has one for each velocity field, so several rows have the same
    position. Nodes are numbered consecutively over all grids.

    Example
    -------
    dump(d2, all, grid, 100, dump_g.*.LAMMPS, x, y, z, vx, vy, mass)
    """


class ParticleGz(Gzipped, Particle):
    """Write the material points in LAMMPS text format, gzipped, which OVITO opens directly.

    Files are less than half as large, but otherwise the same as in dump particle.

    Example
    -------
    dump(d1, all, particle/gz, 100, dump_p.*.LAMMPS.gz, x, y, z, vx, vy, vz, seq)

    See Also
    --------
    dump particle
    """


class GridGz(Gzipped, GridDump):
    """Write the nodes of the background grids in LAMMPS text format, gzipped.

    Except for the compression, the file is the same as in dump grid.

    Example
    -------
    dump(d2, all, grid/gz, 100, dump_g.*.LAMMPS.gz, x, y, z, mass)

    See Also
    --------
    dump grid
    """


class ParticleBin(BinaryRows, Particle):
    """Write the material points in the binary format of LAMMPS, which OVITO opens.

    Numbers have full precision, and are faster to write than text; the rest is as in dump particle.

    Example
    -------
    dump(d1, all, particle/bin, 100, dump_particle.*.bin, x, y, z, vx, vy)

    See Also
    --------
    dump particle, dump particle/gz
    """

    names = staticmethod(OfPoints.names)


class GridBin(BinaryRows, GridDump):
    """Write the nodes of the background grid in the binary format of LAMMPS, which OVITO opens.

    Numbers have full precision, and are faster to write than text; the rest is as in dump grid.

    Example
    -------
    dump(d1, all, grid/bin, 100, dump_grid.*.bin, x, y, z, vx, vy)

    See Also
    --------
    dump grid, dump grid/gz
    """
