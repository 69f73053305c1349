"""Fix displacement: displacements since a construction stage."""

from typing import Any

import numpy as np

from karamelo_py.compiler.fields import Field, vector
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import InitialFix, PointsView


class EarlierDisplacement(Field):
    """Displacement at the stage from which it is measured."""

    shape = vector
    columns = ("ux", "uy", "uz")

    @staticmethod
    def position(kin: Any) -> int | None:
        return 0

    @staticmethod
    def shown(values: np.ndarray, table: PointTable) -> np.ndarray:
        return table.position - table.reference_position - values


class Displacement(InitialFix):
    """Measure displacements from the positions at the next step, such as the state under gravity.

    Example
    -------
    fix(u, displacement, all)

    Notes
    -----
    The columns ux, uy, uz of these points are then relative to those positions. To measure from a
    later stage, delete the fix (delete_fix) and define it again. Displacements of other points, and
    of points that enter later, are measured from the initial position.

    See Also
    --------
    fix geostatic_stress, deactivate, compute probe
    """

    point_fields = (EarlierDisplacement,)

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)

    def initial_integrate(self, points: PointsView) -> None:
        points[EarlierDisplacement] = points.position - points.reference_position
