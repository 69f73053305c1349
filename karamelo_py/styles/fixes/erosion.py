"""Erosion of points that meet a condition."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.output.fields import ColumnFormula
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.boundary import take_away
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix


class Erosion(Fix):
    """Delete points that meet a condition: broken, swollen, or too far away.

    Parameters
    ----------
    condition
        A formula of columns of dump particle (damage, volume, x, ep, T, ...), groups, solids, time
        and published values; points for which it is not 0 are deleted. Names of columns take
        precedence over variables.
    every
        Number of steps between checks.

    Example
    -------
    fix(erosion, erosion, all, damage >= 1 && volume > 1e-9)
    fix(spall, erosion, plate, z < -0.1, every=100)

    Notes
    -----
    Publishes sums since the start: ID_points, ID_mass, and ID_energy (kinetic, stored and
    dissipated), which the energy balance counts as work of the fix. Log and dumps of the same step
    already omit the deleted points.

    See Also
    --------
    delete_particles, boundary
    """

    syntax = "group, condition, every=10"
    published = ("points", "mass", "energy")
    conserves = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        condition: ColumnFormula,
        *,
        every: Annotated[int, Positive] = 10,
    ):
        super().__init__(hub, group)
        self.condition, self.every, self.columns = condition, every, condition.columns
        if empty := [name for name in condition.columns if name in hub.fields.absent_at_points()]:
            hub.warn(f"{', '.join(empty)} will be 0: points have no such field")

    def between_steps(self) -> bool:
        tables = self.hub.fields.each(self, "meeting")
        ids = np.sort(np.concatenate([np.empty(0, np.int64), *tables]))
        if not len(ids):
            return False
        gone = len(ids), *take_away(self.hub, ids, self.mark)
        before = (self.hub.values.get(f"{self.id}_{name}") for name in self.published)
        self.publish_all(*map(sum, zip(before, gone, strict=True)))
        return True

    def meeting(self, points: PointTable) -> np.ndarray | None:
        return points.numbers[self.condition.holds(points)] if points.count else None
