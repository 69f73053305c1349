"""Fixes of forces on nodes and points, and of the stress of points at first."""

import re
from typing import Annotated, Any

import numpy as np

from karamelo_py.kernels.laws import elastic_law, law_on
from karamelo_py.kernels.p2g import Force, WorkOfForces
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import In
from karamelo_py.output.units import Powers
from karamelo_py.points.kinematics import Space, nothing, tr, zero
from karamelo_py.points.laws import (
    advance,
    can,
    cauchy_stress,
    constrained_velocity,
    initial_state,
    specific_volume,
    with_stress,
)
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView, node_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction, vector

ACCELERATION = Powers(1, 0, -2)
TONNES = 1e-10, 1e-6  # densities in t/mm^3, from foam to beyond osmium: no others are so small


def accelerate(mass, v, v_star, force, value, before, dt, share):
    """The force grows by mass times the value; so does the total."""
    return v, v_star, force + mass * value, mass * value


class BodyForce(Fix):
    """Accelerate nodes: gravity, centrifugal force, a manufactured solution's source.

    Parameters
    ----------
    acceleration
        bx, by, bz, as many as the domain has dimensions: force per mass, numbers or formulas of
        x0, y0, z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(gravity, body_force, all, 0, -9.81)
    fix(ramp, body_force, all, NULL, -9.81*min(time/2, 1))

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes
    """

    syntax = "group, bx[, by[, bz]]"
    published = ("x", "y", "z")
    accelerates = True

    post_particles_to_grid = node_hook(accelerate)

    def __init__(self, hub: Hub, group: NodeGroup, *acceleration: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "b", acceleration)

    def defined(self) -> None:
        """Warn of a gravity in m/s^2 where the other numbers have other units."""
        if not any(formula is not None and _is_gravity(formula) for formula in self.formulas):
            return
        hub = self.hub
        units = hub.output.units
        densities = [1 / float(specific_volume(s.material.law)) for s in hub.solids.values()]
        if units and abs(units.si(ACCELERATION) - 1) > 1e-6:
            given = f"units({', '.join(units[:3])})"
            told, right = given, 9.81 / units.si(ACCELERATION)
        elif not units and densities and TONNES[0] < max(densities) < TONNES[1]:
            told, right = f"a density of {max(densities):.3g}, as in mm, t, s,", 9810.0
        else:
            return
        hub.warn(
            f"with {told} an acceleration of 9.81 is {9.81 / right:.3g} of gravity",
            hint=f"gravity is {right:.6g} there",
        )


def _is_gravity(formula: Expression) -> bool:
    """Tell if a formula is the acceleration of gravity in m/s^2, or has it as a number."""
    if formula.is_constant:
        return 9.7 < abs(formula.constant) < 9.9
    return re.search(r"(?<![\d.])9\.8\d*(?![\d.eE])", formula.text) is not None


def share_out(mass, v, v_star, force, value, before, dt, share):
    """Each member takes its share of the value."""
    return v, v_star, force + value * share, value * share


class ForceNodes(Fix):
    """Apply a total force, split equally among the nodes of the group that carry mass.

    Parameters
    ----------
    force
        fx, fy, fz: numbers or formulas of time and published values. NULL leaves a component
        alone; in fewer dimensions the last ones may be left out, NULL or 0.

    Example
    -------
    fix(pull, force_nodes, tip, 0, -100*min(time, 1), NULL)

    Notes
    -----
    Publishes the applied force as ID_x, ID_y, ID_z.

    See Also
    --------
    body_force
    """

    syntax = "group, fx[, fy[, fz]]"
    published = ("x", "y", "z")

    post_particles_to_grid = node_hook(share_out, shares=True)

    def __init__(self, hub: Hub, group: NodeGroup, *force: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "f", force)


