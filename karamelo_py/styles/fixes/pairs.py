"""Fixes for contact between two solids."""

from functools import partial
from math import inf
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels import pairs
from karamelo_py.kernels.arrays import Block, Matter
from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.language.rules import FLAT, Restrictions, gain
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.bodies import Hertz, MinimizePenetration, Springs
from karamelo_py.points.laws import elastic_law, parameter, specific_volume
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.absorbing import speeds
from karamelo_py.styles.fixes.forces import torques
from karamelo_py.styles.fixes.formulas import judge_friction
from karamelo_py.styles.fixes.grip import Gripping

SENT = 350  # bytes per point sent to the process that searches for pairs


def check_pair(solid1: Solid, solid2: Solid) -> None:
    if solid1 is solid2:
        message = f"'{solid2.id}' is named twice"
        raise ScriptError(message, argument="solid2", expected="another solid than the first")


class PairContact(Gripping):
    """Contact between points of two solids; rank 0 searches for pairs."""

    by_sizes = True

    published = ("x", "y", "z")
    point_fields = (Force, WorkOfForces)
    point_by_point = exerts = True
    conserves = True  # except the work of the forces, which is summed
    has_faces = False
    room = 1.0  # distance at which points touch / sum of their radii

    def __init__(self, hub: Hub, solid1: Solid, solid2: Solid):
        super().__init__(hub, ParticleGroup(hub, everything=True))
        check_pair(solid1, solid2)
        self.solids = (solid1, solid2)
        method = hub.update.method
        if not method.own_grids:
            hub.warn(
                "solids on one grid are in contact there already; this fix adds further forces",
                hint="method(tlmpm, ...) uses a separate grid for each solid"
                + (
                    "; fix contact/friction is for the contact on the grid"
                    if method.fields_per_solid
                    else "; method(ulmpm/contacts, ...) lets them slide and separate"
                ),
            )
        ranges = [(solid.first_id, solid.first_id + solid.count) for solid in self.solids]
        self._ranges = (*ranges[0], *ranges[1])
        self._reach = max(solid.h for solid in self.solids)

    def defined(self) -> None:
        for other in self.hub.fixes.values():
            same = isinstance(other, PairContact) and set(other.solids) == set(self.solids)
            if same and other is not self:
                first, second = other.solids
                raise ScriptError(
                    f"fix '{other.id}' (line {other.mark.line}) is the contact of '{first.id}' and "
                    f"'{second.id}' already, and forces of both would add up",
                    argument="solid2",
                    expected="one contact for each pair of solids",
                    hint=f"delete_fix({other.id}) before this line, or the ID {other.id} here",
                    mark=self.mark,
                    command=f"fix {self.style}",
                )

    def law(self) -> NamedTuple:
        """Return the tag of the force law between two points (:mod:`karamelo_py.points.bodies`).

        The method is called in each step, since constants may change between runs.
        """
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        simulation, total, turning = self.hub.simulation, np.zeros(3), np.zeros(6)
        kin, blocks = simulation.kin, simulation.setup.blocks
        rows = self._near(simulation)
        d, grips = kin.dimension, [field(block.points.fields, self.grip) for block in blocks]
        self.begin_to_touch()
        if rows is not None:
            tables = [
                self._known(simulation, *one) for one in zip(blocks, rows, grips, strict=True)
            ]
            last = float(simulation.control.step[0].last_dt)
            push = partial(self._push, kin, (last, points.contact_dt, points.contact_kick))
            result, total, turning = simulation.comm.at_first(push, np.concatenate(tables))
        for block, grip, k in zip(blocks, grips, range(len(blocks)), strict=True):
            if grip is not None:
                grip[:] = 0
            if rows is not None:
                some = rows[k]
                field(block.points.fields, Force)[:d, some] += result[: len(some), :d].T
                if grip is not None:
                    grip[:, some] = result[: len(some), d:].T
                result = result[len(some) :]
        self.publish_components(total)
        torque = self.hub.values.torque_of(self.id)
        torque[:] = turning[: len(torque)]

    def sent(self, simulation: Any) -> int:
        """Return the number of points that may touch."""
        return sum(map(len, self._near(simulation) or ()))

    def _near(self, simulation: Any) -> list[np.ndarray] | None:
        """Return rows of points in the overlap of the two solids' extended boxes, or None."""
        s, d = simulation.setup, simulation.kin.dimension
        extents = np.full((2, 7), -np.inf)
        for block in s.blocks:
            x, ids = block.points.x[simulation.now], pairs.OneOfTwo(*self._ranges)
            pairs.extend(Matter(s.kin, block.points, block.laws), x, ids, extents)
        extents = simulation.comm.allreduce_max(extents)
        width = min(self.room * extents[:, 6].sum(), self._reach)
        low, high = -extents[:, :d].min(axis=0) - width, extents[:, 3 : 3 + d].min(axis=0) + width
        if (low > high).any():
            return None
        near = []
        for block in s.blocks:
            x, rows = block.points.x[simulation.now], np.empty(block.points.id.size, np.int64)
            matter, ids = Matter(s.kin, block.points, block.laws), pairs.OneOfTwo(*self._ranges)
            count = pairs.pick(matter, x, ids, np.stack([low, high]), rows)
            near.append(self.at_surface(block, rows[:count]).copy())
        return near

    def at_surface(self, block: Block, rows: np.ndarray) -> np.ndarray:
        """Return the rows of points that may touch the other solid."""
        return rows

    def faces(self, simulation: Any, block: Block, rows: np.ndarray) -> np.ndarray:
        """Return `points.bodies.Face` (n, d + 3) of points, or (n, 0)."""
        return np.empty((len(rows), 0))

    def _known(self, simulation: Any, block: Block, rows: np.ndarray, grip: Any) -> np.ndarray:
        table = np.empty((len(rows), 3 + 2 * simulation.kin.dimension))
        matter = Matter(simulation.kin, block.points, block.laws)
        pairs.collect(matter, block.points.x[simulation.now], rows, table)
        faces = self.faces(simulation, block, rows)
        if self.has_faces:
            near, wide = faces[:, -3:-1].T
            table[:, 2] = np.hypot(near + wide / 2, wide / 2)
        parts = [table, faces] if grip is None else [table, faces, grip[:, rows].T]
        return np.concatenate(parts, axis=1)

    def _push(
        self, kin: Any, times: tuple[float, float, float], tables: list[np.ndarray]
    ) -> list[tuple]:
        """Return forces and grips of the points of each process, the total force, and torques."""
        of_all, d = np.concatenate(tables), kin.dimension
        begin, end = self._ranges[:2]
        second = (of_all[:, 0] < begin) | (of_all[:, 0] >= end)
        order = np.lexsort((of_all[:, 0], second))
        n = len(order)
        of_all = of_all[order]
        _, mass, radius = np.ascontiguousarray(of_all[:, :3].T)
        ends = np.cumsum([d, d, (d + 3) * self.has_faces])
        x, v, face, grip = map(np.ascontiguousarray, np.split(of_all[:, 3:], ends, axis=1))
        first2 = n - int(second.sum())
        bodies = pairs.TwoBodies(x, v, mass, radius, np.zeros((n, d)), grip, face, first2)
        cells = pairs.cells_for(n)
        pairs.push_apart(pairs.Push(self.law(), kin, self._reach, *times), bodies, cells)
        force = np.empty((n, d + grip.shape[1]))
        force[order] = np.concatenate([bodies.force, bodies.grip], axis=1)
        ends = np.cumsum([len(one) for one in tables])[:-1]
        turning = np.zeros(6)
        if len(self.hub.values.torque_of(self.id)):
            each, first = torques(x, bodies.force), bodies.first2
            turning = np.concatenate([each[:first].sum(axis=0), each[first:].sum(axis=0)])
        return [(rows, cells.total, turning) for rows in np.split(force, ends)]


