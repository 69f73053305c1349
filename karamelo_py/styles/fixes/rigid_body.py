"""Rigid bodies, and their contact with points."""

from collections.abc import Sequence
from math import inf
from typing import Annotated, Any

import numpy as np

from karamelo_py.kernels import rigid_motion as kernel
from karamelo_py.kernels.equations import RigidSums
from karamelo_py.kernels.free_bodies import GRIP
from karamelo_py.language.arguments import NULL
from karamelo_py.language.explain import comma_in_number
from karamelo_py.language.rules import Restrictions, known_failure
from karamelo_py.language.signature import Argument, NonNegative, Positive
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid, named
from karamelo_py.script.errors import ScriptError, blaming, plural
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import judge_friction
from karamelo_py.styles.fixes.tools.base import begin_behind

FIELDS = {"": "x", "r": "angle", "v": "v", "w": "spin", "f": "force", "t": "torque"}
WAYS = "x", "y", "z", "rx", "ry", "rz"
NOT_ROUND = 1e-9  # relative tolerance of moments of inertia


class Components:
    """Script argument: formulas in parentheses; NULL leaves a component free."""

    script_kind = "formulas: a, or (a, b)"

    def __init__(self, argument: Argument, items: list[Expression | None]):
        self.argument, self.items = argument, items

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "Components":
        parts = argument.listed()
        return cls(argument, [None if p.text == NULL else Expression(p.value(hub)) for p in parts])

    def numbers(self) -> list[float]:
        if not all(item is not None and item.is_constant for item in self.items):
            raise ScriptError(
                f"{self.argument.text} is not a fixed number", mark=self.argument.mark,
                expected="numbers", hint="motion and turning take formulas of time",
            )  # fmt: skip
        return [float(item.constant) for item in self.items if item is not None]


def _wrong(argument: Argument, message: str, expected: str) -> ScriptError:
    return ScriptError(message, mark=argument.mark, expected=expected)


