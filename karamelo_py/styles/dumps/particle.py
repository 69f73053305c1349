"""dump particle: the material points, as text."""

from __future__ import annotations

from karamelo_py.styles.dumps.lammps import LammpsDump
from karamelo_py.styles.dumps.table import OfPoints


class Particle(OfPoints, LammpsDump):
    """Write the material points in LAMMPS text format, which OVITO opens.

    Each row begins with the point's number (``id``, the same through the whole run) and the number
    of its solid (``type``, from 1). Positions are always written. The header carries the true step
    and, as ``ITEM: TIME``, the time.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``. The first and the last state of a run are
        always written.
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