gain(
    PairContact,
    when=lambda fix, scene: True,
    cause="contact between points",
    cure="a smaller step, or method ulmpm/contacts",
)


class ContactMinimizePenetration(PairContact):
    """Apply point-to-point contact of two solids, as stiff as the step allows, with friction.

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids.
    mu
        Coefficient of friction (Coulomb).
    stiffness
        Stiffness of the contact per area, over the stiffness rho c^2 / h of a cell (c: speed of
        P waves), at most what the step allows, which is the stiffness without this argument.

    Example
    -------
    fix(touch, contact/minimize_penetration, ball, plate, 0.4)
    fix(touch, contact/minimize_penetration, left, right, stiffness=0.25)

    Notes
    -----
    Publishes the force on solid1 as ID_x, ID_y, ID_z; the force on solid2 is the opposite.

    Points are spheres (in 2D disks) with a radius R of half the side of a cube (in 2D a square) of
    their present volume. Two points with the penetration p = R1 + R2 - |x2 - x1| > 0 get the force
    m1 m2 / (m1 + m2) p / dt^2, which separates free points within one step. Friction, at most mu
    times this force, stops and reverses the slip (de Vaucorbeil & Nguyen 2021, "Modelling contacts
    with a total Lagrangian material point method"): a point at rest is displaced by at most mu p.

    In this formula, dt is the regular step, not one shortened to end a run on time. If the step
    drops suddenly, this dt decreases gradually, by 1 % of the new step in each step.

    Stiff contact takes kinetic energy of the nodes at a surface, more with smaller steps. With
    ``stiffness=0.25`` the force does not depend on the step, and elastic bodies that collide at up
    to 4 % of the wave speed lose less: rods of 10, 20 and 40 cells (tlmpm, PolyPIC, usl) 0.5, 0.2
    and 0.1 %, without it 3.1, 1.0 and 0.6 %; disks of 8 and 16 cells, with a third of the step, 0.7
    and 0.3 %, without it 2.6 and 1.2 %. Contact is softer, too. Surfaces overlap by 4 h times the
    strain of the contact pressure, and rods touch for 3 h/c longer: a rod of 10 cells gives one of
    20 cells 9 % too much momentum, without it 4 %. An overlap of more than a tenth of R1 + R2 is
    resisted as without ``stiffness``.

    Surfaces made of spheres are rough: the force to push a block (two points per cell and
    direction) is 0.19, 0.47, 0.57 and 0.52 of its weight with mu = 0, 0.3, 0.5 and 1. Faces
    inclined to the grid interlock: on a slope of 20 degrees with mu = 0, a block sticks, or with
    points=cut accelerates at 2.8 instead of 3.4 m/s^2. Friction is correct with contact/solids.

    The cost is proportional to the number of points that may touch. With several processes, the
    first one searches for all contacts.

    See Also
    --------
    contact/solids, contact/hertz, method tlmpm
    """

    impulsive = True

    def __init__(
        self,
        hub: Hub,
        solid1: Solid,
        solid2: Solid,
        mu: Annotated[float, NonNegative] | None = None,
        *,
        stiffness: Annotated[float, Positive] | None = None,
    ):
        super().__init__(hub, solid1, solid2)
        self.rubs(hub, float(mu or 0.0))
        self.rate = None if stiffness is None else stiffness * self._rate_of_cells()
        if mu is not None and hub.domain.dimension > 1:
            hub.warn(
                f"friction {mu:g} does not act as given: surfaces of balls slow a sliding body "
                "with about 0.2 of the normal force for a coefficient of 0, 0.5 for any above "
                "0.3, and more if faces are inclined to the grid",
                hint="fix contact/solids has smooth surfaces, as has method(ulmpm/contacts, ...) "
                "with fix contact/friction; leave mu out if nothing slides",
            )

    def law(self) -> MinimizePenetration | Springs:
        return MinimizePenetration(self.mu) if self.rate is None else Springs(self.mu, self.rate)

    def _rate_of_cells(self) -> float:
        """Return (rho c^2 / h) over the reduced mass per area of two points."""
        flexibility = per_mass = 0.0
        for solid in self.solids:
            rho, (fast, _) = 1 / specific_volume(solid.material.law), speeds(solid.material)
            flexibility += 0.5 * solid.h / (rho * fast * fast) if fast > 0 else 0.0
            per_mass += 1 / (rho * 2 * solid.half_size.mean())
        if not flexibility > 0:
            raise ScriptError(
                "no wave speed is known of the two solids",
                argument="stiffness",
                expected="at least one solid that is not rigid, or no stiffness",
            )
        return float(per_mass / flexibility)


