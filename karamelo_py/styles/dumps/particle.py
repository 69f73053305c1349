"""dump particle: the material points, as text."""

from karamelo_py.styles.dumps.lammps import LammpsDump
from karamelo_py.styles.dumps.table import OfPoints


class Particle(OfPoints, LammpsDump):
    """Write the material points in LAMMPS text format, which OVITO opens.

    Each row begins with the point's number (``id``, the same through the whole run) and the number
    of its solid (``type``, from 1). Positions are always written. The header carries the true step
    and, as ``ITEM: TIME``, the time.

    Example
    -------
    dump(d1, all, particle, 100, dump_p.*.LAMMPS, x, y, z, vx, vy, vz, s11, s22, s12)
    """
