"""Fixes of node velocities, and compute reaction."""

import re
from typing import Annotated, Any

import numpy as np

from karamelo_py.language.signature import Argument, NonNegative
from karamelo_py.output.units import FORCE
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute, Fix, InitialFix, NodesView, node_hook, per_direction
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import AXES, judge_friction, unlike


def prescribe(node):
    """Set v* to the value and v to the value of the previous step, as at a symmetry plane."""
    return node.before, node.value, node.force, node.mass * (node.value - node.v_star) / node.kick


def prescribe_motion(node):
    return node.v, node.value, node.force, node.mass * (node.value - node.v_star) / node.kick


def prescribe_mapped(node):
    return node.value, node.value, node.force, 0.0


def prescribe_at_most(node):
    """Bound v* from above; the published sum is the reaction, which is negative."""
    allowed = min(node.v_star, node.value)
    return node.v, allowed, node.force, node.mass * (allowed - node.v_star) / node.kick


def prescribe_mapped_at_most(node):
    """Bound v, too: else stress does spurious work, and a rebound gains 50 % of the energy."""
    allowed = node.value if node.v_star == node.value else min(node.v, node.value)
    return allowed, allowed, node.force, 0.0


def prescribe_at_least(node):
    """Bound v* from below; the published sum is the reaction, which is positive."""
    allowed = max(node.v_star, node.value)
    return node.v, allowed, node.force, node.mass * (allowed - node.v_star) / node.kick


def prescribe_mapped_at_least(node):
    allowed = node.value if node.v_star == node.value else max(node.v, node.value)
    return allowed, allowed, node.force, 0.0


# Hooks by bound: after the momentum update, and after velocities are mapped again.
HOOKS = {
    bound: (node_hook(update, uses_before=True, holds=True), node_hook(mapped, publishes=False))
    for bound, update, mapped in (
        ("", prescribe, prescribe_mapped),
        ("moves", prescribe_motion, prescribe_mapped),
        ("leq", prescribe_at_most, prescribe_mapped_at_most),
        ("geq", prescribe_at_least, prescribe_mapped_at_least),
    )
}


class Velocity(Expression):
    """Script argument: a formula; with leq or geq before it, the formula is a `bound`."""

    script_kind = "a number or a formula"
    bound = ""

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "Velocity":
        first = re.match(r"(leq|geq)\w*", argument.text)
        if not first or argument.knows(first[0]):
            return super().from_script(hub, argument)
        velocity = super().from_script(hub, argument.behind(3))
        velocity.bound = first[1]
        return velocity


