"""dump grid/vtk: the cells of the grids as a series of files for ParaView."""

import numpy as np

from karamelo_py.styles.dumps.table import OfNodes
from karamelo_py.styles.dumps.vtk import VtkDump

KINDS = {1: "line", 2: "quad", 3: "hexahedron"}
# Corners of a cell in the order of VTK.
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


class GridVtk(OfNodes, VtkDump):
    """Write the background grids, with numbers at their nodes, as a series of VTU files.

    ParaView opens the file with the ending ``.pvd`` beside them, which lists all snapshots with
    their times.

    Parameters
    ----------
    occupied
        true: leave out nodes without mass, and cells that have such a node.

    Example
    -------
    dump(d2, all, grid/vtk, 100, grid.*.vtu, vx, vy, mass)

    See Also
    --------
    dump grid, dump vtk
    """

    def cells(self, ids: np.ndarray) -> list[tuple[str, np.ndarray]]:
        """Lines, squares or cubes between the nodes that are written."""
        row_of = np.full(self.hub.fields.node_count, -1)
        row_of[ids] = np.arange(len(ids))
        cells = []
        for lattice in self.hub.lattices:
            d = lattice.dimension
            number = lattice.first + np.arange(lattice.node_count).reshape(lattice.shape)
            corners = [
                number[
                    tuple(slice(c, n - 1 + c if k < d else n) for k, (c, n) in enumerate(axes))
                ].ravel()
                for axes in (zip(corner, lattice.shape, strict=True) for corner in CORNERS[: 2**d])
            ]
            rows = row_of[np.column_stack(corners)]
            cells.append(rows[(rows >= 0).all(axis=1)])
        return [(KINDS[self.hub.domain.dimension], np.concatenate(cells))]
