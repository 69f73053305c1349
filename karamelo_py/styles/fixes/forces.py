"""Fixes for forces on nodes and points, and initial stress."""

import re
from typing import Annotated, Any

import numpy as np

from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.kernels.equations.node_updates import WorkAtNodes
from karamelo_py.kernels.equations.twist import MassTimesRadius, SumsAround, TorqueOfLoads
from karamelo_py.kernels.laws import law_on
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import In
from karamelo_py.output.node_columns import places_of
from karamelo_py.output.units import FORCE, Powers
from karamelo_py.points.kinematics import Space, nothing, tr, zero
from karamelo_py.points.laws import (
    advance,
    can,
    cauchy_stress,
    elastic_law,
    initial_state,
    specific_volume,
    with_stress,
)
from karamelo_py.points.laws.eos import ignited
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import LAST, Fix, InitialFix, node_hook, per_direction, vector_hook
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression, applied
from karamelo_py.styles.fixes.formulas import vector

ACCELERATION = Powers(1, 0, -2)
TONNES = 1e-10, 1e-6  # densities in t/mm^3, foam to above osmium; rare in other systems
FOAM = 20.0  # density of foam in kg/m^3; densities in g/cm^3 are below


def accelerate(node):
    return node.v, node.v_star, node.force + node.mass * node.value, node.mass * node.value


def accelerate_whole(mass, force, arm, sums, load, values, dt):
    return pushed(force, sums, load, (mass * values[0], mass * values[1], arm * values[2]))


def share_out_whole(force, sums, load, values, dt):
    return pushed(force, sums, load, tuple([values[3] * value for value in values[:3]]))


def pushed(force, sums, load, push):
    """Add a force in the plane of radius and axis, and a torque; return the result of the hook."""
    inertia, momentum, torque = sums
    force = force._make([old + new for old, new in zip(force, push[:2], strict=True)])
    return force, (inertia, momentum, torque + push[2]), load + push[2], push


WRITES = "force", SumsAround, TorqueOfLoads


class BodyForce(Fix):
    """Accelerate nodes: gravity, centrifugal force, manufactured sources.

    Parameters
    ----------
    acceleration
        bx, by, bz, one per dimension: force per unit mass, functions of x0, y0, z0, time and
        published values. NULL leaves a component unchanged. With axisymmetric(true, twist=true), bz
        acts around the axis.

    Example
    -------
    fix(gravity, body_force, all, 0, -9.81)
    fix(ramp, body_force, all, NULL, -9.81*min(time/2, 1))

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z; with twist, ID_z is the torque about the axis.

    See Also
    --------
    force_nodes
    """

    syntax = "group, bx[, by[, bz]]"
    published = ("x", "y", "z")
    unit = FORCE
    accelerates = exerts = True

    post_particles_to_grid = node_hook(accelerate)
    of_twist = vector_hook(
        accelerate_whole,
        reads=("mass", "force", MassTimesRadius, SumsAround, TorqueOfLoads),
        writes=WRITES,
        publishes=True,
        nodes=True,
    )

    def __init__(self, hub: Hub, group: NodeGroup, *acceleration: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "b", acceleration, around=True)
        if len(self.formulas) > hub.domain.dimension:
            self.post_particles_to_grid = self.of_twist
            self.node_fields = (MassTimesRadius, TorqueOfLoads, WorkAtNodes)


def _is_gravity(formula: Expression, g: float) -> bool:
    text = str(formula.constant) if formula.is_constant else formula.text
    numbers = re.findall(r"(?<![\w.])\d+\.?\d*(?![\w.])", text)
    return any(0.99 * g < float(number) < 1.01 * g for number in numbers)


def _gravity_in_other_units(fix: BodyForce, scene: Any) -> dict | None:
    units, formulas = fix.hub.output.units, [f for f in fix.formulas if f is not None]
    volumes = [specific_volume(s.material.law) for s in fix.hub.solids.values()]
    density = 1 / float(min(volumes))
    if units:
        evidence, right = f"units({', '.join(units[:3])})", 9.81 / units.si(ACCELERATION)
    elif TONNES[0] < density < TONNES[1]:
        evidence, right = f"a density of {density:.3g}, as in mm, t, s,", 9810.0
    else:
        evidence, right = f"a density of {density:.3g}, as in m, kg, s,", 9.81
    for g in (9.81, 9810.0) if units or not TONNES[1] < density < FOAM else ():
        if abs(g / right - 1) > 1e-6 and any(_is_gravity(formula, g) for formula in formulas):
            return {"evidence": evidence, "right": right, "g": g, "fraction": g / right}
    return None