class PointForces(Fix):
    """Base of fixes that put a force on each point of their group."""

    published: tuple[str, ...] = ("x", "y", "z")
    point_fields = (Force, WorkOfForces)
    point_by_point = True
    conserves = True  # but for the work of the forces, which steps add up

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        solids = list(hub.solids.values())
        rigid = [can(solid.material.law, constrained_velocity) for solid in solids]
        self.rigid = [s for s, r in zip(solids, rigid, strict=True) if r and group.touches(s)]
        soft = (s for s, r in zip(solids, rigid, strict=True) if not r)
        if self.rigid and not any(map(group.touches, soft)):
            raise ScriptError(
                f"solid '{self.rigid[0].id}' is rigid: no force moves it, only what it is told",
                argument="group",
                expected="points of other solids; fix velocity_particles moves rigid ones",
            )

    def forces(self, points: PointsView) -> np.ndarray:
        """The forces (n, d) on the points."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Give the points their forces, and publish the sum."""
        force = self.forces(points)
        points.force = points.force + force
        self.publish_components(points.total(force))


class ForceParticles(PointForces):
    """Apply a total force to points, split by their masses.

    Parameters
    ----------
    force
        fx, fy, fz, as many as the domain has dimensions: numbers or formulas of x, y, z, x0, y0,
        z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(pull, force_particles, tip, 0, -100*min(time, 1))

    Notes
    -----
    A point of mass m gets m/M of the force at its position. M is the mass of the group. The load
    goes with the points wherever they move, as that of fix force_nodes does not. In an axisymmetric
    scene forces belong to a radian. Publishes the sum as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes, body_force, edge_traction, neumann_bc_mech
    """

    syntax = "group, fx[, fy[, fz]]"

    def __init__(self, hub: Hub, group: ParticleGroup, *force: Expression | None):
        super().__init__(hub, group)
        if self.rigid:
            hub.warn(
                f"solid '{self.rigid[0].id}' is rigid: its share of the force moves nothing",
                hint="a group without its points",
            )
        self.force = per_direction(hub, "f", force)

    def forces(self, points: PointsView) -> np.ndarray:
        mass, x = points.mass.astype(float), points.position
        share = mass / (points.total(mass) or 1.0)
        return share[:, None] * vector(self.force, self.hub, x, lambda: points.reference_position)


def brake(mass, v, v_star, force, value, before, dt, share):
    """v* loses a share of what the force changed it by, against v; the total is the force of that.

    Where the step turns the node around, or a wall has stopped it, there is nothing to brake.
    """
    against = 0.0
    if v * v_star > 0:
        change = min(abs(v_star - v), abs(force) * dt / mass)
        against = min(value * change, abs(v_star))
        if v > 0:
            against = -against
    return v, v_star + against, force, mass * against / dt


class LocalDamping(Fix):
    """Bring a scene to rest: each node is braked by a share of the force that is out of balance.

    Parameters
    ----------
    alpha
        The share, from 0 to 1; 0.8 is usual. A number or a formula of time: damping may end.

    Example
    -------
    fix(weight, body_force, all, 0, -9.81)
    fix(calm, local_damping, all, 0.8)

    Notes
    -----
    The force f of a node becomes f - alpha |f| sign(v), component by component (Cundall 1987).
    Where forces balance there is no damping. The state of rest is therefore that without damping,
    for any stiffness, and steady motion is not braked. With 0.8 a scene comes to rest within some
    ten periods of its slowest vibration.

    It acts after all other fixes, wherever it stands in the script. Held nodes, and nodes with a
    prescribed constant speed, are not braked, and their reactions are right. Publishes the sum of
    the added forces as ID_x, ID_y, ID_z.

    In method ulmpm/contacts it acts before solids push each other. Bodies in contact then stick as
    with friction, between 1 - alpha and 1 + alpha of the load. Let alpha go to 0 there, as
    0.8*max(1 - time/T, 0) does.

    See Also
    --------
    body_force, edge_traction, run_while
    """

    published = ("x", "y", "z")
    brakes = True
    acts_last = True

    post_update_grid_state = node_hook(brake)

    def __init__(self, hub: Hub, group: NodeGroup, alpha: Annotated[Expression, In(0, 1)] = 0.8):
        super().__init__(hub, group)
        self.formulas = (Expression(alpha),) * hub.domain.dimension

    def defined(self) -> None:
        """Warn where rest would not be that without damping."""
        alpha = self.formulas[0]
        if alpha.is_constant and alpha.constant > 0 and self.hub.update.method.fields_per_solid:
            self.hub.warn(
                "bodies that touch come to rest anywhere near their balance while damping acts",
                hint="an alpha that goes to 0: 0.8*max(1 - time/T, 0)",
            )


