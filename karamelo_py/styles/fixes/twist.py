"""Fixes for axisymmetric bodies that twist."""

from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.velocity_nodes import prescribe, prescribe_mapped, prescribe_motion


class AngularVelocityNodes(Fix):
    """Prescribe the angular velocity of nodes around the axis: grips, rotating walls.

    Parameters
    ----------
    omega
        Angular velocity in radians per unit time, positive from x to z: a function of x0, y0, time
        and published values.

    Example
    -------
    fix(clamp, angular_velocity_nodes, bottom, 0)
    fix(grip, angular_velocity_nodes, top, 0.1*min(time, 1))

    Notes
    -----
    The scene needs axisymmetric(true, twist=true). The velocity around the axis is omega times the
    radius. Publishes the torque on the nodes, per radian, as ID_s. If several such fixes include a
    node, the last one applies.

    See Also
    --------
    velocity_nodes, initial_velocity_particles, axisymmetric
    """

    published = ("s",)
    prescribes_rotation = True

    post_rotation_to_grid = node_hook(prescribe_mapped, publishes=False)

    def __init__(self, hub: Hub, group: NodeGroup, omega: Expression):
        super().__init__(hub, group)
        if not isinstance(hub.require_domain().kin, Twisted):
            message = "nothing rotates around an axis in this scene"
            expected = "axisymmetric(true, twist=true) before the first solid"
            raise ScriptError(message, argument="group", expected=expected)
        self.formulas = (omega,)
        rests = omega.is_constant and omega.constant == 0
        update = prescribe if rests else prescribe_motion
        self.post_update_grid_rotation = node_hook(update, uses_before=True, holds=True)

    def defined(self) -> None:
        self.group.refuse_past_domain()
