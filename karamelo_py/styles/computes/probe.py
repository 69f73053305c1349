"""compute probe."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError, unknown


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
        super().__init__(hub, group)
        self.columns = (column, *columns)
        known = hub.fields.particle_names()
        for k, name in enumerate(self.columns):
            if name not in known:
                raise unknown(f"unknown column '{name}'", name, known, argument=1 + k)
        self.place_xyz = (x, y, z)
        self.point = point
        if point is not None and self.at_place:
            raise ScriptError("a probe is at a point or at a place, not both", argument="point")
        self.published = ("",) if len(self.columns) == 1 else self.columns

    @property
    def at_place(self) -> bool:
        """Whether a place was given."""
        return any(c is not None for c in self.place_xyz)

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        present = fields.particle("id")
        if self.point is not None:
            chosen = present == self.point
        else:
            chosen = np.isin(present, fields.members(self.group) + 1)
        if self.at_place and chosen.any():
            distance = sum(
                (fields.particle(name) - c) ** 2
                for name, c in zip("xyz", self.place_xyz, strict=True)
                if c is not None
            )
            chosen = np.array([np.flatnonzero(chosen)[distance[chosen].argmin()]])
        weight = fields.particle("volume")[chosen]
        for name, end in zip(self.columns, self.published, strict=True):
            values = fields.particle(name)[chosen]
            self.publish(end, np.average(values, weights=weight) if len(weight) else np.nan)
