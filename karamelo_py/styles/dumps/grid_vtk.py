"""dump grid/vtk: the cells of the grids as a series of files for ParaView."""

import numpy as np

from karamelo_py.output.vtu import Vtu
from karamelo_py.scene.lattice import boxes
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

    def connect(self, vtu: Vtu, ids: np.ndarray, kept: list[np.ndarray]) -> None:
        """Keep the numbers of nodes that are written, where others are not."""
        if self.occupied:
            kept.append(ids)

    def complete(self, vtu: Vtu, kept: list[np.ndarray]) -> None:
        """Add lines, squares or cubes between the nodes that are written."""
        there = np.concatenate(kept) if kept else np.empty(0, np.int64)
        d = self.hub.domain.dimension
        for lattice in self.hub.lattices:
            last = [count - 2 for count in lattice.shape[:d]]
            steps = np.append(np.cumprod(lattice.shape[:0:-1])[::-1], 1)[:d]
            corners = np.array(CORNERS[: 2**d])[:, :d] @ steps
            for index in boxes([0] * d, last, 2**d):
                nodes = (lattice.first + index @ steps)[:, None] + corners
                if self.occupied:
                    rows = np.searchsorted(there[:-1], nodes)
                    nodes = rows[(there[rows] == nodes).all(axis=1)] if len(there) else nodes[:0]
                vtu.add_cells(KINDS[d], nodes)