class VelocityNodes(Fix):
    """Prescribe the velocity of nodes: fixed or moving walls, supports, grips, pistons.

    Parameters
    ----------
    velocity
        vx, vy, vz, one per dimension: functions of x0, y0, z0, time and published values. NULL
        leaves a component free. After ``leq`` or ``geq``, the velocity is an upper or lower bound.
    mu
        Coefficient of friction (Coulomb). Friction acts in NULL directions, in which the wall is at
        rest; its force is at most mu times the force in the other directions. Without ``geq`` or
        ``leq``, friction also acts under tension.

    Example
    -------
    fix(base, velocity_nodes, bottom, 0, 0)
    fix(roller, velocity_nodes, left, 0, NULL)
    fix(piston, velocity_nodes, top, NULL, -0.1*sin(2*PI*time))
    fix(floor, velocity_nodes, bottom, NULL, geq0)
    fix(rough, velocity_nodes, bottom, NULL, geq0, mu=0.3)

    Notes
    -----
    Publishes the force that holds the nodes, with friction, as ID_x, ID_y, ID_z. Frictional work
    heats points with a temperature; the wall takes no heat.

    If several such fixes include a node and direction, the last one applies: it publishes the whole
    reaction, and only its friction acts. A bound that is not reached exerts no force.

    A plane of such nodes inside the grid is a wall. Splines are modified at cell faces whose nodes
    are all held or bounded, as at the ends of the grid, so the group should extend over all cells
    that the body touches.

    In ulmpm/contacts, if a fix prescribes all components at all corners of a solid's cells, all
    nodes of the solid are held.

    See Also
    --------
    velocity_particles, initial_velocity_nodes, compute reaction, compute force_on
    """

    syntax = "group, vx[, vy[, vz]][, mu=mu]"
    published = ("x", "y", "z")
    unit = FORCE
    prescribes_velocity = exerts = True

    def __init__(
        self,
        hub: Hub,
        group: NodeGroup,
        *velocity: Velocity | None,
        mu: Annotated[Expression, NonNegative] | None = None,
    ):
        super().__init__(hub, group)
        self.formulas: tuple[Any, ...] = per_direction(hub, "v", velocity)
        self.wall_friction = mu
        if mu is not None and mu.is_constant:
            judge_friction(hub, mu.constant)
        if mu is not None and None not in self.formulas:
            message = "friction cannot act on nodes that are held in all directions"
            expected = "NULL for the directions along the wall, or no mu"
            raise ScriptError(message, argument="mu", expected=expected)
        self.bound = self._one_bound()
        # A wall that moves in all directions drags material. Other nodes held in all directions are
        # clamps or symmetry planes.
        rest = all(v is None or (v.is_constant and v.constant == 0) for v in self.formulas)
        drags = not self.bound and None not in self.formulas and not rest
        drags = drags and hub.domain.dimension > 1
        drags = drags and len(group.nodes) < hub.fields.node_count
        hooks = HOOKS["moves" if drags else self.bound]
        self.post_update_grid_state, self.post_velocities_to_grid = hooks
        # Contact moves nodes only in free directions, so bounded nodes do not count.
        self.prescribes_velocity = not self.bound
        self.held_directions = tuple(k for k, v in enumerate(self.formulas) if v is not None)

    @property
    def nodes(self) -> np.ndarray:
        if None in self.formulas or self.bound:
            return self.group.nodes
        return self.hub.update.method.held_with(self.hub, self.group.nodes)

    def _one_bound(self) -> str:
        bounds = dict.fromkeys(v.bound for v in self.formulas if v is not None)
        if len(bounds) > 1:
            lines = [
                f"fix(ID{k}, velocity_nodes, {self.group.id}, "
                + ", ".join(b + v.text if v and v.bound == b else "NULL" for v in self.formulas)
                + ")"
                for k, b in enumerate(bounds, 1)
            ]
            message = "a fix has bounds of one kind: leq, geq, or none"
            hint = "fixes with different IDs: " + " and ".join(lines)
            raise ScriptError(message, argument="velocity", hint=hint)
        return next(iter(bounds), "")

    def defined(self) -> None:
        if self.hub.domain.h is None:
            return
        self.group.refuse_past_domain()
        self._refuse_periodic_edges()
        if self.bound:
            return
        for other in self.hub.fixes.values():
            if other is self or not isinstance(other, VelocityNodes) or other.bound:
                continue
            axes = unlike(other, self)
            shared = np.intersect1d(self.group.members, other.group.members) if axes else ()
            if len(shared) and other.mark:
                names = " and ".join(f"v{AXES[k]}" for k in axes)
                count = plural(len(shared), "node")
                self.hub.warn(
                    f"fix '{other.id}' (line {other.mark.line}) gives {count} of this group a "
                    f"different {names}: this fix applies there",
                    hint="groups that have no nodes in common, or NULL for one of the components",
                )

    def _refuse_periodic_edges(self) -> None:
        domain = self.hub.domain
        for k in {*self.held_directions} & {*domain.periodic}:
            x = self.hub.lattices[0].positions(self.group.nodes)[:, k]
            from_edge = np.abs((x - domain.lo[k]) / domain.h) % domain.cells_of_period(k)
            if len(x) and domain.cells_of_period(k) > 1 and (from_edge < 1e-6).all():
                raise ScriptError(
                    f"fix '{self.id}' is a wall on the edges of a periodic cell",
                    mark=self.mark,
                    expected=f"NULL for v{AXES[k]}, or boundary(periodic, ...) without {AXES[k]}",
                )


class InitialVelocityNodes(InitialFix):
    """Set the velocity of nodes once, in the next step.

    Parameters
    ----------
    velocity
        vx, vy, vz, one per dimension: functions of x0, y0, z0. NULL leaves a component unchanged.

    Example
    -------
    fix(kick, initial_velocity_nodes, all, 0.1*sin(x0), NULL)

    See Also
    --------
    initial_velocity_particles
    """

    syntax = "group, vx[, vy[, vz]]"

    def __init__(self, hub: Hub, group: NodeGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "v", velocity)

    def _impose(self, v: np.ndarray, nodes: NodesView) -> None:
        x = nodes.position[:, : v.shape[1]]
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                v[:, k] = formula.evaluate_points(self.hub.values, x, x)

    def post_update_grid_state(self, nodes: NodesView) -> None:
        self._impose(nodes.velocity_update, nodes)

    def post_velocities_to_grid(self, nodes: NodesView) -> None:
        self._impose(nodes.velocity, nodes)


class Reaction(Compute):
    """Measure the reaction at nodes with prescribed velocity, published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of nodes, or ``all``. The group must include all or no nodes of each fix
        velocity_nodes.

    Example
    -------
    compute(R, reaction, all)
    log_modify(custom, time, R_x, R_y)

    Notes
    -----
    The reactions of fixes velocity_nodes in the group are summed, and 0 before the first step.

    See Also
    --------
    force_on, fix velocity_nodes, internal_force
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: NodeGroup):
        super().__init__(hub, group)

    def refresh(self) -> None:
        total = np.zeros(3)
        for fix in self.hub.fixes.values():
            if isinstance(fix, VelocityNodes) and self._contains(fix):
                total += [self.hub.values.get(f"{fix.id}_{axis}") for axis in "xyz"]
        self.publish_components(total)

    def _contains(self, fix) -> bool:
        if self.group.all:
            return True
        inside = np.isin(fix.group.members, self.group.members)
        if inside.any() and not inside.all():
            raise ScriptError(
                f"fix '{fix.id}' holds nodes inside and outside of group '{self.group.id}': its "
                "reaction contains both",
                mark=self.mark,
                expected="a group that has all nodes of a fix or none",
                hint=f"two fixes, one for the nodes of {self.group.id}, instead of '{fix.id}'",
            )
        return bool(inside.all()) and len(inside) > 0
