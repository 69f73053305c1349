"""Contact of points with the surface of a region."""

from functools import cached_property
from typing import Annotated, Any

import numpy as np

from karamelo_py.compiler import address_of_python
from karamelo_py.kernels.equations.internal_force import ContactLoss, Lever
from karamelo_py.kernels.touching import (
    ASIDE,
    CALL,
    DAMPED,
    LEVEL,
    STIFF,
    STIFFENING,
    Touch,
    touch_hook,
    touch_kind,
)
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import NonNegative
from karamelo_py.output.point_table import PointTable
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
    """Contact of points with the surface of a region, which may move, with friction.

    Parameters
    ----------
    region
        The region that pushes points out. It needs an inside: a mesh of solid elements (in 2D of
        area elements), a closed STL surface, or a plane. With the word ``exterior`` it is a mould.
    mu
        Coefficient of friction (Coulomb); default 0.
    way
        ux, uy, uz, one per dimension of the domain: displacement of the region, formulas of time.
        Default: none. A region does not rotate.

    Example
    -------
    fix(ground, contact/surface, all, wall, 0.2)
    fix(press, contact/surface, all, disk, 0.1, 0, -0.5*time, 0)

    Notes
    -----
    Publishes the force on the points as ID_x, ID_y, ID_z.

    Points are spheres (in 2D disks) with a radius of half the side of a cube of their volume,
    stretched along the normal while they touch. The force acts at their surface. At the depth p it
    is k p + 0.2 m p'/dt out of the region, and never a pull. k is 0.5 m/dt^2 at the first touch,
    with dt as in contact/minimize_penetration. Friction, at most mu times this force, stops the
    slip on the moving region and reverses it with the same stiffness: a point whose load it can
    hold is at rest, after a displacement of at most mu p.

    The spring conserves energy. Damping and friction dissipate it: the summary of the run has the
    line ``lost by contact``, energy that the balance counts as work of the fix. A disk that hits at
    5 % of its wave speed loses 3.0, 1.4 and 0.4 % with 4, 8 and 16 cells in the radius, and 4.7,
    2.6 and 1.5 % at 25 %. A rod of 16 x 4 cells returns with 0.96 of its speed (exact 1).

    Under its weight, a block has the right stress in its lowest row within 6 % with a linear
    basis, and 22 % too little (29 % too much in the next row) with quadratic-spline.

    The force acts in the direction in which the depth decreases fastest. A point deeper than a
    cell, or in the middle of a thin region, ends the run. A point past the middle of a thin region
    is pushed out on the other side: a wall of one cell stops bodies up to 1/3 of their wave speed.

    A block on a slope of 20 degrees with mu = 0.2 has the acceleration 1.54 in tlmpm and 1.55 in
    ulmpm (exact 1.541; points=cut), with an energy balance to 0.2 %. The block sinks in by twice
    the force on a point divided by m / dt^2, here 1 % of a cell. A belt over half a bollard with mu
    = 0.3 is drawn slowly with 2.50 times its load (exact 2.57 for a thin belt, 2.45 for this one,
    as thick as 10 % of the radius).

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
        """Displacement (d,) of the region so far, and its mean velocity (d,) in the next step."""
        values, times = self.hub.values, {"time": self.hub.update.time + np.array([0.0, dt])}
        ways = np.zeros((self.hub.domain.dimension, 2))
        for k, formula in enumerate(self.way):
            ways[k] = formula.evaluate_columns(values, times)
        return ways[:, 0], (ways[:, 1] - ways[:, 0]) / dt

    def depth(self, x: np.ndarray) -> np.ndarray:
        return self.region.depth(x, self.hub.domain.h)

    def depth_of(self, points: PointTable) -> np.ndarray:
        return self.depth(points.position.astype(float) - self.moved(1.0)[0])

    def pressed(self, points: PointTable) -> int:
        """Return the number of points whose balls reach past the surface by half a radius."""
        size = points.particle("volume") / self.hub.domain.depth(points.position)
        return int(np.sum(self.depth_of(points) > -0.25 * size ** (1 / self.hub.domain.dimension)))

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
        """Forces for a region without a kernel."""
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
        whole, lever, dt = self.side(points) / 2, points[self.lever], points.dt
        before, mass = lever[:, d:].astype(float), points.mass.astype(float)
        ball = np.where(before[:, 0] > 0, before[:, 0], whole)
        now, touching = within + ball, within + ball > 0
        slip = velocity - points.velocity.astype(float)
        known = before[:, 1] > 0
        closer = np.where(known, now - before[:, 2], dt * (slip * normal).sum(axis=1))
        stiffest = STIFF / (points.contact_dt * points.contact_kick)
        deep = within > 0.5 * self.hub.domain.h
        rate = np.minimum(stiffest, np.where(deep, 1 + STIFFENING, 1) * before[:, 1])
        rate = np.where(known, rate, stiffest)
        damped = DAMPED / points.contact_kick * closer / np.where(known, 2 * points.kick - dt, dt)
        push = np.where(touching, (rate * now + damped) / stiffest * STIFF, 0.0)
        force = self.press(
            points, push, touching, normal, velocity=velocity, seen=x, fraction=STIFF
        )
        load = mass * np.where(touching, np.maximum(rate * now + damped, 0), 0)
        damping = np.where(touching, load - mass * rate * now, 0.0)
        lost = 0.5 * (damping + before[:, 3]) * closer
        points[ContactLoss][:, 0] += np.where(touching, lost, 0.0)
        near = within > -np.maximum(ball, whole)
        lever[:, :d] = np.sqrt(load * ball)[:, None] * normal
        lever[:, d:] = np.stack([near * ball, near * rate, now, damping], axis=1)
        return force


def _begin_pressed(surface: ContactSurface, scene: Any) -> Any:
    if scene.simulation.step > 0 or begin_behind(surface, scene):
        return False
    count = sum(scene.hub.fields.each(surface, "pressed"))
    return {"count": count, "of": len(surface.group)} if count else False


known_failure(
    ContactSurface,
    "points pressed against the region of fix '{part.id}'",
    when=_begin_pressed,
    reason="{count} of {of} points of its group start with half of their radius in the region, "
    "as at faces inclined to the grid, and throw the body off",
    cure="points=cut in the command solid, or a gap of a quarter of a cell",
)

known_failure(
    ContactSurface,
    "points in the region of fix '{part.id}'",
    when=begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="the word exterior for a region that holds the points, or another position of the "
    "region or the body",
)
