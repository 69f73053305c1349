"""Fixes that put forces on points: walls and tractions, and the base of"""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from karamelo_py.kernels.laws import elastic_law
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import PointForces
from karamelo_py.styles.fixes.formulas import judge_friction, per_direction, vector


class ToolFix(PointForces):
    """Base of fixes that push points, which they take for small cubes (in the plane squares)."""

    needs_stiffness = False  # whether the force goes with the shear modulus of the point

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

    def now(self, formulas: Sequence[Expression]) -> np.ndarray:
        """The present numbers (d,) of formulas of time, one for each direction."""
        return np.array([formula.evaluate(self.hub.values) for formula in formulas])


def side_of(hub: Hub, points: PointsView) -> np.ndarray:
    """Edges (n,) of the cubes that points are taken for."""
    return (points.column("volume") / _radius(hub, points)) ** (1 / hub.domain.dimension)


def face_of(hub: Hub, points: PointsView, side: np.ndarray) -> np.ndarray:
    """Areas (n,) of a face of the cubes with these sides, per radian around an axis."""
    return side ** (hub.domain.dimension - 1) * _radius(hub, points)


def stiffness_of(hub: Hub, points: PointsView) -> np.ndarray:
    """Shear moduli (n,) less what damage has taken of them."""
    solid = points.column("type").astype(int) - 1
    moduli = np.array([_shear_modulus(one) for one in hub.solids.values()])
    return moduli[solid] * (1 - points.column("damage"))


def _radius(hub: Hub, points: PointsView) -> np.ndarray | float:
    return points.position[:, 0].astype(float) if hub.domain.axisymmetric else 1.0


def unit(vector: np.ndarray) -> np.ndarray:
    """A vector (d,) of length 1; one without a direction is refused."""
    length = np.linalg.norm(vector)
    if not (np.isfinite(length) and length > 0):
        raise ScriptError("the normal has no direction", expected="a vector that is not 0")
    return vector / length


