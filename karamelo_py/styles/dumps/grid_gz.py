"""dump grid/gz: the nodes, as gzipped text."""

from karamelo_py.styles.dumps.grid import Grid
from karamelo_py.styles.dumps.lammps import Gzipped


class GridGz(Gzipped, Grid):
    """Write the nodes of the background grids in LAMMPS text format, gzipped.

    Everything else is as in dump grid.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``. The first and the last state of a run are
        always written.
    file
        File name, best with the ending ``.gz``. The first ``*`` becomes the step number; without
        ``*`` all snapshots follow each other in one file.
    columns
        What to write of each node, as in dump grid; ``x, y, z`` by default.
    occupied
        true: leave out nodes without mass.

    Example
    -------
    dump(d2, all, grid/gz, 100, dump_g.*.LAMMPS.gz, x, y, z, mass)

    See Also
    --------
    dump grid
    """
