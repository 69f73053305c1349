"""Contact of points with the surface of a region."""

from functools import cached_property
from typing import Annotated

import numpy as np

from karamelo_py.compiler import address_of_python
from karamelo_py.kernels.equations.internal_force import ContactLoss, Lever
from karamelo_py.kernels.surfaces import is_endless
from karamelo_py.kernels.touching import (
    ASIDE,
    CALL,
    LEVEL,
    NearPoint,
    Touch,
    push_points,
    touch_hook,
    touch_kind,
)
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import NonNegative
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import named
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.grip import memory_for
from karamelo_py.styles.fixes.tools.base import begin_behind
from karamelo_py.styles.fixes.tools.stiff import StiffTool

# Core seconds per point near a surface of some thousand faces, and near a simple shape.
OF_FACES, OF_SHAPE = 1.5e-6, 5e-8


class ContactSurface(StiffTool):
    """Apply contact of points with a region, as a fixed or moving wall or tool, with friction.

    Parameters
    ----------
    region
        ID of the region. The region must have an inside: a mesh of solid elements (in 2D of area
        elements), a closed STL surface, or a plane. With the word ``exterior`` the region is a
        mould.
    mu
        Coefficient of friction (Coulomb).
    way
        ux, uy, uz, one per dimension: displacement of the region as a function of time.

    Example
    -------
    fix(ground, contact/surface, all, wall, 0.2)
    fix(press, contact/surface, all, disk, 0.1, 0, -0.5*time, 0)

    Notes
    -----
    Publishes the force on the points as ID_x, ID_y, ID_z.

    Points are spheres (in 2D disks) with a radius of half the side of a cube of their volume. The
    radius follows the stretch along the normal, and is smaller if a point overlaps the region at
    the start. The force acts at the surface of the sphere. At the depth p it is k p + 0.02 m p'/dt,
    directed out of the region and never a pull, where k = 0.5 m/dt^2 at the first contact and dt is
    as in contact/minimize_penetration. Friction is a spring of the same stiffness against the slip,
    with at most mu times this force: it displaces a point at rest by at most mu p.

    The spring conserves energy. Damping and friction dissipate energy (``lost by contact`` in the
    summary of the run), which the balance counts as work of the fix. A disk that hits a wall at 5
    to 25 % of its wave speed loses 0.6, 0.3 and 0.1 % of its energy with 4, 8 and 16 cells in the
    radius. A rod of 8 x 2 cells rebounds with 94 % of its speed, 98 % with dt_factor(0.9).

    In the lowest row of a block under its weight, the stress is correct within 6 % with a linear
    basis, and 22 % too small with quadratic-spline (29 % too large in the next row).

    The force acts in the direction in which the depth decreases fastest. A point deeper than a
    cell, or in the middle of a thin region, ends the run; a point past the middle would be pushed
    out on the other side. A wall one cell thick stops bodies with up to 1/3 of their wave speed.

    A block on a slope bounces if its weight is applied suddenly. The frictional impulse is mu times
    the normal impulse within 0.1 % on slopes of 20 to 45 degrees with mu = 0.2. Near the angle of
    friction (20 degrees, mu = 0.34 to 0.4), the error of the speed is up to 0.12 m/s in the first
    bounces and 0.04 m/s after a second. Energy is balanced within 0.3 %. The block sinks in by
    twice the force on a point divided by m / dt^2, here 1 % of a cell. A belt drawn slowly over
    half a bollard with mu = 0.3 needs 2.50 times its load (exact: 2.57 if thin, 2.45 for this one).

    See Also
    --------
    contact/minimize_penetration/plane, contact/friction, region mesh, region stl
    """

    syntax = "group, region[, mu[, ux[, uy[, uz]]]]"

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        region: Region,
        mu: Annotated[float, NonNegative] = 0.0,
        *way: Expression,
    ):
        super().__init__(hub, group)
        if region.flat:
            raise ScriptError(
                f"region '{region.id}' has lines or surfaces and no inside",
                argument="region",
                expected="a region with an inside: a mesh of elements of volume (in 2D of area), "
                "a closed STL surface, a block, ...",
            )
        self.region = region
        self.rubs(hub, mu)
        self.way = self.of_time("u", way) if way else ()
        self.lever = memory_for(hub, Lever)
        self.remember(self.lever)
        if region.outline() is not None:
            self.formulas, self.published = self.way, tuple("xyz"[: hub.domain.dimension])
            self.initial_integrate = touch_hook(self._touch)

    def moved(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement (d,) so far, and the mean velocity (d,) in the next step."""
        values, times = self.hub.values, {"time": self.hub.update.time + np.array([0.0, dt])}
        ways = np.zeros((self.hub.domain.dimension, 2))
        for k, formula in enumerate(self.way):
            ways[k] = formula.evaluate_columns(values, times)
        return ways[:, 0], (ways[:, 1] - ways[:, 0]) / dt

    def depth(self, x: np.ndarray) -> np.ndarray:
        return self.region.depth(x, self.hub.domain.h)

    def depth_of(self, points: PointTable) -> np.ndarray:
        return self.depth(points.position.astype(float) - self.moved(1.0)[0])

    def is_endless(self, axis: int) -> bool:
        return is_endless(self.region.outline(), axis)

    def faces_of(self) -> np.ndarray | None:
        skin = self.region.skin
        return None if skin is None else skin.faces + self.moved(1.0)[0]

    def _touch(self, row: int, values: tuple) -> Touch:
        self.begin_to_touch()
        shape, h = self.region.outline(), float(self.hub.domain.h)
        return touch_kind(self.lever, self.grip)(
            row, values, shape, float(self.mu), h, self._address
        )

    def seconds(self) -> float:
        one = OF_FACES if self.region.from_file else OF_SHAPE
        return super().seconds() + one * len(self.group)

    @cached_property
    def _address(self) -> int:
        return address_of_python(self._refuse, CALL)

    def _refuse(self, number: int) -> int:
        raise ScriptError(
            f"{named(self.hub, number)} is so deep in region '{self.region.id}' of fix "
            f"'{self.id}' that the direction to its surface is ambiguous",
            mark=self.mark,
            expected="points that come less than a cell below the surface",
            hint="smaller steps (dt_factor), a stiffer body, or a region that moves more "
            "slowly, or is thicker",
        )

    def forces(self, points: PointsView) -> np.ndarray:
        """Return the forces of a region without a kernel."""
        way, velocity = self.moved(points.dt)
        x, d = points.position.astype(float) - way, len(velocity)
        within, aside = self.depth(x), ASIDE * self.hub.domain.h
        falls = [self.depth(x - k) - self.depth(x + k) for k in aside * np.eye(d)]
        normal = np.stack(falls, axis=1)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, size, out=np.zeros_like(x), where=size > LEVEL * aside)
        lost = np.flatnonzero((within > 0) & (size[:, 0] <= LEVEL * aside))
        if len(lost):
            self._refuse(int(points.ids[lost[0]]) - 1)
        self.begin_to_touch()
        kinds = [self.lever, self.grip, ContactLoss]
        memory = tuple([None if kind is None else points[kind].T for kind in kinds])
        slip, mass = velocity - points.velocity.astype(float), points.mass.astype(float)
        near = NearPoint(x, within, normal, self.side(points) / 2, slip, mass)
        times = points.dt, points.contact_dt, points.contact_kick, points.kick
        terms, force = (float(self.mu), float(self.hub.domain.h), *times), np.zeros_like(x)
        push_points(KINEMATICS[d](), terms, memory, near, force)
        return force


known_failure(
    ContactSurface,
    "points in the region of fix '{part.id}'",
    when=begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="the word exterior for a region that holds the points, or another position of the "
    "region or the body",
)
