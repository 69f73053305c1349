"""dump particle/gz: the material points, as gzipped text."""

from karamelo_py.styles.dumps.lammps import Gzipped
from karamelo_py.styles.dumps.particle import Particle


class ParticleGz(Gzipped, Particle):
    """Write the material points in LAMMPS text format, gzipped.

    A file has less than half the size, and OVITO
    opens it as it is.

    Everything else is as in dump particle.

    Example
    -------
    dump(d1, all, particle/gz, 100, dump_p.*.LAMMPS.gz, x, y, z, vx, vy, vz, seq)

    See Also
    --------
    dump particle
    """
