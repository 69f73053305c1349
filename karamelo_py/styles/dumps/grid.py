"""dump grid: the nodes, as text."""

from karamelo_py.styles.dumps.lammps import LammpsDump
from karamelo_py.styles.dumps.table import OfNodes


class GridDump(OfNodes, LammpsDump):
    """Write the nodes of the background grids in LAMMPS text format, which OVITO opens.

    Each row begins with the node's number (``id``, from 0, z fastest, then y, then x) and the
    number of its grid (``type``, from 1). Positions are always written.

    With ulmpm and ulcpdi there is one grid. tlmpm and tlcpdi have one for each solid, in the order
    of the solids, which stays over the reference shape of its solid; ulmpm/contacts has the grid of
    the domain once for each velocity field, so that several rows have the same position. The nodes
    of all grids are written, those of the second after those of the first, with ids that go on.

    Example
    -------
    dump(d2, all, grid, 100, dump_g.*.LAMMPS, x, y, z, vx, vy, mass)
    """
