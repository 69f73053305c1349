"""Rows of a step for rotation around an axis; nodes have one velocity component around the axis."""

from typing import Any, NamedTuple

from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays, contact_twist  # noqa: F401
from karamelo_py.kernels.equations import node_updates as nodes
from karamelo_py.kernels.equations import twist
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.table import Added, AtNodes, NodeTask, any_node, scene_additions
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


AGAIN = AtNodes(arrays.POST_ROTATION_TO_GRID, arrays.ON_VELOCITY, at_its_nodes)


def _task(task: Any) -> NodeTask:
    return NodeTask(task, at_its_nodes)


HELD = AtNodes(arrays.POST_UPDATE_GRID_ROTATION, arrays.ON_UPDATE, at_its_nodes)
LIMITED = NodeTask(nodes.UpdateToVelocity, at_its_nodes, make=any_node)
ADDITIONS = (
    (MassMomentum, Added(then=(twist.RotationToNodes(),))),
    (InternalForce, Added(then=(twist.Torque(),))),
    (MomentumAgain, Added(then=(twist.RotationAgain(),))),
    (
        nodes.NodalUpdate,
        Added(before=(_task(nodes.NodalUpdate()), HELD, NodeTask(twist.PushOutwards()))),
    ),
    (nodes.SumsToVelocity, Added(before=(_task(nodes.SumsToVelocity()), AGAIN))),
    (nodes.MomentumToVelocity, Added(before=(_task(nodes.MomentumToVelocity()), AGAIN))),
    (nodes.UpdateToVelocity, Added(before=(LIMITED,))),
    (Move, Added(then=(twist.Rotate(),))),
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


@scene_additions.on(Rotating)
def _additions_rotating(tag):
    return ADDITIONS


def rotating(kin: Any, transfer: Any) -> tuple[Rotating, ...]:
    if not isinstance(kin, Twisted):
        return ()
    return (RotatingByMoments() if stores_moment(transfer) else Rotating(),)
