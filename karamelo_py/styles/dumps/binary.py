"""The LAMMPS binary format of dumps, which OVITO opens (LAMMPS manual, dump, second revision)."""

import struct
from collections.abc import Iterator

import numpy as np

MAGIC = b"DUMPCUSTOM"
ENDIAN, REVISION = 1, 2
# How the sides of the box are: shrink-wrapped, with a least extent.
SHRUNK, AT_LEAST = 2, 3


class Binary:
    """Mixed into a text dump: the same rows as numbers in double precision, little-endian.

    Parameters
    ----------
    file
        File name, best with the ending ``.bin``. The first ``*`` becomes the step number; without
        ``*`` all snapshots follow each other in one file.
    """

    def _snapshot(self) -> Iterator[bytes]:
        hub = self.hub
        domain, update = hub.domain, hub.update
        ids, types = self.ids()
        names = ["id", "type", *self.columns]
        rows = np.empty((len(ids), len(names)), "<f8")
        rows[:, 0], rows[:, 1] = ids, types
        for k, name in enumerate(self.columns, 2):
            rows[:, k] = self.field(name)
        bounds = []
        for axis in range(3):
            # A box of no thickness is degenerate to viewers, as in the text format.
            used = axis < domain.dimension
            bounds += (domain.lo[axis], domain.hi[axis]) if used else (-domain.h / 2, domain.h / 2)
        line = " ".join(names).encode("ascii")
        yield struct.pack("<q", -len(MAGIC)) + MAGIC + struct.pack("<ii", ENDIAN, REVISION)
        yield struct.pack("<qqi", update.step, len(ids), 0)  # 0: the box is not skewed
        yield struct.pack("<6i6d", *[SHRUNK, AT_LEAST] * 3, *bounds)
        yield struct.pack("<iibd", len(names), 0, 1, update.time)  # no units, but a time
        yield struct.pack("<i", len(line)) + line
        yield struct.pack("<ii", 1, rows.size)  # all in one piece
        yield rows.tobytes()