def plane_modulus(solid: Solid, argument: str) -> float:
    """Return E / (1 - nu^2) = 4 G (lambda + G) / (lambda + 2 G)."""
    law = elastic_law(solid.material.whole)
    G, lam = parameter(law, "G", None), parameter(law, "lam", None)
    if G is None or lam is None or not G > 0:
        message = f"material '{solid.material.id}' of solid '{solid.id}' has no elastic moduli"
        expected = "a solid of a material with Young's modulus and Poisson's ratio"
        raise ScriptError(message, argument=argument, expected=expected)
    return 4 * G * (lam + G) / (lam + 2 * G)


class ContactHertz(PairContact):
    """Apply point-to-point contact of two solids with Hertz forces, without friction.

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids, whose materials must have a Young's modulus and a Poisson's ratio.

    Example
    -------
    fix(touch, contact/hertz, ball, plate)

    Notes
    -----
    Points are spheres as in contact/minimize_penetration. Two points that overlap by p repel each
    other with 4/3 E* sqrt(R p^3) in 3D and pi/4 E* sqrt(R p^3) otherwise, where R = R1 R2 / (R1 +
    R2) and 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2. The law is meant for bodies of a single point
    each: larger ones overlap noticeably before the force is large, and may pass through each other.

    Publishes the force on solid1 as ID_x, ID_y, ID_z; the force on solid2 is the opposite. With
    several processes, the first one searches for pairs.

    See Also
    --------
    contact/minimize_penetration, method tlmpm
    """

    # Points of axisymmetric, cylindrical or spherical scenes are rings or shells, not balls.
    restrictions = Restrictions("hertz", "minimize_penetration", only={"kinematics": FLAT})

    def __init__(self, hub: Hub, solid1: Solid, solid2: Solid):
        super().__init__(hub, solid1, solid2)
        self.law()  # refuses materials without moduli

    def law(self) -> Hertz:
        named = zip(self.solids, ("solid1", "solid2"), strict=True)
        return Hertz(1 / sum(1 / plane_modulus(*one) for one in named))


