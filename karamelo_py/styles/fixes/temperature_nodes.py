"""fix temperature_nodes: a given temperature at nodes."""

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.heat import HeatFix


def prescribe(capacity, T, T_star, flow, value, before, dt, share):
    """T* is the value; the total is the heat per time that takes."""
    return T, value, flow, capacity * (value - T_star) / dt


def prescribe_mapped(capacity, T, T_star, flow, value, before, dt, share):
    """The temperature whose gradient makes heat flow is the value."""
    return value, value, flow, 0.0


class TemperatureNodes(HeatFix):
    """Prescribe the temperature of nodes: hot and cold walls.

    Parameters
    ----------
    T
        Temperature: a number or a formula of x0, y0, z0, time and published values.

    Example
    -------
    fix(hot, temperature_nodes, left, 400)
    fix(oven, temperature_nodes, all, 298 + 50*min(time/10, 1))

    Notes
    -----
    Publishes the heat per time that the nodes need for it as ID_s. Where several such fixes hold a
    node, the last of them decides and has the heat of that node.

    See Also
    --------
    temperature_particles, heat_flux_particles, convection_particles, method
    """

    post_heat_to_grid = node_hook(prescribe_mapped, publishes=False)
    post_update_grid_heat = node_hook(prescribe, holds=True)

    def __init__(self, hub: Hub, group: NodeGroup, T: Expression):
        super().__init__(hub, group, T)