NAMES = ("11", "22", "33", "23", "13", "12")


class InitialStress(Fix):
    """Give points a Cauchy stress before the first step after this line, and never again.

    Parameters
    ----------
    sxx, syy, szz, syz, sxz, sxy
        Components: numbers or formulas of x, y, z, x0, y0, z0; tension is positive. NULL leaves a
        component alone. Shear components that the dimension does not have must be NULL or 0.

    Example
    -------
    fix(k0, initial_stress, soil, 8000*(y0 - 10), 20000*(y0 - 10), 8000*(y0 - 10), 0, 0, 0)

    Notes
    -----
    The stress of a hyperelastic material (neo-hookean) follows from its deformation and cannot be
    set. Compression is negative. A warning names tension that a material does not bear, such as
    that of soil without cohesion.
    """

    published = ()
    first_step_only = True
    point_by_point = True

    def __init__(
        self, hub: Hub, group: ParticleGroup,
        sxx: Expression | None, syy: Expression | None, szz: Expression | None,
        syz: Expression | None, sxz: Expression | None, sxy: Expression | None,
    ):  # fmt: skip
        super().__init__(hub, group)
        self.formulas = (sxx, syy, szz, syz, sxz, sxy)
        for solid in hub.solids.values():
            if group.touches(solid) and not can(elastic_law(solid.material.law), with_stress):
                raise ScriptError(
                    f"the stress of solid '{solid.id}' follows from its deformation "
                    "and cannot be set",
                    argument="group",
                    expected="points of a material in rate form, such as linear or eos-strength",
                )

    def initial_integrate(self, points: PointsView) -> None:
        x, x0 = points.position, points.reference_position
        named = zip(NAMES, self.formulas, strict=True)
        values = self.hub.values
        points.set_stress({n: f.evaluate_points(values, x, x0) for n, f in named if f is not None})


def _is_borne(law: Any, mean: float) -> bool:
    """Tell whether a law bears half of a mean stress in all directions."""
    kin = Space()
    stress = tuple(nothing(kin))
    state = with_stress(law, kin, initial_state(law, kin, 1.0), (*3 * (mean,), *stress[3:]))
    after = advance(law, kin, state, zero(kin, 1.0), 1.0)
    return bool(tr(cauchy_stress(law, kin, after)) > 1.5 * mean)


def _unborne_tension(fix: InitialStress, scene: Any) -> list[dict]:
    """Find the bodies that get a tension which they do not bear, in a tenth of their points."""
    found = []
    normal = fix.formulas[:3]
    for solid in scene.hub.solids.values():
        law = elastic_law(law_on(solid.material.law, solid.h, solid.T0))
        ids = np.arange(solid.first_id, solid.first_id + solid.count)
        x = solid.x0[fix.group.has(ids)]
        if not len(x) or not can(law, with_stress):
            continue
        given = [f.evaluate_points(scene.hub.values, x, x) for f in normal if f is not None]
        mean = np.sum(given, axis=0) / 3 if given else np.zeros(1)
        pulled = np.count_nonzero(mean > 0.01 * np.abs(mean).max())
        most = float(mean.max())
        if pulled < 0.1 * len(x) or _is_borne(law, most):
            continue
        turned = ", ".join("NULL" if f is None else f"-({f.text})" for f in normal)
        shear = ", ".join("NULL" if f is None else f.text for f in fix.formulas[3:])
        found.append(
            {
                "solid": solid.id,
                "most": most,
                "pulled": pulled / len(x),
                "line": f"fix({fix.id}, initial_stress, {fix.group.id}, {turned}, {shear})",
            }
        )
    return found


known_failure(
    InitialStress,
    "initial tension",
    when=_unborne_tension,
    reason="fix {part.id} pulls {pulled:.0%} of the points of solid '{solid}' with a mean stress "
    "of up to {most:.3g}, which its material does not bear: they come apart in the first step",
    cure="compression is negative: {line}",
)
