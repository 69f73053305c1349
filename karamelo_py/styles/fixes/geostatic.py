"""Fix geostatic_stress: the stress of ground under its weight."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.output.point_table import from_solids
from karamelo_py.points.laws import specific_volume
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.fixes.forces import refuse_following


class GeostaticStress(Fix):
    """Set the stress of ground under any surface once, before the next step: weight above, and k0.

    Parameters
    ----------
    k0
        Horizontal over vertical effective stress.
    gravity
        Acceleration downwards, against the last direction of the scene: y in 2D, z in 3D.

    Example
    -------
    fix(start, geostatic_stress, soil, k0=0.5, gravity=9.81)

    Notes
    -----
    The vertical stress of a point is the weight of the points of the group above it, in columns of
    their size, also of several layers. In materials with pore_water, up to the surface of the
    ground, the pressure of the water is hydrostatic and the stress is the effective stress. Below a
    level surface the ground is at rest with fix body_force; below a slope it is close to it. The
    material has to take a stress: see initial_stress.

    See Also
    --------
    initial_stress, body_force, local_damping, pore_water
    """

    published = ()
    first_step_only = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        *,
        k0: Annotated[float, NonNegative] = 0.5,
        gravity: Annotated[float, Positive] = 9.81,
    ):
        super().__init__(hub, group)
        self.k0, self.gravity = k0, gravity
        refuse_following(hub, group)

    def initial_integrate(self, points: PointsView) -> None:
        d, ids, x = self.hub.domain.dimension, points.ids - 1, points.position.astype(float)
        size = 2 * from_solids(self.hub, ids, lambda solid, rows: solid.half_size[rows], d)
        dry, in_pores, water = (from_solids(self.hub, ids, of) for of in (_dry, _in_pores, _water))
        columns = np.floor((x[:, :-1] - self.hub.domain.lo[: d - 1]) / size[:, :-1]).astype(int)
        _, column = np.unique(columns, axis=0, return_inverse=True)
        down = np.lexsort((-x[:, -1], column.ravel()))
        above = self.gravity * np.column_stack([dry + in_pores, water]) * size[:, -1:]
        first = np.diff(column.ravel()[down], prepend=-1) != 0
        total = np.cumsum(above[down], axis=0) - above[down]
        begins = np.maximum.accumulate(np.where(first, np.arange(len(down)), 0))
        load = np.empty_like(total)
        load[down] = total - total[begins] + 0.5 * above[down]
        pressure = np.where(water > 0, load[:, 1], 0.0)
        vertical = pressure - load[:, 0]
        names = {f"{k}{k}": self.k0 * vertical for k in (1, 2, 3)}
        shears = dict.fromkeys(("12", "13", "23"), np.zeros(len(ids)))
        points.set_stress(names | shears | {f"{d}{d}": vertical})
        for solid in self.hub.solids.values():
            if solid.material.fluid is not None:
                solid.material.fluid.set_pressure(points, pressure)
                break


def _dry(solid: Solid, rows: np.ndarray) -> np.ndarray:
    return np.full(len(rows), 1 / float(specific_volume(solid.material.whole)))


def _in_pores(solid: Solid, rows: np.ndarray) -> np.ndarray:
    fluid = solid.material.fluid
    return np.full(len(rows), 0.0 if fluid is None else fluid.n * fluid.rho)


def _water(solid: Solid, rows: np.ndarray) -> np.ndarray:
    fluid = solid.material.fluid
    return np.full(len(rows), 0.0 if fluid is None else fluid.rho)
