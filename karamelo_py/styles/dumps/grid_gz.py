"""dump grid/gz: the nodes, as gzipped text."""

from karamelo_py.styles.dumps.grid import GridDump
from karamelo_py.styles.dumps.lammps import Gzipped


class GridGz(Gzipped, GridDump):
    """Write the nodes of the background grids in LAMMPS text format, gzipped.

    Everything else is as in dump grid.

    Example
    -------
    dump(d2, all, grid/gz, 100, dump_g.*.LAMMPS.gz, x, y, z, mass)

    See Also
    --------
    dump grid
    """
