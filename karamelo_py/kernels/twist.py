"""Rows of rotation around an axis; nodes have one component, as for heat."""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays, contact_twist, hook_loop  # noqa: F401
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.equations import node_updates as nodes
from karamelo_py.kernels.equations import twist
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.table import (
    Company,
    NodeTask,
    Processor,
    any_node,
    companies,
    take,
)
from karamelo_py.points.kinematics import Line
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.transfers import stores_moment


def at_its_nodes(s):
    of = s.nodes.fields
    rotating = arrays.Nodes(
        field(of, twist.SumsAround),
        field(of, twist.UpdateAround),
        field(of, twist.AngularVelocity),
        (),
    )
    return arrays.with_items(s, nodes=rotating)._replace(kin=Line())


class AtRotation(NamedTuple):
    """Fixes act on the nodes' angular velocity."""

    stage: int
    target: int


@point_function(otherwise=True)
def at_rotation(hooks, stage, target, s):
    pass


@at_rotation.on(arrays.Hooks)
def _at_rotation_hooks(hooks, stage, target, s):
    here, heat = at_its_nodes(s), s.control.heat[0]
    members = hook_loop.hooked_nodes(here, target, s.control.step[0].kept)
    hook_loop.node_hooks(stage, members, hooks, here, kick(s))
    heat.set_low = heat.set_high = 0.0  # used by temperatures only


@take.on(AtRotation, Processor)
def _at_rotation(row, s, step):
    at_rotation(step.hooks, row.stage, row.target, s)


AGAIN = AtRotation(arrays.POST_ROTATION_TO_GRID, arrays.ON_VELOCITY)


def _task(task: Any) -> NodeTask:
    return NodeTask(task, at_its_nodes)


HELD = AtRotation(arrays.POST_UPDATE_GRID_ROTATION, arrays.ON_UPDATE)
LIMITED = NodeTask(nodes.UpdateToVelocity, at_its_nodes, make=any_node)
COMPANIES = (
    (MassMomentum, Company(then=(twist.RotationToNodes(),))),
    (InternalForce, Company(then=(twist.Torque(),))),
    (MomentumAgain, Company(then=(twist.RotationAgain(),))),
    (
        nodes.NodalUpdate,
        Company(before=(_task(nodes.NodalUpdate()), HELD, NodeTask(twist.PushOutwards()))),
    ),
    (nodes.SumsToVelocity, Company(before=(_task(nodes.SumsToVelocity()), AGAIN))),
    (nodes.MomentumToVelocity, Company(before=(_task(nodes.MomentumToVelocity()), AGAIN))),
    (nodes.UpdateToVelocity, Company(before=(LIMITED,))),
    (Move, Company(then=(twist.Rotate(),))),
)


class Rotating(NamedTuple):
    """Fields of rotation around the axis, and rows that accompany tasks and quantities."""

    point_fields = (twist.VelocityAround, twist.AngleAround, twist.RadiusAfterMove)
    node_fields = (
        twist.SumsAround, twist.MomentumAround, twist.UpdateAround, twist.AngularVelocity,
    )  # fmt: skip


class RotatingByMoments(Rotating):
    __slots__ = ()
    point_fields = (*Rotating.point_fields, twist.MomentAround)


@companies.on(Rotating)
def _companies_rotating(tag):
    return COMPANIES


def rotating(kin: Any, transfer: Any) -> tuple[Rotating, ...]:
    if not isinstance(kin, Twisted):
        return ()
    return (RotatingByMoments() if stores_moment(transfer) else Rotating(),)
