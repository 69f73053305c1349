"""What fixes share that put forces on points: tools, walls and tractions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

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


class Bodies(NamedTuple):
    """The points of a group as small cubes (in the plane squares), at one moment."""

    x: np.ndarray  # (n, d) positions
    x0: np.ndarray  # (n, d) positions before the first step
    v: np.ndarray  # (n, d) velocities
    mass: np.ndarray  # (n,)
    side: np.ndarray  # (n,) edge of the cube
    face: np.ndarray  # (n,) area of one face; per radian around an axis
    stiffness: np.ndarray  # (n,) shear modulus, less what damage has taken of it
    dt: float
    kick: float  # how long forces act in the step


class PointForceFix(Fix):
    """Base of fixes that put a force on each point of their group.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Attributes
    ----------
    needs_stiffness
        Whether the force goes with the shear modulus of the point.
    """

    published: tuple[str, ...] = ("x", "y", "z")
    point_fields = (Force,)
    needs_stiffness = False

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        if self.needs_stiffness:
            _moduli(hub, group)

    def push(self, bodies: Bodies) -> np.ndarray:
        """The forces (n, d) on the points."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Give the points their forces and publish the sum."""
        if not len(points.ids):
            return
        force = self.push(self._bodies(points))
        points.force = points.force + force
        self.publish_components(force.sum(axis=0))

    def now(self, formulas: Sequence[Expression]) -> np.ndarray:
        """The present numbers (d,) of formulas of time, one for each direction."""
        return np.array([formula.evaluate(self.hub.values) for formula in formulas])

    def _bodies(self, points: PointsView) -> Bodies:
        d, axisymmetric = self.hub.domain.dimension, self.hub.domain.axisymmetric
        x = points.position.astype(float)
        radius = x[:, 0] if axisymmetric else np.ones(len(x))
        section = self._column("volume", points.ids) / radius
        side = section ** (1 / d)
        stiffness = np.zeros(len(x))
        if self.needs_stiffness:
            moduli = _moduli(self.hub, self.group)
            solid = self._column("type", points.ids).astype(int) - 1
            stiffness = moduli[solid] * (1 - self._column("damage", points.ids))
        return Bodies(
            x=x,
            x0=points.reference_position,
            v=points.velocity.astype(float),
            mass=points.mass.astype(float),
            side=side,
            face=side ** (d - 1) * radius,
            stiffness=stiffness,
            dt=points.dt,
            kick=points.kick,
        )

    def _column(self, name: str, ids: np.ndarray) -> np.ndarray:
        """A column of the dumps for the points `ids`."""
        fields = self.hub.fields
        column = np.zeros(fields.count)
        column[fields.particle("id") - 1] = fields.particle(name)
        return column[ids]


class SolidPoints(ParticleGroup):
    """The points of one solid as a group."""

    def __init__(self, hub: Hub, solid: Solid):
        super().__init__(hub)
        self.id = solid.id
        self.solid = solid

    def chosen(self) -> np.ndarray:
        """See `Group.chosen`."""
        return np.arange(self.solid.first_id, self.solid.first_id + self.solid.count)


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


def _moduli(hub: Hub, group: ParticleGroup) -> np.ndarray:
    """Shear moduli by solid; those whose points are in the group have to have one."""
    members = group.ids
    moduli = []
    for solid in hub.solids.values():
        law: Any = elastic_law(solid.material.law)
        G = getattr(law, "G", None) or getattr(getattr(law, "strength", None), "G", None)
        inside = (members >= solid.first_id) & (members < solid.first_id + solid.count)
        if not G and inside.any():
            raise ScriptError(
                f"material '{solid.material.id}' of solid '{solid.id}' has no shear modulus, "
                "with which the force would go",
                argument="group",
                expected="a group of points of elastic materials",
            )
        moduli.append(float(G or 0.0))
    return np.array(moduli)
