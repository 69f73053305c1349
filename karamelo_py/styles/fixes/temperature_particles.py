"""fix temperature_particles: a given temperature of points."""

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import heat_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.heat import HeatFix


def prescribe(capacity, T, face, supply, value, other, dt):
    """The point has the value, whatever flows to it."""
    return 0.0, supply, value


class TemperatureParticles(HeatFix):
    """Prescribe the temperature of points: they heat what is around them.

    Parameters
    ----------
    T
        Temperature: a number or a formula of x, y, z, x0, y0, z0, time and published values.

    Example
    -------
    fix(hot, temperature_particles, heater, 400)

    Notes
    -----
    Publishes nothing.

    See Also
    --------
    temperature_nodes, heat_flux_particles, convection_particles, method
    """

    published = ()
    supply_heat = heat_hook(prescribe)

    def __init__(self, hub: Hub, group: ParticleGroup, T: Expression):
        super().__init__(hub, group, T)
