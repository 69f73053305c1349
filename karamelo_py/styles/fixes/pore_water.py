"""Fixes for water in the pores."""

from typing import Any

from karamelo_py.kernels.equations.pore_water import Flux, GivenPressure
from karamelo_py.kernels.pore_water import impose_pore_pressure
from karamelo_py.points.laws.pore_water import Saturated
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView, vector_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression


def give(flux, values, dt):
    """Return the pressure; publish the mass of water that left per time in the last step."""
    return values[0], flux[-3]


class PorePressure(Fix):
    """Open nodes to water at a given pressure: drains, free surfaces, reservoirs.

    Parameters
    ----------
    p
        Pressure of the water: a number or a formula of x0, y0, z0, time and published values.

    Example
    -------
    fix(drain, pore_pressure, top, 0)
    fix(lake, pore_pressure, bed, 9810*(12 - y0))

    Notes
    -----
    Other surfaces are impermeable. The group contains the nodes at the surface, or on both sides of
    a surface that settles within a cell (ulmpm). The pressure does not load the soil: add the
    weight of a lake on its bed by fix edge_traction. Publishes ID_s, the mass of water per time
    that left in the previous step.

    See Also
    --------
    pore_water, initial_pore_pressure
    """

    published = ("s",)
    node_fields = (GivenPressure, Flux)
    conserves = True

    post_particles_to_grid = vector_hook(
        give, reads=(Flux,), writes=(GivenPressure,), publishes=True, nodes=True
    )

    def __init__(self, hub: Hub, group: NodeGroup, p: Expression):
        super().__init__(hub, group)
        self.formulas = (Expression(p),)
        refuse_dry(hub)

    def defined(self) -> None:
        if self.hub.domain.h is not None:
            self.group.refuse_past_domain()


class InitialPorePressure(Fix):
    """Set the pressure of the water of points once, before the next step.

    Parameters
    ----------
    p
        Pressure: a number or a formula of x, y, z, x0, y0, z0.

    Example
    -------
    fix(table, initial_pore_pressure, all, 9810*(10 - y0))

    Notes
    -----
    Dry points are unaffected. The soil is not loaded: see fix initial_stress.

    See Also
    --------
    pore_pressure, initial_stress
    """

    published = ()
    first_step_only = True
    point_by_point = True

    def __init__(self, hub: Hub, group: ParticleGroup, p: Expression):
        super().__init__(hub, group)
        self.formulas = (p,)
        refuse_dry(hub)

    def initial_integrate(self, points: PointsView) -> None:
        x, x0 = points.position, points.reference_position
        pressure = self.formulas[0].evaluate_points(self.hub.values, x, x0)
        points.impose(impose_pore_pressure, pressure, Saturated)


def refuse_dry(hub: Any) -> None:
    if not any(isinstance(solid.material.law, Saturated) for solid in hub.solids.values()):
        message = "no solid has water in its pores"
        expected = "pore_water(material, n=..., permeability=...) before the solid"
        raise ScriptError(message, argument="group", expected=expected)
