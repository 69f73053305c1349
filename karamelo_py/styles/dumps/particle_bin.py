"""dump particle/bin: the material points, as binary numbers."""

from karamelo_py.styles.dumps.binary import BinaryRows
from karamelo_py.styles.dumps.particle import Particle


class ParticleBin(BinaryRows, Particle):
    """Write the material points in the binary format of LAMMPS, which OVITO opens.

    Numbers keep all their digits, and files are written faster than text. Everything else is as in
    dump particle.

    Example
    -------
    dump(d1, all, particle/bin, 100, dump_particle.*.bin, x, y, z, vx, vy)

    See Also
    --------
    dump particle, dump particle/gz
    """