class RigidBody(Fix):
    """Move a rigid solid by the forces on it.

    Parameters
    ----------
    solid
        ID of the solid, which must have the material rigid.
    velocity, spin
        Initial velocity of the centre of mass (one number per dimension) and initial angular
        velocity (one number in 2D, three in 3D).
    gravity
        Gravitational acceleration, one formula per dimension.
    force, torque
        Additional force at the centre and torque about it: functions of time and published values.
    motion, turning
        Prescribed velocity of the centre and angular velocity. NULL leaves a component free.
    fixed
        Directions in which the body cannot move: any of x, y, z, and rx, ry, rz for rotation.
    pivot
        Position about which the body rotates, as on a hinge or a ball joint.
    mass
        Mass; default: the mass of the points. In axisymmetry, masses and forces are per radian.
    inertia
        Moment of inertia about the centre in 2D; in 3D three moments, about axes x, y, z through
        the centre at the start. Default: computed from the points (squares or cubes) and the mass.

    Example
    -------
    fix(move, rigid_body, ball, velocity=(1, 0), gravity=(0, -9.81))
    fix(roll, rigid_body, wheel, gravity=(0, -9.81), turning=2*PI, fixed=(x))

    Notes
    -----
    Publishes the centre ID_x, ID_y, ID_z; the velocity ID_vx, ...; the rotation ID_rx, ...; the
    angular velocity ID_wx, ...; the contact force ID_fx, ..., and its torque about the centre,
    ID_tx, ... In 2D these are x, y, vx, vy, rz, wz, fx, fy, tz. In 3D the rotation is a vector
    along the axis, with the angle (at most PI) as its length.

    In ulmpm/contacts the body is in contact with other solids on the grid (friction: fix
    contact/friction); in other methods use fix contact/rigid_body. Velocities at the end of the
    step and all contact impulses are solved together, so a light body may touch heavy ones.
    Momentum is conserved to round-off. Velocities belong to the middle of a step, unless
    scheme(..., start=half).

    Formulas may contain published values of this fix: force=(-k*(ID_x - x0), 0) is a spring. To
    release a body between runs, repeat the line without fixed: the new fix replaces this one, and
    the body retains its velocity. In axisymmetry, bodies move only along the axis. Rigid bodies
    pass through held nodes, and, without fix contact/bodies, through each other.

    In load steps (scheme quasi-static) with ulmpm/contacts, loads and contact forces on the body
    are in equilibrium at the end of each step; velocities are displacements per unit time.

    See Also
    --------
    contact/rigid_body, contact/bodies, joint, velocity_particles, method ulmpm/contacts
    """

    syntax = (
        "solid[, velocity=(vx, vy, vz)][, spin=w][, gravity=(gx, gy, gz)][, force=(fx, fy, fz)]"
        "[, torque=t][, motion=(ux, uy, uz)][, turning=w][, fixed=(x, rz)][, pivot=(x, y, z)]"
        "[, mass=m][, inertia=I]"
    )
    restrictions = Restrictions(
        "rigid_body", "a prescribed motion: fix velocity_particles",
        without=("delete", "reflect", "single", "pore_water", "ranks", "gpu"),
    )  # fmt: skip
    published = (
        "x", "y", "z", "rx", "ry", "rz", "vx", "vy", "vz", "wx", "wy", "wz",
        "fx", "fy", "fz", "tx", "ty", "tz",
    )  # fmt: skip
    for_method = True
    reads_itself = True
    remembers = ("memory",)
    reported = 0

    def __init__(
        self,
        hub: Hub,
        solid: Solid,
        *,
        velocity: Components | None = None,
        spin: Components | None = None,
        gravity: Components | None = None,
        force: Components | None = None,
        torque: Components | None = None,
        motion: Components | None = None,
        turning: Components | None = None,
        fixed: Argument | None = None,
        pivot: Components | None = None,
        mass: Annotated[float, Positive] | None = None,
        inertia: Components | None = None,
    ):
        super().__init__(hub)
        kin, self.moves, self.body = hub.domain.kin, solid, solid
        if not hub.update.method.fields_per_solid:
            self.node_fields = (RigidSums,)
        d = kin.dimension
        if not solid.rigid:
            raise ScriptError(
                f"solid '{solid.id}' deforms: its material '{solid.material.id}' is not rigid",
                argument="solid",
                expected="a solid of material rigid",
                hint=f"did you mean '{near}'?"
                if (near := next((one.id for one in hub.solids.values() if one.rigid), ""))
                else f"material({solid.material.id}, rigid, density)",
            )
        if kin.hoops and d == 1:
            expected = "a domain in 1D, 2D or 3D, or axisymmetric"
            message = f"a rigid body cannot move in a {kin.word} domain"
            raise ScriptError(message, argument="solid", expected=expected)
        spins = {1: (), 2: (5,), 3: (3, 4, 5)}[d] if not kin.hoops else ()
        moves = tuple(range(d)) if not kin.hoops else (1,)
        self.ways = (*moves, *spins)
        self.is_initial = velocity is not None, spin is not None
        self.previous = next((fix for fix in bodies_of(hub) if fix.body is solid), None)
        self.led = self._spread(motion, range(d)) + self._spread(turning, spins, 3)
        self._hold(fixed)
        self.pivot = self._held_at(pivot, velocity)
        free = [k for k in self.ways if self.led[k] is None]
        self.dofs = np.array([k in free for k in range(6)], np.int64)
        loads = self._spread(force, range(d)) + self._spread(torque, spins, 3)
        self.formulas_of_body = (*self.led, *loads, *self._spread(gravity, range(d)))
        start = self._spread(velocity, range(d)) + self._spread(spin, spins, 3)
        self.constants = kernel.records(kernel.CONSTANTS)
        self._weigh(solid, mass, None if inertia is None else inertia)
        self.state = kernel.records(kernel.STATE)
        self.numbers = self.state.view(np.float64).view(np.ndarray)
        state, velocities = self.state[0], np.zeros(6)
        state.x[:] = self.constants.start
        state.q[0] = 1
        kernel.set_matrix(state)
        for k, item in enumerate(start):
            if item is not None:
                velocities[k] = item.evaluate(hub.values)
            elif self.led[k] is not None and not hub.rehearsing:
                velocities[k] = self.led[k].evaluate(hub.values)
        state.v[:], state.spin[:] = velocities[:3], velocities[3:]
        self._refuse_another_start((velocity, spin), start, fixed)
        self._spin_up()
        self.published = tuple(name for name in self.published if self._has(name, d))
        self.has_load = any(item is not None for item in self.formulas_of_body)
        if self.previous is None:
            self._begin_points(solid)

    def _refuse_another_start(
        self, initial: tuple[Components | None, Components | None], start: list, fixed: Any
    ) -> None:
        for k, (item, formula) in enumerate(zip(start, self.led, strict=True)):
            components = initial[k // 3]
            if item is None or formula is None or components is None or self.hub.rehearsing:
                continue
            wanted, value = item.evaluate(self.hub.values), formula.evaluate(self.hub.values)
            if wanted != value:
                is_fixed = fixed is not None and WAYS[k] in [part.text for part in fixed.listed()]
                name = "fixed" if is_fixed else ("motion", "turning")[k // 3]
                message = f"it begins with {wanted:g} for {WAYS[k]}, but {name} sets {value:g}"
                raise _wrong(components.argument, message, f"NULL or {value:g} for {WAYS[k]}")

    @property
    def memory(self) -> np.ndarray:
        return self.numbers

    @memory.setter
    def memory(self, numbers: np.ndarray) -> None:
        self.numbers[:] = numbers

    def defined(self) -> None:
        before = self.previous
        if before and before.mark and before.id != self.id and before.id in self.hub.fixes:
            raise ScriptError(
                f"fix '{before.id}' in line {before.mark.line} moves '{self.body.id}' already",
                argument="solid",
                expected="one fix rigid_body for each solid",
                hint=f"fix({before.id}, rigid_body, {self.body.id}, ...) replaces it",
                mark=self.mark,
                command="fix rigid_body",
            )
        if before is None and self.hub.update.step > 0:
            raise ScriptError(
                f"solid '{self.body.id}' may have moved in earlier runs",
                mark=self.mark,
                expected="fix rigid_body before the first run",
                hint="fixed=(...) or motion=(...) until it is released: a fix with the same ID "
                "replaces it, and the body continues",
            )
        if before is not None and before.pivot != self.pivot:
            expected = "the same pivot, or none in both"
            raise ScriptError(
                f"fix '{self.id}' had another pivot", mark=self.mark, expected=expected
            )
        if before is not None:
            kept, self.previous = before.state.copy(), None
            if self.is_initial[0]:
                kept.v = self.state.v
            if self.is_initial[1]:
                kept.spin = self.state.spin
            if not self.hub.update.step:  # points may have been moved before the first step
                kept.x = self.state.x
            self.state[:] = kept
            self._spin_up()
        for slot, column in self.slots():
            self.hub.values.array[slot] = self.numbers[column]

    def deleted(self) -> None:
        touch: Any = next(iter(surfaces_of(self)), None)
        if touch is not None:
            raise ScriptError(
                f"fix '{touch.id}' (line {touch.mark.line}) is the contact with '{self.body.id}', "
                "which this fix moves",
                argument="ID",
                expected=f"delete_fix({touch.id}) in a line before",
            )

    def rigid_positions(self) -> np.ndarray:
        return self._moved(self.body.x0)

    def faces_of(self) -> np.ndarray | None:
        of_touch = [touch.region for touch in surfaces_of(self)]
        skin = next((one.skin for one in [*of_touch, self.body.region] if one), None)
        if skin is None:
            return None
        faces = np.asarray(skin.faces)
        return self._moved(faces.reshape(-1, faces.shape[2])).reshape(faces.shape)

    def _moved(self, x0: np.ndarray) -> np.ndarray:
        """Return the present positions (n, d) for initial positions."""
        d, arm = self.hub.domain.dimension, np.zeros((len(x0), 3))
        arm[:, :d] = x0
        arm -= self.constants.start
        return (self.state.x + arm @ self.state[0].R.T)[:, :d]

    def refresh(self) -> None:
        failed = int(self.state[0].failed)
        if failed > self.reported:
            bodies = [fix for fix in self.hub.fixes.values() if isinstance(fix, RigidBody)]
            alike = [fix for fix in bodies if fix.state[0].failed == failed]  # solved for together
            for fix in alike:
                fix.reported = 2 * failed
            names = ", ".join(f"'{fix.body.id}'" for fix in alike)
            self.hub.warn(
                f"impulses on {names} did not converge in {failed} steps",
                mark=self.mark,
                hint="smaller steps (dt_factor, set_dt), less friction, or a heavier body",
            )

    def slots(self) -> np.ndarray:
        slots = [self.hub.values.slot(f"{self.id}_{name}") for name in self.published]
        columns = [kernel.index_of(FIELDS[n[:-1]]) + "xyz".index(n[-1]) for n in self.published]
        return np.column_stack([slots, columns])

    def _has(self, name: str, d: int) -> bool:
        axis, kind = "xyz".index(name[-1]), name[:-1]
        if kind in ("r", "w", "t"):
            return 3 + axis in self.ways
        return axis < d

    def _spread(self, components: Components | None, ways: Sequence[int], size: int = 3) -> list:
        """Return a formula or None for each axis; `ways` are directions, rotations from 3 on."""
        items: list[Expression | None] = [None] * size
        if components is None:
            return items
        parts = components.argument.listed()
        if len(parts) != len(ways):
            expected, message = plural(len(ways), "formula"), plural(len(parts), "component")
            if not ways:
                message, expected = "the body does not rotate here", "no such argument"
            error = _wrong(components.argument, message, expected)
            if ", " in components.argument.text:
                error.hint = comma_in_number(parts, len(parts) - len(ways))
            elif len(parts) == 1 and ways:
                error.hint = f"such as ({'0, ' * (len(ways) - 1)}{parts[0].text})"
            raise error
        for way, item, part in zip(ways, components.items, parts, strict=True):
            items[way % 3] = item
            if item is None:
                continue
            with blaming(part.mark):
                item.evaluate(self.hub.values)
            if way not in self.ways and not (item.is_constant and float(item.constant) == 0):
                message = f"the body moves along the axis only, not along {WAYS[way]}"
                raise _wrong(part, message, "0")
        return items

    def _hold(self, fixed: Argument | None) -> None:
        allowed = [WAYS[k] for k in self.ways]
        parts = fixed.listed() if fixed else []
        for part in parts:
            name = part.text
            if name not in allowed:
                expected = "some of " + ", ".join(allowed)
                raise _wrong(part, f"the body has no direction '{name}'", expected)
            if [one.text for one in parts].count(name) > 1:
                raise _wrong(part, f"'{name}' is named twice", "each direction once")
            if self.led[WAYS.index(name)] is not None:
                word = "motion" if name in "xyz" else "turning"
                raise _wrong(part, f"{name} is fixed, and {word} prescribes it", "one of the two")
            self.led[WAYS.index(name)] = Expression(0.0)

    def _held_at(self, pivot: Components | None, velocity: Components | None) -> list[float]:
        """Return the pivot (3,) of the body, or [] without one."""
        if pivot is None:
            return []
        if max(self.ways) < 3:
            message = "a body that does not rotate has no pivot"
            raise _wrong(pivot.argument, message, "fixed=(...), or a domain in 2D or 3D")
        d = self.hub.domain.dimension
        position = self._spread(pivot, range(d)) if pivot.numbers() else []
        if velocity is not None or any(self.led[k] is not None for k in range(d)):
            message = (
                "the pivot already holds the body: velocity, motion and fixed cannot do so, too"
            )
            raise _wrong(pivot.argument, message, "spin=..., turning=... or fixed=(rx, ...)")
        self.led[:d] = [Expression(0.0)] * d
        return [0.0 if item is None else float(item.constant) for item in position]

    def _weigh(self, solid: Solid, mass: float | None, inertia: Components | None) -> None:
        self.weighed = solid.places
        kin, d, m = self.hub.domain.kin, self.hub.domain.dimension, np.asarray(solid.mass, float)
        x, total = np.zeros((solid.count, 3)), float(m.sum())
        x[:, :d] = solid.x0
        centre = m @ x / total if total else x.mean(axis=0)
        if kin.hoops:
            centre[0] = 0
        arm = x - centre
        side = (np.asarray(solid.volume0, float) / self.hub.domain.depth(solid.x0)) ** (1 / d)
        about_centre = m * side**2 / 12  # inertia of a square or cube about its centre
        square = np.einsum("n,ni,nj->ij", m, arm, arm)
        square[range(d), range(d)] += about_centre.sum()
        tensor = np.trace(square) * np.eye(3) - square
        if mass is not None:
            tensor *= mass / total
            total = mass
        c = self.constants[0]
        c.mass, c.start[:] = total, centre
        c.bound = np.sqrt((arm**2).sum(axis=1).max(initial=0)) + side.max(initial=0)
        if inertia is not None:
            numbers = inertia.numbers()
            wanted = {2: 1, 3: 3}.get(d, 0) * bool(len(self.ways) > d)
            if len(numbers) != wanted:
                expected = f"{wanted} in {d}D" if wanted else "none: it does not rotate here"
                raise _wrong(inertia.argument, f"{len(numbers)} moments of inertia", expected)
            tensor = np.diag(numbers if d == 3 else [1.0, 1.0, numbers[0]])
            moments = np.array(numbers)
            if moments.min() <= 0 or (
                d == 3 and 2 * moments.max() > moments.sum() * (1 + NOT_ROUND)
            ):
                message = f"no body has the moments of inertia {inertia.argument.text}"
                expected = "moments above 0, each at most the sum of the other two"
                raise _wrong(inertia.argument, message, expected)
        if self.pivot:
            c.start[:], away = self.pivot, centre - self.pivot
            c.offset[:] = away
            c.bound += np.linalg.norm(away)
            tensor = tensor + total * (away @ away * np.eye(3) - np.outer(away, away))
        if d < 3:
            about_z = tensor[2, 2] if d == 2 and not kin.hoops else 1.0
            moments, axes = np.array([1.0, 1.0, about_z]), np.eye(3)
        else:
            moments, axes = principal(tensor)
        c.inertia[:], c.axes[:] = moments, axes

    def _spin_up(self) -> None:
        state, constants = self.state[0], self.constants[0]
        axes = state.R @ constants.axes
        state.momentum[:] = axes @ (constants.inertia * (axes.T @ state.spin))

    def _begin_points(self, solid: Solid) -> None:
        d, arm = self.hub.domain.dimension, np.zeros((solid.count, 3))
        arm[:, :d] = solid.x0
        arm -= self.constants.start
        v = self.state.v + np.cross(self.state.spin, arm)
        if np.isfinite(v).all():
            solid.initial |= {f"v{axis}": v[:, k].copy() for k, axis in enumerate("xyz"[:d])}


def principal(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return principal moments, and principal axes as columns."""
    off = np.abs(tensor - np.diag(np.diag(tensor))).max()
    if off <= NOT_ROUND * np.trace(tensor):
        return np.diag(tensor).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(tensor)
    return moments, axes * np.sign(np.linalg.det(axes))


class ContactRigidBody(Fix):
    """Apply contact between points and a free rigid body, with friction.

    Parameters
    ----------
    solid
        ID of the rigid solid, which must have a fix rigid_body.
    mu
        Coefficient of friction (Coulomb); default: 0.
    limit
        Largest frictional stress, such as the strength of clay on a rough surface; default: none.
    region
        Surface of the body at the start; default: the region that the solid fills.

    Example
    -------
    fix(touch, contact/rigid_body, all, wheel, 0.4)
    fix(touch, contact/rigid_body, all, bar, 1, limit=1e4)

    Notes
    -----
    Publishes the force on the points as ID_x, ID_y, ID_z, and the area of contact, the faces of
    the points that are pressed, as ID_area (in 2D per unit thickness, in axisymmetry per radian).

    A point is a ball (in 2D a disk) with a radius of half the side of a cube of its volume. The
    contact impulse acts on the nodes around the point, and on the body at the point. It is the
    impulse of a spring of stiffness 0.1 m/dt^2, computed implicitly with the velocity of the body
    at the end of the step; the spring hardens above a penetration of 1/8 of a cell. Friction stops
    the slip, with at most mu times the normal impulse, and the slip stretches a spring of the same
    stiffness, so that points under load do not creep. With `limit`, friction is also at most this
    stress times the area of a point. As some points of the outermost layer do not touch, the areas
    of the others are scaled to the area of this layer. Without `limit`, cohesive soil that sticks
    to the body shears 0.6 cells outside of its surface. Nodes held by fix velocity_nodes are not
    moved.

    The fix is for ulmpm and tlmpm. A wheel rolls on its radius plus half a point, so its
    acceleration on a slope is 3.6 % too large with a radius of 3 cells (2 % in 3D). Use
    ulmpm/contacts for liquids, and for bodies that slide: the acceleration of a sliding box is
    0.04 % too large there, but 4 % too small with this fix.

    See Also
    --------
    rigid_body, contact/surface
    """

    published = ("x", "y", "z", "area")
    for_method = exerts = presses = True
    by_sizes = True
    remembers = ("memory",)

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        solid: Solid,
        mu: Annotated[float, NonNegative] | None = None,
        *,
        limit: Annotated[float, Positive] | None = None,
        region: Region | None = None,
    ):
        super().__init__(hub, group)
        judge_friction(hub, mu or 0.0)
        self.mu, self.touches, surface = mu or 0.0, solid, region or solid.region
        if limit is not None and mu is None:
            message = "a limit of friction needs a coefficient of friction mu"
            raise ScriptError(message, argument="limit", expected=f"mu=1, limit={limit:g}")
        self.limit = inf if limit is None else limit
        self.grip = np.zeros((0, GRIP))
        if group.touches(solid) and not group.all:
            message = f"the group has points of the body '{solid.id}'"
            raise ScriptError(message, argument="group", expected="points of other solids")
        if surface is None:
            message, expected = f"solid '{solid.id}' fills no region", "its surface: region=ID"
            raise ScriptError(message, argument="solid", expected=expected)
        self.region = surface
        if self.region.flat or self.region.outline() is None:
            raise ScriptError(
                f"region '{self.region.id}' has no surface that the program can compute",
                argument="region" if region else "solid",
                expected="a block, cylinder, sphere, closed STL surface or mesh, or some of these",
            )

    def defined(self) -> None:
        others: list[Any] = [fix for fix in contacts_of(self.hub) if fix is not self]
        for other in others:
            same = (other.touches, other.region) == (self.touches, self.region)
            if same and len(np.intersect1d(other.group.members, self.group.members)):
                raise ScriptError(
                    f"fix '{other.id}' (line {other.mark.line}) is the contact of points of this "
                    f"group with '{self.touches.id}' already",
                    argument="group",
                    expected="groups without points in common, or one fix",
                    mark=self.mark,
                    command="fix contact/rigid_body",
                )

    def grip_of(self, count: int) -> np.ndarray:
        """Return the friction state of `count` points, by id; empty without friction."""
        if self.mu > 0 and len(self.grip) != count:
            before, self.grip = self.grip[:count], np.zeros((count, GRIP))
            self.grip[: len(before)] = before
        return self.grip

    @property
    def memory(self) -> np.ndarray:
        return self.grip

    @memory.setter
    def memory(self, grip: np.ndarray) -> None:
        if grip.shape == self.grip.shape:
            self.grip[:] = grip  # a run may hold the array
        else:
            self.grip = grip.copy()

    def behind(self, points: PointTable) -> tuple[int, float]:
        """Return the number of points that begin inside the body, and the largest depth."""
        depth = self.region.depth(points.position.astype(float), self.hub.domain.h)
        index = points.numbers - self.touches.first_id
        depth = depth[(index < 0) | (index >= self.touches.count)]
        return int(np.sum(depth > self.hub.domain.tolerance)), float(depth.max(initial=0.0))

    def refuse(self, number: int) -> int:
        raise ScriptError(
            f"{named(self.hub, number)} is so deep in the body '{self.touches.id}' that the "
            "direction to its surface is ambiguous",
            mark=self.mark,
            expected="points that come less than a cell below its surface",
            hint="another initial position of the body, smaller steps (dt_factor), or a stiffer "
            "solid",
        )


def bodies_of(hub: Hub) -> list[RigidBody]:
    return [fix for fix in hub.fixes.values() if isinstance(fix, RigidBody)]


def contacts_of(hub: Hub) -> list[ContactRigidBody]:
    return [fix for fix in hub.fixes.values() if isinstance(fix, ContactRigidBody)]


def surfaces_of(body: RigidBody) -> list[ContactRigidBody]:
    return [fix for fix in contacts_of(body.hub) if fix.touches is body.body]


def _touches_nothing(fix: Any, scene: Any) -> bool:
    method, solids = scene.hub.update.method, scene.hub.solids.values()
    soft = not all(solid.rigid for solid in solids)
    return soft and not (surfaces_of(fix) or method.fields_per_solid or method.own_grids)


known_failure(
    RigidBody,
    "body '{part.body.id}'",
    when=_touches_nothing,
    reason="it passes through other solids: a rigid body has no mass on a common grid",
    cure="fix(ID, contact/rigid_body, all, {part.body.id}, mu), or method(ulmpm/contacts, ...)",
)
known_failure(
    ContactRigidBody,
    "points in the body '{part.touches.id}'",
    when=begin_behind,
    reason="{which} points of the group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="another position of the body or of the other solid",
)
