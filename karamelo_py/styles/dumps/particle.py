"""dump particle: the material points, as text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from karamelo_py.scene.hub import Hub
from karamelo_py.styles.dumps.lammps import LammpsDump


class Particle(LammpsDump):
    """Write the material points in LAMMPS text format, which OVITO opens.

    Each row begins with the point's number (``id``, the same through the whole run) and the number
    of its solid (``type``, from 1). Positions are always written. The header carries the true step
    and, as ``ITEM: TIME``, the time.

    Parameters
    ----------
    every
        Steps between two snapshots. The first and the last state of a run are always written.
    file
        File name. The first ``*`` becomes the step number; without ``*`` all snapshots follow each
        other in one file.
    columns
        What to write of each point: x y z (position), x0 y0 z0 (first position), vx vy vz
        (velocity), s11 s22 s33 s12 s13 s23 (Cauchy stress), e11 ... e23 (strain), seq (von Mises
        stress), volume, mass and so on. ``x, y, z`` by default.

    Example
    -------
    dump(d1, all, particle, 100, dump_p.*.LAMMPS, x, y, z, vx, vy, vz, s11, s22, s12)
    """

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        """Names of the columns that can be written."""
        return hub.fields.particle_names()

    @property
    def absent(self) -> Sequence[str]:
        """Columns that are 0 because no point keeps them."""
        return self.hub.fields.absent_at_points()

    def ids(self) -> tuple[np.ndarray, np.ndarray]:
        """Number and solid of each point."""
        fields = self.hub.fields
        return _integers(fields.particle("id")), _integers(fields.particle("type"))

    def field(self, name: str) -> np.ndarray:
        """(N,) values of a particle field."""
        return self.hub.fields.particle(name)


def _integers(values: np.ndarray) -> np.ndarray:
    return values.astype(np.int64, copy=False)
