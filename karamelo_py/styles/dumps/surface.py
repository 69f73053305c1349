"""Dump surface/vtk: moving surfaces, for ParaView."""

from collections.abc import Iterator, Sequence

import numpy as np

from karamelo_py.language.signature import OutputFile
from karamelo_py.output.rhythm import Every
from karamelo_py.output.vtu import Vtu
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import POSITIONS, TableRows
from karamelo_py.styles.dumps.vtk import VtkDump

KINDS = "vertex", "line", "triangle"


class SurfaceVtk(VtkDump):
    """Write the triangulated surfaces of rigid bodies and tools as a series of VTU files, in 3D.

    In ParaView open the file of the same name with the ending ``.pvd``. `type` numbers the surfaces
    in the order of their fixes.

    Example
    -------
    dump(d3, all, surface/vtk, 100, hull.*.vtu)

    Notes
    -----
    Only surfaces from files are written: regions stl or mesh that are filled by a body of fix
    rigid_body, or given in contact/rigid_body(region=...) or fix contact/surface.

    See Also
    --------
    dump vtk, fix rigid_body, region stl
    """

    rows_are, absent = "surfaces", ()

    def __init__(self, hub: Hub, every: Every, file: OutputFile):
        super().__init__(hub, every, file)
        if not _with_faces(hub):
            raise ScriptError(
                "no rigid body and no contact/surface has a surface from a file",
                expected="fix rigid_body of a solid in a region stl or mesh, before the dump",
            )

    @staticmethod
    def names(hub: Hub) -> Sequence[str]:
        return POSITIONS

    def tables(self) -> Iterator[TableRows]:
        d, first = self.hub.domain.dimension, 1
        for number, faces in enumerate(_with_faces(self.hub), 1):
            x = np.zeros((faces.shape[0] * d, 3))
            x[:, :d] = faces.reshape(-1, d)
            ids = np.arange(first, first + len(x))
            first += len(x)
            yield TableRows(ids, np.full(len(x), number), list(x.T))

    def connect(self, vtu: Vtu, ids: np.ndarray, kept: list[np.ndarray]) -> None:
        d, last = self.hub.domain.dimension, vtu.counts[0]
        vtu.add_cells(KINDS[d - 1], np.arange(last - len(ids), last).reshape(-1, d))


def _with_faces(hub: Hub) -> list[np.ndarray]:
    fixes: list[Fix] = [fix for fix in hub.fixes.values() if fix.faces_of is not None]
    return [faces for fix in fixes if (faces := fix.faces_of()) is not None]
