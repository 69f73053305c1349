"""fix heat_flux_particles: heat that flows into points."""

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import heat_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.heat import HeatFix


def heat(capacity, T, face, supply, value, other, dt):
    """The flux goes through one face of the point."""
    return 1.0, supply + face * value, T


class HeatFluxParticles(HeatFix):
    """Let heat flow into points at the surface of a body: lasers, flames, friction.

    Parameters
    ----------
    group
        Group of points: one layer of them along the surface.
    q
        Heat per area and time, negative where it leaves the body: a number or a formula of x, y, z,
        x0, y0, z0, time and published values.

    Example
    -------
    fix(laser, heat_flux_particles, top, 1e6*exp(-(x/0.01)^2))

    Notes
    -----
    A point shows one face to what is around it, the side of a cube of its volume; in one dimension
    that is the whole section. A point at an edge of the body, with two faces outside, needs a fix
    for each; around an axis the face is at the radius of the point, somewhat inside the surface.
    Publishes the heat per time (in two dimensions per thickness, per
    radian where axisymmetric) as ID_s.

    See Also
    --------
    convection_particles, temperature_nodes, temperature_particles, method
    """

    supply_heat = heat_hook(heat, publishes=True)

    def __init__(self, hub: Hub, group: ParticleGroup, q: Expression):
        super().__init__(hub, group, q)