class ContactFriction(Fix):
    """Set the friction between two solids in contact on the grid (method ulmpm/contacts).

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids. Each pair needs a fix; contact of other pairs is frictionless.
    mu
        Coefficient of friction (Coulomb); or ``no-slip``: the solids stick while pressed together.

    Example
    -------
    fix(rub, contact/friction, block, base, 0.3)

    Notes
    -----
    Publishes the contact force of solid2 on solid1 as ID_x, ID_y, ID_z.

    Friction acts on a liquid or gas at nodes within half a cell of the surface of a rigid solid.

    Frictional work heats solids with a temperature: each gets half of the work, or all of the work
    if the other has no temperature. With ``thermo-mechanical``, it is divided in proportion to the
    effusivities sqrt(kappa rho cp), as between half-spaces.

    See Also
    --------
    contact/minimize_penetration, method ulmpm/contacts
    """

    syntax = "solid1, solid2, mu|no-slip"
    published = ("x", "y", "z")
    for_method = exerts = True

    def __init__(
        self,
        hub: Hub,
        solid1: Solid,
        solid2: Solid,
        mu: Annotated[float, NonNegative] | Literal["no-slip"],
    ):
        super().__init__(hub)
        check_pair(solid1, solid2)
        method = hub.update.method
        if not method.fields_per_solid:
            raise ScriptError(
                "contact/friction needs a velocity field per solid",
                expected="method(ulmpm/contacts, ...)",
                hint="in ulmpm solids that meet on the grid stick together; "
                "for tlmpm there is fix contact/solids",
            )
        a, b = (method.lattice_of(hub, solid) for solid in (solid1, solid2))
        if a == b:
            message = f"solids '{solid1.id}' and '{solid2.id}' are glued together: they never slide"
            raise ScriptError(message, argument="solid2")
        self.solids = (solid1, solid2)
        self.friction = inf if mu == "no-slip" else float(mu)
        if mu != "no-slip":
            judge_friction(hub, self.friction)