def apart(points: PointsView, penetration: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Forces (n, d) that undo penetrations (n,) along `normal` within one step.

    m p / dt^2, for a point that nothing else holds (de Vaucorbeil & Nguyen 2021).
    """
    push = points.mass.astype(float) * np.maximum(penetration, 0) / (points.dt * points.kick)
    return push[:, None] * normal


def rubbed(
    points: PointsView, push: np.ndarray, normal: np.ndarray, velocity: np.ndarray, mu: float
) -> np.ndarray:
    """Forces (n, d) of friction by something that moves with `velocity` and pushes with `push`.

    mu times the pressing force, along the slip, and at most what stops it within the step.
    """
    slip = velocity - points.velocity.astype(float)
    slip = slip - (slip * normal).sum(axis=1, keepdims=True) * normal
    speed = np.linalg.norm(slip, axis=1)
    stopping = points.mass.astype(float) * speed / points.kick
    rub = np.minimum(mu * np.linalg.norm(push, axis=1), stopping)
    return slip * np.divide(rub, speed, out=np.zeros_like(speed), where=speed > 0)[:, None]


def _shear_modulus(solid: Solid) -> float:
    """The shear modulus of a solid, 0 where it has none."""
    law: Any = elastic_law(solid.material.law)
    return float(getattr(law, "G", None) or getattr(getattr(law, "strength", None), "G", None) or 0)


class NeumannBcMech(PointForces):
    """Load the surface of a body with a force per area.

    Parameters
    ----------
    group
        Group of points: one layer of them along the surface.
    traction
        tx, ty, tz, as many as the domain has dimensions: force per area, numbers or formulas of x,
        y, z, x0, y0, z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(load, neumann_bc_mech, top, 0, -1e6*min(time/0.01, 1))

    Notes
    -----
    A point shows one face to what is around it, the side of a cube of its present volume: V^(2/3)
    in space, V^(1/2) in the plane, the whole section in one dimension; around an axis the face is
    at the radius of the point, somewhat inside the surface. Points lie half a side inside of the
    surface where the load acts in fact. Publishes the total force as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes, body_force, heat_flux_particles
    """

    syntax = "group, tx[, ty[, tz]]"

    def __init__(self, hub: Hub, group: ParticleGroup, *traction: Expression | None):
        super().__init__(hub, group)
        self.traction = per_direction(hub, "t", traction)

    def forces(self, points: PointsView) -> np.ndarray:
        x = points.position.astype(float)
        face = face_of(self.hub, points, side_of(self.hub, points))
        return face[:, None] * vector(self.traction, self.hub, x, lambda: points.reference_position)


class ImpenetrableSurface(ToolFix):
    """Push points back that come behind a plane, with a force that grows with the depth.

    Parameters
    ----------
    K
        Stiffness of the wall in shear moduli of the point: a number or a formula of time.
    xs, ys, zs
        A point of the plane: numbers or formulas of time; z is 0 in the plane.
    nx, ny, nz
        Its normal, of any length, towards the side where points may be.

    Example
    -------
    fix(wall, impenetrablesurface, all, 1, 0, 0.1, 0, 0, 1, 0)

    Notes
    -----
    A point at the depth p = n.(xs - x) > 0 gets the force K G (1 - D) p V^(1/d) along the normal,
    with the shear modulus G and the damage D of its material, its present volume V and the number
    of dimensions d. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    contact/minimize_penetration/plane, cuttingtool
    """

    needs_stiffness = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        K: Annotated[Expression, NonNegative],
        xs: Expression,
        ys: Expression,
        zs: Expression,
        nx: Expression,
        ny: Expression,
        nz: Expression,
    ):
        super().__init__(hub, group)
        self.K = K
        self.origin = per_direction(hub, "", (xs, ys, zs))
        self.normal = per_direction(hub, "n", (nx, ny, nz))
        if not hub.rehearsing:  # which does not know all numbers
            unit(self.now(self.normal))

    def forces(self, points: PointsView) -> np.ndarray:
        (K,) = self.now((self.K,))
        normal = unit(self.now(self.normal))
        depth = np.maximum((self.now(self.origin) - points.position.astype(float)) @ normal, 0)
        stiffness, side = stiffness_of(self.hub, points), side_of(self.hub, points)
        return (K * stiffness * depth * side)[:, None] * normal


class ContactMinimizePenetrationPlane(ToolFix):
    """Let a solid touch a fixed plane, as stiffly as the step allows, with friction.

    Parameters
    ----------
    solid
        ID of the solid.
    x, y, z
        A point of the plane: numbers or formulas of time; z is 0 in the plane.
    nx, ny, nz
        Its normal, of any length, towards the side where the solid is.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(floor, contact/minimize_penetration/plane, s1, 0, 0.1, 0, 0, 1, 0, 0.2)

    Notes
    -----
    Points are balls with the radius rp of half the side of a cube of their present volume. Where
    one reaches p = rp - n.(x - xq) into the plane it gets the force m p / dt^2, which takes a free
    point out within one step. Friction is mu times that, against the slip, and at most what stops
    it (de Vaucorbeil & Nguyen 2021). A plane that moves does so without dragging.

    Publishes the force on the solid as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, contact/minimize_penetration, indent/minimize_penetration
    """

    def __init__(
        self,
        hub: Hub,
        solid: Solid,
        x: Expression,
        y: Expression,
        z: Expression,
        nx: Expression,
        ny: Expression,
        nz: Expression,
        mu: Annotated[float, NonNegative],
    ):
        super().__init__(hub, ParticleGroup.of(hub, solid))
        self.mu = mu
        judge_friction(hub, mu)
        self.origin = per_direction(hub, "", (x, y, z))
        self.normal = per_direction(hub, "n", (nx, ny, nz))
        if not hub.rehearsing:  # which does not know all numbers
            unit(self.now(self.normal))

    def forces(self, points: PointsView) -> np.ndarray:
        normal = unit(self.now(self.normal))[None, :]
        height = (points.position.astype(float) - self.now(self.origin)) @ normal[0]
        push = apart(points, side_of(self.hub, points) / 2 - height, normal)
        return push + rubbed(points, push, normal, np.zeros(len(normal[0])), self.mu)
