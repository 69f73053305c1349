"""compute probe."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.output.columns import check_columns
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError


class Probe(Compute):
    """Measure a column of the points: its mean, or its value at a point or a place.

    Published as the plain ID, or with several columns as ID_column each. Without points in the
    group, and of a point that is not there any more, NaN.

    Parameters
    ----------
    column, columns
        Columns of dump particle. Their mean over the group counts points by their volume.
    point
        The id of a point, as dumps show it: its own values instead of the mean.
    x, y, z
        A place: the values of the point of the group that is now nearest to it.

    Example
    -------
    compute(p, probe, bar, s11)
    compute(tip, probe, all, y, vy, point=128)
    compute(gauge, probe, water, s22, x=0.5, y=0)
    log_modify(custom, time, p, tip_vy, gauge)
    """

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        column: str,
        *columns: str,
        point: Annotated[int, Positive] | None = None,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
    ):
        super().__init__(hub, group if point is None else ParticleGroup(hub, everything=True))
        self.columns = (column, *columns)
        known = hub.fields.particle_names()
        check_columns(self.columns, known, first=1)
        self.place_xyz = (x, y, z)
        self.point = point
        if point is not None and self.at_place:
            raise ScriptError("a probe is at a point or at a place, not both", argument="point")
        self.published = ("",) if len(self.columns) == 1 else self.columns

    @property
    def at_place(self) -> bool:
        return any(c is not None for c in self.place_xyz)

    def refresh(self) -> None:
        if self.point is None and not self.at_place:
            volume, *total = self.hub.fields.added_up(self)
            values = np.array(total) / volume if volume > 0 else np.full(len(total), np.nan)
        else:
            found = self.hub.fields.each(self, "nearest")
            values = min(found)[2:] if found else np.full(len(self.columns), np.nan)
        for end, value in zip(self.published, values, strict=True):
            self.publish(end, value)

    def terms(self, points: PointTable) -> list[np.ndarray]:
        volume = points.particle("volume")
        return [volume, *(volume * points.particle(name) for name in self.columns)]

    def nearest(self, points: PointTable) -> list[float] | None:
        """Distance, id and columns of the point that is asked for, or of the nearest of these."""
        ids = points.particle("id")
        if self.point is not None:
            distance = np.where(ids == self.point, 0.0, np.inf)
        else:
            distance = sum(
                (points.particle(name) - c) ** 2
                for name, c in zip("xyz", self.place_xyz, strict=True)
                if c is not None
            )
        if not len(ids) or not np.isfinite(least := distance.min()):
            return None
        at = min(np.flatnonzero(distance == least), key=ids.__getitem__)
        return [least, *(float(points.particle(name)[at]) for name in ("id", *self.columns))]
