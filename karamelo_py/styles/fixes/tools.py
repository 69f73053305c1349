"""Base of fixes that put forces on points: tools, walls and tractions."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from karamelo_py.kernels.laws import elastic_law
from karamelo_py.kernels.p2g import Force
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction


class Bodies:
    """The points of a group as small cubes (in the plane squares), at one moment.

    What a tool does not ask for is not looked for.

    Attributes
    ----------
    x, x0, v : (n, d)
        Positions now and before the first step, velocities.
    mass, side, face, stiffness : (n,)
        Masses, edges of the cubes, areas of one face (per radian around an axis), and shear moduli
        less what damage has taken of them.
    total
        The sum of terms (n,) over all points of the group, those of all processes.
    dt, kick
        The step, and how long forces act in it.
    """

    def __init__(self, hub: Hub, points: PointsView):
        self._hub, self._points = hub, points
        self.dt, self.kick = points.dt, points.kick
        self._d = hub.domain.dimension
        self.total = points.total

    @cached_property
    def x(self) -> np.ndarray:
        return self._points.position.astype(float)

    @property
    def x0(self) -> np.ndarray:
        return self._points.reference_position

    @cached_property
    def v(self) -> np.ndarray:
        return self._points.velocity.astype(float)

    @cached_property
    def mass(self) -> np.ndarray:
        return self._points.mass.astype(float)

    @cached_property
    def _radius(self) -> np.ndarray:
        return self.x[:, 0] if self._hub.domain.axisymmetric else np.ones(len(self.x))

    @cached_property
    def side(self) -> np.ndarray:
        return (self._column("volume") / self._radius) ** (1 / self._d)

    @property
    def face(self) -> np.ndarray:
        return self.side ** (self._d - 1) * self._radius

    @cached_property
    def stiffness(self) -> np.ndarray:
        solid = self._column("type").astype(int) - 1
        moduli = np.array([_shear_modulus(one) for one in self._hub.solids.values()])
        return moduli[solid] * (1 - self._column("damage"))

    def _column(self, name: str) -> np.ndarray:
        return self._points.column(name)


class PointForceFix(Fix):
    """Base of fixes that put a force on each point of their group.

    Attributes
    ----------
    needs_stiffness
        Whether the force goes with the shear modulus of the point.
    """

    published: tuple[str, ...] = ("x", "y", "z")
    point_fields = (Force,)
    point_by_point = True
    needs_stiffness = False

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        soft = (s for s in hub.solids.values() if not _shear_modulus(s) and group.touches(s))
        if self.needs_stiffness and (solid := next(soft, None)):
            raise ScriptError(
                f"material '{solid.material.id}' of solid '{solid.id}' has no shear modulus, "
                "with which the force would go",
                argument="group",
                expected="a group of points of elastic materials",
            )

    def push(self, bodies: Bodies) -> np.ndarray:
        """The forces (n, d) on the points."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Give the points their forces and publish the sum."""
        force = self.push(Bodies(self.hub, points))
        points.force = points.force + force
        self.publish_components(points.total(force))

    def now(self, formulas: Sequence[Expression]) -> np.ndarray:
        """The present numbers (d,) of formulas of time, one for each direction."""
        return np.array([formula.evaluate(self.hub.values) for formula in formulas])


def place(hub: Hub, x: Expression, y: Expression, z: Expression, name: str = "") -> tuple:
    """The formulas of a vector for the directions of the domain; further ones have to be 0."""
    return per_direction(hub, name, (x, y, z))


def unit(vector: np.ndarray) -> np.ndarray:
    """A vector (d,) of length 1.

    Raises
    ------
    ScriptError
        For one without a direction.
    """
    length = np.linalg.norm(vector)
    if not (np.isfinite(length) and length > 0):
        raise ScriptError("the normal has no direction", expected="a vector that is not 0")
    return vector / length


def apart(bodies: Bodies, penetration: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Forces (n, d) that undo penetrations (n,) along `normal` within one step.

    m p / dt^2, for a point that nothing else holds (de Vaucorbeil & Nguyen 2021).
    """
    push = bodies.mass * np.maximum(penetration, 0) / (bodies.dt * bodies.kick)
    return push[:, None] * normal


def rubbed(
    bodies: Bodies, push: np.ndarray, normal: np.ndarray, velocity: np.ndarray, mu: float
) -> np.ndarray:
    """Forces (n, d) of friction by something that moves with `velocity` and pushes with `push`.

    mu times the pressing force, along the slip, and at most what stops it within the step.
    """
    slip = velocity - bodies.v
    slip = slip - (slip * normal).sum(axis=1, keepdims=True) * normal
    speed = np.linalg.norm(slip, axis=1)
    rub = np.minimum(mu * np.linalg.norm(push, axis=1), bodies.mass * speed / bodies.kick)
    return slip * np.divide(rub, speed, out=np.zeros_like(speed), where=speed > 0)[:, None]


def _shear_modulus(solid: Solid) -> float:
    """The shear modulus of a solid, 0 where it has none."""
    law: Any = elastic_law(solid.material.law)
    return float(getattr(law, "G", None) or getattr(getattr(law, "strength", None), "G", None) or 0)
