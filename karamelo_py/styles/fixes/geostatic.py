"""Fix geostatic_stress."""

from itertools import product
from typing import Annotated

import numpy as np

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.output.point_table import from_solids
from karamelo_py.points.laws import specific_volume
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.scene.solid import Solid
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import refuse_following


class GeostaticStress(Fix):
    """Set the stress due to weight once, before the next step, in ground with any surface.

    Parameters
    ----------
    k0
        Horizontal divided by vertical effective stress, a function of x, y, z, x0, y0, z0, such as
        if(y0 < 5, 1.2, 0.5) for two layers.
    gravity
        Gravitational acceleration, positive, against the last direction (y in 2D, z in 3D).

    Example
    -------
    fix(start, geostatic_stress, soil, k0=0.5, gravity=9.81)

    Notes
    -----
    The vertical stress at a point is the weight per unit area of the points of the group above it,
    summed in columns as wide as the largest point. Layers may differ in material and in points per
    cell. A material with pore_water is saturated up to its highest point in the column, with
    hydrostatic pressure, and the stress is the effective stress. Under fix body_force, ground with
    a level surface is then in equilibrium, and a slope nearly so. Hyperelastic materials are
    refused, because their stress follows from the deformation.

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
        k0: Annotated[Expression, NonNegative] = 0.5,
        gravity: Annotated[float, Positive] = 9.81,
    ):
        super().__init__(hub, group)
        self.k0, self.gravity = Expression(k0), gravity
        refuse_following(hub, group)

    def initial_integrate(self, points: PointsView) -> None:
        d, ids, x = self.hub.domain.dimension, points.ids - 1, points.position.astype(float)
        if not len(ids):
            return
        k0 = self.k0.evaluate_points(self.hub.values, x.copy(), points.reference_position)
        size = 2 * from_solids(self.hub, ids, _half, d)
        x += from_solids(self.hub, ids, lambda solid, rows: to_middles(
            solid.x0_of(rows), 2 * _half(solid, rows)), d)  # fmt: skip
        dry, in_pores, water = (from_solids(self.hub, ids, of) for of in (_dry, _in_pores, _water))
        weights = self.gravity * np.column_stack([dry + in_pores, water])
        load = load_above(x, size, weights)
        pressure = np.where(water > 0, load[:, 1], 0.0)
        vertical = pressure - load[:, 0]
        names = {f"{k}{k}": k0 * vertical for k in (1, 2, 3)}
        shears = dict.fromkeys(("12", "13", "23"), np.zeros(len(ids)))
        points.set_stress(names | shears | {f"{d}{d}": vertical})
        for solid in self.hub.solids.values():
            if solid.material.fluid is not None:
                solid.material.fluid.set_pressure(points, pressure)
                break


def to_middles(x: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the vectors (n, d) from the points of a solid to the centres of their boxes.

    Gauss points (and Karamelo's three points per cell) are not at the centres.
    """
    step = np.zeros_like(x)
    for along, length, out in zip(x.T, size.T, step.T, strict=True):
        order = np.argsort(along)
        at, long = along[order], length[order]
        begins = np.diff(at, prepend=-np.inf) > 1e-6 * long
        line, at, long = np.cumsum(begins) - 1, at[begins], long[begins]
        middle = np.cumsum(long) - long / 2
        # Points on both sides of a gap belong to different pieces.
        piece = np.cumsum(np.diff(at - 1.5 * middle, prepend=np.inf) > 0)
        off = np.bincount(piece, at - middle) / np.bincount(piece)
        to = middle + off[piece] - at
        if (np.abs(to) < 0.25 * long).all():
            out[order] = to[line]
    return step


def load_above(x: np.ndarray, size: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the weight per unit area (n, k) above the centres of points, taken as boxes.

    `x`, `size` (n, d): centres and sizes; the last direction is up. `weights` (n, k) are per
    volume. Columns are at least as wide as the widest box. The weight of a box is added to all
    columns that it overlaps, and its load is their mean.
    """
    flat, half = x[:, :-1], size[:, :-1] / 2
    begin = (flat - half).min(axis=0)
    width = (flat + half).max(axis=0) - begin
    count = np.maximum(width / size[:, :-1].max(axis=0) * (1 + 1e-9), 1).astype(int)
    left, across = (flat - half - begin) / width * count, 2 * half / width * count
    first = np.minimum(left.astype(int), count - 1)
    inside = np.clip((first + 1 - left) / across, 0, 1)  # fraction of a box in its first column
    load = np.zeros_like(weights)
    corners = np.array(list(product((0, 1), repeat=flat.shape[1])), int)
    boxes = np.tile(np.arange(len(x)), len(corners))
    fraction = np.concatenate([np.where(c == 0, inside, 1 - inside).prod(axis=1) for c in corners])
    columns = np.concatenate([np.minimum(first + c, count - 1) for c in corners])
    inner = fraction > 1e-9  # round-off must not add a second column
    boxes, fraction, columns = boxes[inner], fraction[inner], columns[inner]
    column = np.tile(columns @ np.cumprod([1, *count])[:-1], 3)
    # The load in a column is linear between the tops and bottoms of boxes.
    slope = (fraction * across.prod(axis=1)[boxes])[:, None] * weights[boxes]
    slope = np.concatenate([slope, 0 * slope, -slope])
    z = np.concatenate([(x[:, -1] + k * size[:, -1])[boxes] for k in (0.5, 0, -0.5)])
    down = np.lexsort((-z, column))
    starts = np.diff(column[down], prepend=-1) != 0
    steps = -np.diff(z[down], prepend=0)[:, None] * np.roll(np.cumsum(slope[down], axis=0), 1, 0)
    sums = np.cumsum(np.where(starts[:, None], 0, steps), axis=0)
    at = np.empty_like(sums)
    at[down] = sums - sums[np.maximum.accumulate(np.where(starts, np.arange(len(down)), 0))]
    np.add.at(load, boxes, fraction[:, None] * at[len(boxes) : 2 * len(boxes)])
    return load


def _half(solid: Solid, rows: np.ndarray) -> np.ndarray:
    return solid.half_size[rows]


def _dry(solid: Solid, rows: np.ndarray) -> np.ndarray:
    return np.full(len(rows), 1 / float(specific_volume(solid.material.whole)))


def _in_pores(solid: Solid, rows: np.ndarray) -> np.ndarray:
    fluid = solid.material.fluid
    return np.full(len(rows), 0.0 if fluid is None else fluid.n * fluid.rho)


def _water(solid: Solid, rows: np.ndarray) -> np.ndarray:
    fluid = solid.material.fluid
    return np.full(len(rows), 0.0 if fluid is None else fluid.rho)
