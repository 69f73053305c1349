"""dump grid/hdf5: the nodes in one binary file, as arrays over time and id."""

from karamelo_py.styles.dumps.hdf5 import Hdf5Dump
from karamelo_py.styles.dumps.table import OfNodes


class GridHdf5(OfNodes, Hdf5Dump):
    """Write the nodes of the background grids to one compressed binary file.

    Everything else is as in dump hdf5.

    Parameters
    ----------
    occupied
        true: nodes without mass are NaN.

    Example
    -------
    dump(d2, all, grid/hdf5, 100, nodes.h5, vx, vy, mass, occupied=true)

    See Also
    --------
    dump grid, dump hdf5
    """
