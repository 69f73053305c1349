"""The LAMMPS binary format of dumps, which OVITO opens (LAMMPS manual, dump, second revision)."""

import struct
from collections.abc import Iterator
from itertools import chain

import numpy as np

from karamelo_py.styles.dumps.lammps import bounds

MAGIC = b"DUMPCUSTOM"
ENDIAN, REVISION = 1, 2
# How the sides of the box are: shrink-wrapped, with a least extent.
SHRUNK, AT_LEAST = 2, 3


class BinaryRows:
    """Mixed into a text dump: the same rows as numbers in double precision, little-endian.

    Parameters
    ----------
    file
        File name, best with the ending ``.bin``. The first ``*`` becomes the step number; without
        ``*`` all snapshots follow each other in one file.
    """

    def _snapshot(self) -> Iterator[bytes]:
        update = self.hub.update
        count, names = self.extent()[0], ["id", "type", *self.columns]
        line = " ".join(names).encode("ascii")
        yield struct.pack("<q", -len(MAGIC)) + MAGIC + struct.pack("<ii", ENDIAN, REVISION)
        yield struct.pack("<qqi", update.step, count, 0)  # 0: the box is not skewed
        yield struct.pack("<6i6d", *[SHRUNK, AT_LEAST] * 3, *chain(*bounds(self.hub.domain)))
        yield struct.pack("<iibd", len(names), 0, 1, update.time)  # no units, but a time
        yield struct.pack("<i", len(line)) + line
        yield struct.pack("<ii", 1, count * len(names))  # all in one piece
        for ids, types, columns in self.tables():
            yield np.column_stack([ids, types, *columns]).astype("<f8", copy=False).tobytes()
