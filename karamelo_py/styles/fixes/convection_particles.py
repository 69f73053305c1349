"""fix convection_particles: heat exchanged with a surrounding fluid."""

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import heat_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.heat import HeatFix


def exchange(capacity, T, face, supply, value, other, dt):
    """Newton's law of cooling through one face of the point, at its temperature after the step.

    With the temperature before it, a large coefficient would cool the point below the fluid.
    """
    if not capacity > 0:
        return 1.0, supply, T
    rate = face * value
    return 1.0, supply + rate * (other - T) / (1 + rate * dt / capacity), T


class ConvectionParticles(HeatFix):
    """Cool or heat points at the surface of a body by a fluid around it: q = h (T_inf - T).

    Parameters
    ----------
    group
        Group of points: one layer of them along the surface.
    h
        Heat transfer coefficient, heat per area, time and kelvin: a number or a formula of x, y, z,
        x0, y0, z0, time and published values.
    T_inf
        Temperature of the fluid; a number or a formula likewise.

    Example
    -------
    fix(air, convection_particles, surface, 25, 293)

    Notes
    -----
    A point shows one face to what is around it, the side of a cube of its volume; in one dimension
    that is the whole section. A point at an edge of the body, with two faces outside, needs a fix
    for each; around an axis the face is at the radius of the point, somewhat inside the surface.
    Publishes the heat per time that all points get as ID_s.

    See Also
    --------
    heat_flux_particles, temperature_nodes, temperature_particles, method
    """

    acts_last = True  # what others supply bounds the temperatures that the watch allows
    supply_heat = heat_hook(exchange, publishes=True, holds=True)

    def __init__(self, hub: Hub, group: ParticleGroup, h: Expression, T_inf: Expression):
        super().__init__(hub, group, h, T_inf)
        if h.is_constant and not h.constant >= 0:
            raise ScriptError(
                f"the heat transfer coefficient is {h.constant:g}",
                argument="h",
                expected="a number of at least 0; whether it heats or cools follows from T_inf",
            )
