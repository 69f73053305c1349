"""When fixes act: on nodes, and on points."""

from karamelo_py.compiler.compile import over_blocks, point_function, shared
from karamelo_py.kernels.arrays import ON_SUMS, Hooks
from karamelo_py.kernels.clock import kick, step_size
from karamelo_py.kernels.node_hooks import DONE, node_hooks
from karamelo_py.kernels.point_hooks import Motion, clear_totals, point_hooks, publish_totals
from karamelo_py.points.basis import placed
from karamelo_py.points.frames import follows
from karamelo_py.points.kinematics import planar


@point_function(otherwise=True)
def at_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes."""


@at_nodes.on(Hooks)
def _at_nodes_hooks(hooks, stage, target, s):
    clock = s.control.clock[0]
    node_hooks(
        stage, target, s.kin, s.grids, s.nodes, s.ranges, hooks, s.control, kick(s), clock.kept
    )
    clock.set_low = clock.set_high = 0.0  # of temperatures only


@point_function(otherwise=True)
def add_work(hooks, s):
    """Add up the work of the loads on nodes."""


@add_work.on(Hooks)
def _add_work_hooks(hooks, s):
    kept = s.control.clock[0].kept
    node_hooks(DONE, ON_SUMS, s.kin, s.grids, s.nodes, s.ranges, hooks, s.control, kick(s), kept)


@shared
def corners_that_move(s):
    """How many corners stand behind the position of a point, and move with it."""
    return placed(s.basis, s.kin) if follows(s.frame) else 0


@over_blocks
def hook_points(block, s, hooks, stage, now, then):
    points = block.points
    motion = Motion(points.v, points.mass, points.x[now], points.x[then], corners_that_move(s))
    point_hooks(stage, motion, planar(s.kin), points.id, hooks, s.control, step_size(s))


@point_function(otherwise=True)
def at_points(hooks, stage, then, s):
    """Let the fixes act on the points; `then` is 1 when their new positions are known, else 0."""


@at_points.on(Hooks)
def _at_points_hooks(hooks, stage, then, s):
    clear_totals(stage, hooks, s.control)
    now = s.control.clock[0].now
    hook_points(s, hooks, stage, now, 1 - now if then else now)
    publish_totals(stage, hooks, s.control)
