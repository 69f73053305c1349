"""Fixes of walls and rigid tools: planes, balls, a wedge, a turning cylinder; forces on faces."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np

from karamelo_py.kernels.laws import elastic_law
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import Argument, NonNegative
from karamelo_py.language.unknown import words_of
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid, named
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import PointForces
from karamelo_py.styles.fixes.formulas import judge_friction, per_direction, vector

SOFT = 0.1  # share of a penetration that a step undoes where it stops the approach, too


class ToolFix(PointForces):
    """Base of fixes that push points, which they take for small cubes (in the plane squares)."""

    follows_points = True
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

    def behind(self, points: PointTable) -> tuple[int, float]:
        """Count points that are in the tool now, and find how deep the deepest is."""
        depth = self.depth_of(points)
        return int(np.sum(depth > self.hub.domain.tolerance)), float(depth.max(initial=0.0))

    def now(self, *formulas: Expression) -> np.ndarray:
        """The present numbers (n,) of formulas of time."""
        return np.array([formula.evaluate(self.hub.values) for formula in formulas])

    def of_time(self, name: str, formulas: Sequence[Expression]) -> tuple[Expression, ...]:
        """Check that there is a formula of time for each direction."""
        found = per_direction(self.hub, name, formulas, all_given=True)
        self.now(*found)
        return found

    def from_place(
        self, points: PointsView | PointTable, place: Sequence[Expression]
    ) -> np.ndarray:
        """Vectors (n, d) from a place to the points."""
        return points.position.astype(float) - self.now(*place)

    def side(self, points: PointsView) -> np.ndarray:
        """Edges (n,) of the cubes that points are taken for."""
        return (points.column("volume") / self._radius(points)) ** (1 / self.hub.domain.dimension)

    def face(self, points: PointsView) -> np.ndarray:
        """Areas (n,) of a face of these cubes, per radian around an axis."""
        return self.side(points) ** (self.hub.domain.dimension - 1) * self._radius(points)

    def _radius(self, points: PointsView) -> np.ndarray | float:
        return points.position[:, 0].astype(float) if self.hub.domain.axisymmetric else 1.0

    def stiffness(self, points: PointsView) -> np.ndarray:
        """Shear moduli (n,) less what damage has taken of them."""
        moduli = np.array([_shear_modulus(solid) for solid in self.hub.solids.values()])
        return moduli[points.column("type").astype(int) - 1] * (1 - points.column("damage"))


def _shear_modulus(solid: Solid) -> float:
    """The shear modulus of a solid, 0 where it has none."""
    law: Any = elastic_law(solid.material.law)
    return float(getattr(law, "G", None) or getattr(getattr(law, "strength", None), "G", None) or 0)


def unit(vector: np.ndarray) -> np.ndarray:
    """A vector (d,) of length 1; one without a direction is refused."""
    length = np.linalg.norm(vector)
    if not (np.isfinite(length) and length > 0):
        raise ScriptError("the normal has no direction", expected="a vector that is not 0")
    return vector / length


def penalty(
    points: PointsView, depth: np.ndarray, normal: np.ndarray, velocity: Any, mu: float
) -> np.ndarray:
    """Forces (n, d) that undo penetrations of `depth` (n,) along `normal` within one step.

    m p / dt^2, for a point that nothing else holds. Friction by a tool of this `velocity` is mu
    times that, along the slip, and at most what stops it within the step (de Vaucorbeil & Nguyen
    2021).
    """
    mass = points.mass.astype(float)
    push = (mass * np.maximum(depth, 0) / (points.dt * points.kick))[:, None] * normal
    slip = velocity - points.velocity.astype(float)
    slip = slip - (slip * normal).sum(axis=1, keepdims=True) * normal
    speed = np.linalg.norm(slip, axis=1)
    rub = np.minimum(mu * np.linalg.norm(push, axis=1), mass * speed / points.kick)
    return push + slip * np.divide(rub, speed, out=np.zeros_like(speed), where=speed > 0)[:, None]


class NeumannBcMech(ToolFix):
    """Load the surface of a body with a force per area.

    Parameters
    ----------
    group
        Group of points: one layer of them along the surface.
    traction
        tx, ty, tz, as many as the domain has dimensions: force per area. Numbers or formulas of x,
        y, z, x0, y0, z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(load, neumann_bc_mech, top, 0, -1e6*min(time/0.01, 1))

    Notes
    -----
    A point has one face to the outside, the side of a cube of its present volume: V^(2/3) in space,
    V^(1/2) in the plane, the whole section in one dimension. In axisymmetric scenes the face is at
    the radius of the point. Points lie half a side inside the surface on which the real load acts.
    Publishes the total force as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes, body_force, heat_flux_particles
    """

    syntax = "group, tx[, ty[, tz]]"

    def __init__(self, hub: Hub, group: ParticleGroup, *traction: Expression | None):
        super().__init__(hub, group)
        self.traction = per_direction(hub, "t", traction)

    def forces(self, points: PointsView) -> np.ndarray:
        x, first = points.position.astype(float), lambda: points.reference_position
        return self.face(points)[:, None] * vector(self.traction, self.hub, x, first)


class PlaneTool(ToolFix):
    """Base of walls: a plane that may move, with points on the side of its normal."""

    def lay(self, place: Sequence[Expression], normal: Sequence[Expression]) -> None:
        """Check the formulas of a place in the plane, and of its normal."""
        self.origin = self.of_time("", place)
        self.towards = self.of_time("n", normal)
        if not self.hub.rehearsing:  # which does not know all numbers
            unit(self.now(*self.towards))

    def depth(self, points: PointsView | PointTable) -> tuple[np.ndarray, np.ndarray]:
        """Measure how far (n,) points are behind the plane now, and find its normal (d,)."""
        normal = unit(self.now(*self.towards))
        return -(self.from_place(points, self.origin) @ normal), normal

    def depth_of(self, points: PointTable) -> np.ndarray:
        """Depth (n,) of points behind the plane now."""
        return self.depth(points)[0]


def _begin_behind(plane: Any, scene: Any) -> Any:
    """Count the points that are behind a surface before the first step, for words."""
    if scene.simulation.step > 0:
        return False
    counts, depths = zip(*scene.hub.fields.each(plane, "behind"), strict=True)
    count = sum(counts)
    which = "all" if count == len(plane.group) else f"{count} of {len(plane.group)}"
    return {"which": which, "depth": max(depths)} if count else False


known_failure(
    PlaneTool,
    "points behind the plane of fix '{part.id}'",
    when=_begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="the other direction of the normal, which shows where points may be, or another place of "
    "the plane or the body",
)


class ImpenetrableSurface(PlaneTool):
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
    A point at the depth p = n.(xs - x) > 0 gets the force K G (1 - D) p V^(1/d) along the normal. G
    is the shear modulus, D the damage, V the present volume and d the number of dimensions.
    Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    contact/minimize_penetration/plane, cuttingtool
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        xs: Expression, ys: Expression, zs: Expression,
        nx: Expression, ny: Expression, nz: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        self.K = K
        self.lay((xs, ys, zs), (nx, ny, nz))

    def forces(self, points: PointsView) -> np.ndarray:
        depth, normal = self.depth(points)
        push = self.now(self.K) * self.stiffness(points) * np.maximum(depth, 0) * self.side(points)
        return push[:, None] * normal


class ContactMinimizePenetrationPlane(PlaneTool):
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
    one reaches p = rp - n.(x - xq) > 0 into the plane it gets the force m p / dt^2. This takes a
    free point out within one step. Friction is mu times that, against the slip, and at most stops
    it (de Vaucorbeil & Nguyen 2021). A moving plane does not drag.

    Publishes the force on the solid as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, contact/minimize_penetration, indent/minimize_penetration
    """

    impulsive = True

    def __init__(
        self, hub: Hub, solid: Solid, x: Expression, y: Expression, z: Expression,
        nx: Expression, ny: Expression, nz: Expression, mu: Annotated[float, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, ParticleGroup.of(hub, solid))
        self.mu = mu
        judge_friction(hub, mu)
        self.lay((x, y, z), (nx, ny, nz))

    def forces(self, points: PointsView) -> np.ndarray:
        depth, normal = self.depth(points)
        return penalty(points, self.side(points) / 2 + depth, normal, 0.0, self.mu)


class ContactSurface(ToolFix):
    """Let points touch the surface of a region, which may move, with friction.

    Parameters
    ----------
    region
        The region that pushes points out. It needs an inside: a mesh of solid elements (in the
        plane of area elements), a closed STL surface, or a plane. With the word ``exterior`` it is
        a mould.
    mu
        Coefficient of friction (Coulomb); 0 when left out.
    way
        ux, uy, uz, as many as the domain has dimensions: how far the region has moved, formulas of
        time. Left out it stays.

    Example
    -------
    fix(ground, contact/surface, all, wall, 0.2)
    fix(press, contact/surface, all, disk, 0.1, 0, -0.5*time, 0)

    Notes
    -----
    Publishes the force on the points as ID_x, ID_y, ID_z.

    Points are balls. Their radius is half the side of a cube of their present volume. A point at
    the depth p that approaches with the speed v gets the force m (v / dt + p / (10 dt^2)) out of
    the region. This stops the point within one step and removes a tenth of p. The force never
    pulls. Friction is mu times this force, against the slip on the moving region, and at most what
    stops the slip.

    The force acts in the direction in which the depth falls fastest. A point deeper than a cell, or
    in the middle of a thin region, ends the run. A region does not turn.

    A block on a slope of 20 degrees with mu = 0.2 has the acceleration 1.54 in tlmpm and 1.56 in
    ulmpm (exact 1.541; points=cut). Its energy is balanced to 0.3 %. It sinks in by ten times the
    force on a point over m / dt^2, here a twentieth of a cell.

    See Also
    --------
    contact/minimize_penetration/plane, contact/friction, region mesh, region stl
    """

    syntax = "group, region[, mu[, ux[, uy[, uz]]]]"
    impulsive = True

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
                f"region '{region.id}' has lines or surfaces, which nothing can be in",
                argument="region",
                expected="a region with an inside: a mesh of elements of volume (in 2D of area), "
                "a closed STL surface, a block, ...",
            )
        self.region, self.mu = region, mu
        judge_friction(hub, mu)
        self.way = self.of_time("u", way) if way else ()

    def moved(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Find the way (d,) of the region so far, and its mean velocity (d,) in the next step."""
        values, times = self.hub.values, {"time": self.hub.update.time + np.array([0.0, dt])}
        ways = np.zeros((self.hub.domain.dimension, 2))
        for k, formula in enumerate(self.way):
            ways[k] = formula.evaluate_columns(values, times)
        return ways[:, 0], (ways[:, 1] - ways[:, 0]) / dt

    def depth(self, x: np.ndarray) -> np.ndarray:
        """Depth (n,) of positions that move with the region, a cell at most."""
        return self.region.depth(x, self.hub.domain.h)

    def depth_of(self, points: PointTable) -> np.ndarray:
        """Depth (n,) of points in the region now."""
        return self.depth(points.position.astype(float) - self.moved(1.0)[0])

    def faces_of(self) -> np.ndarray | None:
        """Faces (m, d, d) of the region now, if it is made of them."""
        skin = getattr(self.region, "skin", None)
        return None if skin is None else skin.faces + self.moved(1.0)[0]

    def forces(self, points: PointsView) -> np.ndarray:
        way, velocity = self.moved(points.dt)
        x = points.position.astype(float) - way
        within = self.depth(x)
        depth = within + self.side(points) / 2
        normal, near = np.zeros_like(x), np.flatnonzero(depth > 0)
        aside = 0.05 * self.hub.domain.h
        for k, step in enumerate(aside * np.eye(x.shape[1])):
            normal[near, k] = self.depth(x[near] - step) - self.depth(x[near] + step)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, size, out=np.zeros_like(x), where=size > 1e-3 * aside)
        lost = np.flatnonzero((within > 0) & (size[:, 0] <= 1e-3 * aside))
        if len(lost):
            raise ScriptError(
                f"{named(self.hub, int(points.ids[lost[0]]) - 1)} is so deep in region "
                f"'{self.region.id}' of fix '{self.id}' that no way out of it is the shortest",
                place=self.place,
                expected="points that come less than a cell below the surface",
                hint="smaller steps (dt_factor), a stiffer body, or a region that moves more "
                "slowly, or is thicker",
            )
        # A spring alone, which takes all penetration out within a step, throws bodies back.
        closing = ((velocity - points.velocity.astype(float)) * normal).sum(axis=1)
        push = np.where(depth > 0, SOFT * depth + points.dt * closing, 0.0)
        return penalty(points, push, normal, velocity, self.mu)


known_failure(
    ContactSurface,
    "points in the region of fix '{part.id}'",
    when=_begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="the word exterior for what is to hold the points, or another place of the region or the "
    "body",
)


class Radius(Expression):
    """For signatures: a radius above 0, which Karamelo had behind the centre in 2020."""

    script_kind = "a number or a formula above 0"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Expression:
        radius = super().from_script(hub, argument)
        if radius.is_constant and not radius.constant > 0:
            ID, style, group, kind, K, *centre, R = words_of(argument.statement)
            line = ", ".join([ID, style, group, kind, K, R, *centre])
            raise ScriptError(
                f"the radius is {radius.constant:g}",
                place=argument.place,
                expected="a number above 0",
                hint=f"with the radius in front of the centre: fix({line})",
            )
        return radius


class BallTool(ToolFix):
    """Base of balls (in the plane disks), of a `centre` and a radius `R`.

    Parameters
    ----------
    kind
        The word ``sphere``.
    R
        Radius of the ball: a number or a formula of time.
    x, y, z
        Its centre: numbers or formulas of time; z is 0 in the plane.
    """

    published = ("x", "y", "z", "s")
    R: Expression
    centre: tuple[Expression, ...]

    def depth_of(self, points: PointTable) -> np.ndarray:
        """Depth (n,) of points in the ball now."""
        return self.now(self.R) - np.linalg.norm(self.from_place(points, self.centre), axis=1)


known_failure(
    BallTool,
    "points in the ball of fix '{part.id}'",
    when=_begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="another place of the ball or the body",
)


class Indent(BallTool):
    """Push points out of a ball (in the plane a disk) with a force that grows as depth squared.

    Parameters
    ----------
    K
        Acceleration per depth squared: a number or a formula of time.

    Example
    -------
    fix(ball, indent, all, sphere, 1e4, 0.2, 0.5, 1.2 - 0.1*time, 0)

    Notes
    -----
    A point at the distance r < R from the centre gets the force m K (R - r)^2 away from it.
    ``fix indent`` of LAMMPS does the same, but not per mass. Publishes the force on the points as
    ID_x, ID_y, ID_z and the number of pushed points as ID_s.

    See Also
    --------
    indent/minimize_penetration, impenetrablesurface
    """

    def __init__(
        self, hub: Hub, group: ParticleGroup, kind: Literal["sphere"],
        K: Annotated[Expression, NonNegative], R: Radius,
        x: Expression, y: Expression, z: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        self.K, self.R = K, R
        self.centre = self.of_time("", (x, y, z))

    def forces(self, points: PointsView) -> np.ndarray:
        K, R = self.now(self.K, self.R)
        away = self.from_place(points, self.centre)
        r = np.linalg.norm(away, axis=1)
        depth = np.maximum(R - r, 0)
        self.publish("s", points.total(depth > 0))
        push = points.mass.astype(float) * K * depth**2
        size = np.divide(push, r, out=np.zeros_like(r), where=r > 0)
        return size[:, None] * away


class IndentMinimizePenetration(BallTool):
    """Press a rigid ball (in the plane a disk) into points, as stiffly as the step allows.

    Parameters
    ----------
    vx, vy, vz
        Its velocity, which friction needs: the centre does not follow from it.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(ball, indent/minimize_penetration, all, sphere, 0.2, 0.5, 1.2 - time, 0, 0, -1, 0, 0.1)

    Notes
    -----
    Points are balls, too, with the radius rp of half the side of a cube of their present volume.
    One at the distance r from the centre overlaps by p = R + rp - r. With p > 0 it gets the force m
    p / dt^2. This takes a free point out within one step. Friction is mu times that, against the
    slip, and at most stops it (de Vaucorbeil & Nguyen 2021).

    Publishes the force on the points as ID_x, ID_y, ID_z and the area of contact as ID_s. Each
    touching point counts as one face of its cube.

    See Also
    --------
    indent, contact/minimize_penetration/plane, contact/minimize_penetration
    """

    impulsive = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, kind: Literal["sphere"],
        R: Annotated[Expression, NonNegative], x: Expression, y: Expression, z: Expression,
        vx: Expression, vy: Expression, vz: Expression, mu: Annotated[float, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, group)
        self.R, self.mu = R, mu
        judge_friction(hub, mu)
        self.centre = self.of_time("", (x, y, z))
        self.velocity = self.of_time("v", (vx, vy, vz))

    def forces(self, points: PointsView) -> np.ndarray:
        away = self.from_place(points, self.centre)
        r = np.linalg.norm(away, axis=1, keepdims=True)
        normal = np.divide(away, r, out=np.zeros_like(away), where=r > 0)
        depth = self.now(self.R) + self.side(points) / 2 - r[:, 0]
        self.publish("s", points.total(self.face(points) * (depth > 0)))
        return penalty(points, depth, normal, self.now(*self.velocity), self.mu)


class CuttingTool(ToolFix):
    """Push points out of the tip of a rigid tool, in the plane.

    Parameters
    ----------
    K
        Stiffness of the tool in shear moduli of the point: a number or a formula of time.
    x_tip, y_tip, z_tip
        The tip: numbers or formulas of time; z is 0.
    vx, vy, vz
        Its velocity, which scripts of Karamelo give; there is no friction that would need it.
    xA, yA, xB, yB
        A point on each of the two faces that meet in the tip: numbers or formulas of time.

    Example
    -------
    fix(tool, cuttingtool, all, 1, 1 - time, 0.5, 0, -1, 0, 0, 1.1 - time, 0.9, 1.4 - time, 0.55)

    Notes
    -----
    The tool lies between the two faces. A point in it, at the depth p from the nearer face, gets
    the force K G (1 - D) p out of that face (de Vaucorbeil & Nguyen 2021). G is the shear modulus
    and D the damage. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, meldtool
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        x_tip: Expression, y_tip: Expression, z_tip: Expression,
        vx: Expression, vy: Expression, vz: Expression,
        xA: Expression, yA: Expression, xB: Expression, yB: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        if hub.domain.dimension != 2:
            raise ScriptError("the tool is one in the plane", expected="a domain in 2D")
        self.K = K
        self.tip = self.of_time("", (x_tip, y_tip, z_tip))
        self.ends = (xA, yA), (xB, yB)
        if not hub.rehearsing:  # which does not know all numbers
            self._faces()

    def _faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (2, 2) out of the tool, of the faces to A and to B, and the tip."""
        tip = self.now(*self.tip)
        a, b = (self.now(*end) - tip for end in self.ends)
        turn = a[0] * b[1] - a[1] * b[0]
        if not abs(turn) > 0:
            raise ScriptError("tip, A and B lie in one line", expected="two faces with an angle")
        # Turned away from the other face.
        normals = np.array([[a[1], -a[0]], [-b[1], b[0]]]) * np.sign(turn)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True), tip

    def depth_of(self, points: PointTable) -> np.ndarray:
        """Depth (n,) of points in the tool now, below the nearer face."""
        normals, tip = self._faces()
        return ((tip - points.position.astype(float)) @ normals.T).min(axis=1)

    def forces(self, points: PointsView) -> np.ndarray:
        normals, tip = self._faces()
        depths = (tip - points.position.astype(float)) @ normals.T
        nearer = depths.argmin(axis=1)
        depth = np.maximum(depths.min(axis=1), 0)
        return (self.now(self.K) * self.stiffness(points) * depth)[:, None] * normals[nearer]


class MeldTool(ToolFix):
    """Push points out of the tool of additive friction stir deposition, in space.

    Parameters
    ----------
    K
        Stiffness of the tool in shear moduli of the point, times a length: a number or a formula of
        time, as are all that follow.
    axis
        The word x, y or z: the direction of the axis.
    half_width
        Half the width of the square channel along the axis.
    c1, c2
        The axis in the other two directions, in the order x, y, z.
    theta
        Angle by which the tool has turned, from the first of these directions to the second.
    lo, hi
        Ends of the tool along the axis; points are pushed out at the lower one.
    Rmax
        Radius of the tool.

    Example
    -------
    fix(tool, meldtool, all, 1, y, 0.1, 0.5, 0.5, 10*time, 0.6, 1, 0.3)

    Notes
    -----
    The tool is a cylinder without its channel. A point in it gets the force K G (1 - D) times the
    shortest way out: into the channel, out of the cylinder, or below its end. G is the shear
    modulus and D the damage. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    cuttingtool, impenetrablesurface
    """

    needs_stiffness = True

    def __init__(
        self, hub: Hub, group: ParticleGroup, K: Annotated[Expression, NonNegative],
        axis: Literal["x", "y", "z"], half_width: Annotated[Expression, NonNegative],
        c1: Expression, c2: Expression, theta: Expression, lo: Expression, hi: Expression,
        Rmax: Annotated[Expression, NonNegative],
    ):  # fmt: skip
        super().__init__(hub, group)
        if hub.domain.dimension != 3:
            raise ScriptError("the tool is one in space", expected="a domain in 3D")
        self.numbers = (K, half_width, c1, c2, theta, lo, hi, Rmax)
        self.now(*self.numbers)  # refuses those of places
        self.along = "xyz".index(axis)
        self.across = [k for k in range(3) if k != self.along]

    def _seen(self, points: Any, *at: float) -> tuple[np.ndarray, ...]:
        """Heights (n,) of points above the end, and their places (n, 2): as they are and turned."""
        c1, c2, theta, lo = at
        x = points.position.astype(float)
        q = x[:, self.across] - np.array([c1, c2])
        turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
        return x[:, self.along] - lo, q, q @ turn.T, turn

    def depth_of(self, points: PointTable) -> np.ndarray:
        """Depth (n,) of points in the tool now."""
        _, w, c1, c2, theta, lo, hi, Rmax = self.now(*self.numbers)
        height, q, own, _ = self._seen(points, c1, c2, theta, lo)
        ways = height, hi - lo - height, Rmax - np.linalg.norm(q, axis=1), abs(own).max(axis=1) - w
        return np.min(ways, axis=0)

    def forces(self, points: PointsView) -> np.ndarray:
        K, w, c1, c2, theta, lo, hi, Rmax = self.now(*self.numbers)
        height, q, own, turn = self._seen(points, c1, c2, theta, lo)
        r = np.linalg.norm(q, axis=1)
        inward = (np.clip(own, -w, w) - own) @ turn
        outward = q * np.divide(Rmax - r, r, out=np.zeros_like(r), where=r > 0)[:, None]
        # The ways out (n, 3): into the channel, radially, below; and how long they are.
        ways = np.zeros((3, len(r), 3))
        ways[0][:, self.across] = inward
        ways[1][:, self.across] = outward
        ways[2][:, self.along] = -height
        shortest = np.linalg.norm(ways, axis=2).argmin(axis=0)
        inside = (height >= 0) & (height <= hi - lo) & (r <= Rmax)
        way = ways[shortest, np.arange(len(r))] * inside[:, None]
        return (K * self.stiffness(points))[:, None] * way
