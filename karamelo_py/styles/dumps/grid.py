"""dump grid: the nodes, as text."""

from __future__ import annotations

from karamelo_py.styles.dumps.lammps import LammpsDump
from karamelo_py.styles.dumps.table import OfNodes


class Grid(OfNodes, LammpsDump):
    """Write the nodes of the background grids in LAMMPS text format, which OVITO opens.

    Each row begins with the node's number (``id``, from 0, z fastest, then y, then x) and the
    number of its grid (``type``, from 1). Positions are always written.

    With ulmpm and ulcpdi there is one grid. tlmpm and tlcpdi have one for each solid, in the order
    of the solids, which stays over the reference shape of its solid; ulmpm/contacts has the grid of
    the domain once for each velocity field, so that several rows have the same position. The nodes
    of all grids are written, those of the second after those of the first, with ids that go on.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``. The first and the last state of a run are
        always written.
    file
        File name. The first ``*`` becomes the step number; without ``*`` all snapshots follow each
        other in one file.
    columns
        What to write of each node: x y z (position), vx vy vz (velocity), vx_update ... (velocity
        after the momentum update), fx fy fz (total force), mass, T where heat flows. ``x, y, z`` by
        default.
    occupied
        true: leave out nodes without mass, which makes the files of a large and sparsely filled
        domain small.

    Example
    -------
    dump(d2, all, grid, 100, dump_g.*.LAMMPS, x, y, z, vx, vy, mass)
    """