known_failure(
    BodyForce,
    "units of gravity",
    when=_gravity_in_other_units,
    reason="with {evidence} an acceleration of {g:g} is {fraction:.3g} times gravity",
    cure="gravity is {right:.6g} there",
)


def share_out(node):
    return node.v, node.v_star, node.force + node.value * node.share, node.value * node.share


class ForceNodes(Fix):
    """Apply a total force, split equally among the nodes of the group with mass.

    Parameters
    ----------
    force
        fx, fy, fz: functions of time and published values. NULL leaves a component unchanged; in 1D
        and 2D, omit the last ones or set them to NULL or 0. With axisymmetric(true, twist=true), fz
        acts around the axis, on each node at its radius.

    Example
    -------
    fix(pull, force_nodes, tip, 0, -100*min(time, 1), NULL)

    Notes
    -----
    Publishes the applied force as ID_x, ID_y, ID_z; with twist, ID_z is the torque about the axis.

    See Also
    --------
    body_force
    """

    syntax = "group, fx[, fy[, fz]]"
    published = ("x", "y", "z")
    unit = FORCE
    exerts = True

    post_particles_to_grid = node_hook(share_out, shares=True)
    of_twist = vector_hook(
        share_out_whole,
        reads=("force", SumsAround, TorqueOfLoads),
        writes=WRITES,
        publishes=True,
        nodes=True,
        shares=True,
    )

    def __init__(self, hub: Hub, group: NodeGroup, *force: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "f", force, around=True)
        if len(self.formulas) > hub.domain.dimension:
            *rest, around = self.formulas
            self.formulas = (*rest, applied("*", Expression.seed("x0"), around))
            self.post_particles_to_grid = self.of_twist
            self.node_fields = (TorqueOfLoads, WorkAtNodes)


def _beyond_a_surface(fix: ForceNodes, scene: Any) -> dict | None:
    """Count the nodes of a spline beyond the surface of a body, which have little of its mass."""
    hub = fix.hub
    method, domain = hub.update.method, hub.domain
    if method is None or not method.frame.moves or method.basis.traits.gradient_jumps:
        return None
    d, reach = domain.dimension, 1.5 * domain.h
    x = places_of(hub, fix.group.members)[:, :d]
    on, near = np.zeros((2, len(x)), bool)
    for solid in hub.solids.values():
        lo, hi = solid.lo[:d] - domain.tolerance, solid.hi[:d] + domain.tolerance
        on |= ((x >= lo) & (x <= hi)).all(axis=1)
        near |= ((x > lo - reach) & (x < hi + reach)).all(axis=1)
    count = int(np.count_nonzero(near & ~on))
    return {"count": count, "all": int(np.count_nonzero(near))} if count and on.any() else None


known_failure(
    ForceNodes,
    "nodes beyond a surface",
    when=_beyond_a_surface,
    reason="{count} of {all} nodes lie beyond the surface of a body, have little of its mass, and "
    "take as much of the force as others",
    cure="force_particles or edge_pressure, or a domain that ends at the surface",
)


