"""dump grid/bin: the nodes of the grid, as binary numbers."""

from karamelo_py.styles.dumps.binary import BinaryRows
from karamelo_py.styles.dumps.grid import GridDump


class GridBin(BinaryRows, GridDump):
    """Write the nodes of the background grid in the binary format of LAMMPS, which OVITO opens.

    Numbers keep all their digits, and files are written faster than text. Everything else is as in
    dump grid.

    Example
    -------
    dump(d1, all, grid/bin, 100, dump_grid.*.bin, x, y, z, vx, vy)

    See Also
    --------
    dump grid, dump grid/gz
    """