def torques(x: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Torques (n, 3) about the origin of forces (n, d) at `x` (n, d)."""
    arm, push = np.zeros((2, len(x), 3))
    arm[:, : x.shape[1]], push[:, : x.shape[1]] = x, force
    return np.cross(arm, push)


class PointForces(Fix):
    published: tuple[str, ...] = ("x", "y", "z")
    point_fields = (Force, WorkOfForces)
    point_by_point = exerts = True
    conserves = True  # except the work of the forces, which is summed

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        self.rigid = [s for s in hub.solids.values() if s.rigid and group.touches(s)]
        if self.rigid and self.of_rigid_points:
            message = f"solid '{self.rigid[0].id}' is rigid: forces do not move it"
            expected = "points of other solids; fix velocity_particles moves rigid ones"
            raise ScriptError(message, argument="group", expected=expected)

    def forces(self, points: PointsView) -> np.ndarray:
        raise NotImplementedError

    def publish_load(self, points: PointsView, force: np.ndarray) -> None:
        """Publish the sum of forces (n, d), and their torque if requested.

        With twist, forces are (n, 3), and the third sum is the torque about the axis.
        """
        x, torque = points.position, self.hub.values.torque_of(self.id)
        d = x.shape[1]
        self.publish_components(points.total(np.hstack([force[:, :d], x[:, :1] * force[:, d:]])))
        if len(torque):
            torque[:3] = points.total(torques(x, force))

    def initial_integrate(self, points: PointsView) -> None:
        force, total = self.forces(points), points.force
        total[:, : force.shape[1]] += force
        points.force = total
        self.publish_load(points, force)


class ForceParticles(PointForces):
    """Apply a total force to points, split by their masses.

    Parameters
    ----------
    force
        fx, fy, fz, one per dimension: functions of x, y, z, x0, y0, z0, time and published values.
        NULL leaves a component unchanged.

    Example
    -------
    fix(pull, force_particles, tip, 0, -100*min(time, 1))

    Notes
    -----
    A point of mass m gets the fraction m/M of the force at its position, where M is the mass of the
    group. Unlike force_nodes, the load moves with the points. In axisymmetry, forces are per
    radian. Publishes the total force as ID_x, ID_y, ID_z; with twist, fz acts around the axis, and
    ID_z is its torque.

    See Also
    --------
    force_nodes, body_force, edge_traction, neumann_bc_mech
    """

    syntax = "group, fx[, fy[, fz]]"

    def __init__(self, hub: Hub, group: ParticleGroup, *force: Expression | None):
        super().__init__(hub, group)
        if self.rigid:
            hub.warn(
                f"solid '{self.rigid[0].id}' is rigid: its part of the force has no effect",
                hint="a group without its points",
            )
        self.force = per_direction(hub, "f", force, around=True)

    def forces(self, points: PointsView) -> np.ndarray:
        mass, x = points.mass.astype(float), points.position
        fraction = (mass / (points.total(mass) or 1.0))[:, None]
        return fraction * vector(self.force, self.hub, x, lambda: points.reference_position)


def brake(node):
    """Reduce the velocity change due to forces by a fraction, and return the damping force.

    There is no damping where the velocity changes sign, or a wall has stopped the node.
    """
    against = 0.0
    if node.v * node.v_star > 0:
        change = min(abs(node.v_star - node.v), abs(node.force) * node.kick / node.mass)
        against = min(node.value * change, abs(node.v_star))
        if node.v > 0:
            against = -against
    return node.v, node.v_star + against, node.force, node.mass * against / node.kick


class LocalDamping(Fix):
    """Damp each node by a fraction of its out-of-balance force, to bring a scene to rest.

    Parameters
    ----------
    alpha
        From 0 to 1; 0.8 is usual.

    Example
    -------
    fix(weight, body_force, all, 0, -9.81)
    fix(calm, local_damping, all, 0.8)

    Notes
    -----
    Each component f of the force on a node becomes f - alpha |f| sign(v) (Cundall 1987). Bodies at
    rest or in steady motion are not damped. With 0.8 a scene comes to rest within about ten periods
    of its slowest vibration.

    The damping uses the net force after all other fixes (in ulmpm/contacts also after contact), so
    that touching bodies come to rest with correct contact forces. Nodes that are held or move at a
    prescribed constant velocity are not damped, so their reactions are correct. Publishes the sum
    of the damping forces as ID_x, ID_y, ID_z.

    See Also
    --------
    body_force, edge_traction, run_while
    """

    published = ("x", "y", "z")
    brakes = exerts = True
    order = LAST

    post_update_grid_state = node_hook(brake)

    def __init__(self, hub: Hub, group: NodeGroup, alpha: Annotated[Expression, In(0, 1)] = 0.8):
        super().__init__(hub, group)
        self.formulas = (Expression(alpha),) * hub.domain.dimension


NAMES = ("11", "22", "33", "23", "13", "12")


class InitialStress(InitialFix):
    """Set the Cauchy stress of points once, before the next step.

    Parameters
    ----------
    sxx, syy, szz, syz, sxz, sxy
        Components, tension positive: functions of x, y, z, x0, y0, z0. NULL leaves a component
        unchanged. Shear components outside the dimension must be NULL or 0.

    Example
    -------
    fix(k0, initial_stress, soil, 8000*(y0 - 10), 20000*(y0 - 10), 8000*(y0 - 10), 0, 0, 0)

    Notes
    -----
    The stress of a hyperelastic material (neo-hookean, orthotropic) follows from its deformation
    and cannot be set. A warning is given for tension that a material cannot sustain, such as soil
    without cohesion.
    """

    def __init__(
        self, hub: Hub, group: ParticleGroup,
        sxx: Expression | None, syy: Expression | None, szz: Expression | None,
        syz: Expression | None, sxz: Expression | None, sxy: Expression | None,
    ):  # fmt: skip
        super().__init__(hub, group)
        self.formulas = (sxx, syy, szz, syz, sxz, sxy)
        refuse_following(hub, group)

    def initial_integrate(self, points: PointsView) -> None:
        x, x0 = points.position, points.reference_position
        named = zip(NAMES, self.formulas, strict=True)
        values = self.hub.values
        points.set_stress({n: f.evaluate_points(values, x, x0) for n, f in named if f is not None})


def refuse_following(hub: Hub, group: ParticleGroup) -> None:
    for solid in hub.solids.values():
        law = solid.material.whole
        follows = not can(elastic_law(law), with_stress) or can(law, ignited)
        if group.touches(solid) and follows:
            raise ScriptError(
                f"the stress of solid '{solid.id}' follows from its deformation and cannot be set",
                argument="group",
                expected="linear, hill, jointed, cam-clay or eos-strength (not jwl)",
            )


class Detonation(InitialFix):
    """Ignite the points of explosives, each at a given time.

    Parameters
    ----------
    t
        Time at which a point ignites (distance from the detonator / detonation speed), a
        function of x, y, z, x0, y0, z0.

    Example
    -------
    fix(plane, detonation, all, x0/6930)
    fix(point, detonation, all, sqrt((x0 - 1)^2 + y0^2)/6930)

    Notes
    -----
    Points of other materials are unaffected.

    See Also
    --------
    eos jwl
    """

    ignites = True

    def __init__(self, hub: Hub, group: ParticleGroup, t: Expression):
        super().__init__(hub, group)
        self.formulas = (t,)
        laws = [solid.material.whole for solid in hub.solids.values() if group.touches(solid)]
        if not any(can(law, ignited) for law in laws):
            hub.warn("no point of the group is explosive", hint="a group with eos jwl")

    def initial_integrate(self, points: PointsView) -> None:
        x, x0 = points.position, points.reference_position
        times = self.formulas[0].evaluate_points(self.hub.values, x, x0)
        points.ignite(self.hub.update.time - times)


def _is_borne(law: Any, mean: float) -> bool:
    kin = Space()
    stress = tuple(nothing(kin))
    state = with_stress(law, kin, initial_state(law, kin, 1.0), (*3 * (mean,), *stress[3:]))
    after = advance(law, kin, state, zero(kin, 1.0), 1.0)
    return bool(tr(cauchy_stress(law, kin, after)) > 1.5 * mean)


def _unsustained_tension(fix: InitialStress, scene: Any) -> list[dict]:
    """Return bodies in which at least 10 % of the points cannot sustain their tension."""
    cases = []
    normal = fix.formulas[:3]
    for solid in scene.hub.solids.values():
        law = elastic_law(law_on(solid.material.whole, solid.h, solid.T0))
        ids = np.arange(solid.first_id, solid.first_id + solid.count)
        x = solid.x0[fix.group.has(ids)]
        if not len(x) or not can(law, with_stress):
            continue
        stresses = [f.evaluate_points(scene.hub.values, x, x) for f in normal if f is not None]
        mean = np.sum(stresses, axis=0) / 3 if stresses else np.zeros(1)
        pulled = np.count_nonzero(mean > 0.01 * np.abs(mean).max())
        most = float(mean.max())
        if pulled < 0.1 * len(x) or _is_borne(law, most):
            continue
        turned = ", ".join("NULL" if f is None else f"-({f.text})" for f in normal)
        shear = ", ".join("NULL" if f is None else f.text for f in fix.formulas[3:])
        cases.append(
            {
                "solid": solid.id,
                "most": most,
                "pulled": pulled / len(x),
                "line": f"fix({fix.id}, initial_stress, {fix.group.id}, {turned}, {shear})",
            }
        )
    return cases


known_failure(
    InitialStress,
    "initial tension",
    when=_unsustained_tension,
    reason="fix {part.id} pulls {pulled:.0%} of the points of solid '{solid}' with a mean stress "
    "of up to {most:.3g}, which its material cannot sustain: they separate in the first step",
    cure="compression is negative: {line}",
)
