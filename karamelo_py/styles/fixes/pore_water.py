"""Fixes for water in the pores."""

from typing import Annotated, Any, Literal

from karamelo_py.compiler import where
from karamelo_py.kernels.equations.pore_water import WAYS, Flux, GivenFlux, GivenPressure
from karamelo_py.kernels.pore_water import impose_pore_pressure
from karamelo_py.points.kinematics import total
from karamelo_py.points.laws.pore_water import Saturated
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, InitialFix, PointsView, vector_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression


def give(flux, values, dt):
    """Return the pressure; publish the mass flow rate of the water that leaves."""
    return (values[0], 0 * values[0]), flux[-1]


def give_one_way(flux, values, dt):
    return (values[0], 1 + 0 * values[0]), flux[-1]


def supply(rates, values, dt):
    """Return the flux; publish minus the mass flow rate of the water that enters."""
    q, way, rho = values
    ways = range(len(rates))
    gave = total([where(way == k, rates[k], 0) for k in ways])
    return tuple([where(way == k, rho * q, rates[k]) for k in ways]), -gave


FROM_FLUX: dict[str, Any] = {
    "reads": (Flux,), "writes": (GivenPressure,), "publishes": True, "nodes": True,
}  # fmt: skip


class PorePressure(Fix):
    """Prescribe the pore pressure at nodes, where water can enter and leave: drains, reservoirs.

    Parameters
    ----------
    p
        Pressure of the water, a function of x0, y0, z0, time and published values.

    Example
    -------
    fix(drain, pore_pressure, top, 0)
    fix(lake, pore_pressure, bed, 9810*(12 - y0))

    Notes
    -----
    Surfaces without this fix are impermeable. The group should contain the nodes at the surface,
    or, in ulmpm, on both sides of a surface that moves within a cell. The pressure does not load
    the soil: add the weight of a lake on its bed by fix edge_traction. Publishes ID_s, the mass
    flow rate of the water that left in the previous step.

    See Also
    --------
    pore_water, initial_pore_pressure
    """

    published = ("s",)
    node_fields = (GivenPressure, Flux)
    conserves = water_only = True

    post_particles_to_grid = vector_hook(give, **FROM_FLUX)

    def __init__(self, hub: Hub, group: NodeGroup, p: Expression):
        super().__init__(hub, group)
        self.formulas = (Expression(p),)
        refuse_dry(hub)

    def defined(self) -> None:
        self.group.refuse_past_domain()


class SeepageFace(PorePressure):
    """Let water seep out of the soil at nodes, but not in: a slope, a well, a dam's toe.

    Parameters
    ----------
    p
        Pressure at which water leaves, usually 0.

    Example
    -------
    fix(face, seepage_face, slope, 0)

    Notes
    -----
    While the pressure in the soil is above p, a node is open and has the pressure p; otherwise it
    is impermeable. Publishes ID_s, as fix pore_pressure does.

    See Also
    --------
    pore_pressure, flux, pore_water
    """

    post_particles_to_grid = vector_hook(give_one_way, **FROM_FLUX)


class WaterFlux(Fix):
    """Prescribe the inflow of water at nodes: rain, wells, injection.

    Parameters
    ----------
    q
        Volume of water that enters per unit time and unit area (negative if it leaves), a function
        of x0, y0, z0, time and published values.
    through
        Faces through which the water enters, named by their outward direction, or any ``surface``.
        ``volume``: q is per unit volume of the body instead.

    Example
    -------
    fix(rain, flux, top, 1e-6, yhi)
    fix(well, flux, screen, -2e-4, volume)

    Notes
    -----
    At nodes that are also open (fix pore_pressure, or an active fix seepage_face), the inflow
    leaves at once: rain runs off. Publishes ID_s, the mass flow rate of the water that left in the
    previous step, negative if it entered.

    See Also
    --------
    pore_pressure, seepage_face, pore_water
    """

    published = ("s",)
    node_fields = (GivenFlux,)

    post_particles_to_grid = vector_hook(
        supply, reads=(GivenFlux,), writes=(GivenFlux,), publishes=True, nodes=True
    )

    def __init__(
        self, hub: Hub, group: NodeGroup, q: Expression, through: Annotated[str, Literal[WAYS]]
    ):
        super().__init__(hub, group)
        refuse_dry(hub)
        d, way = hub.domain.dimension, WAYS.index(through)
        if 2 * d <= way < WAYS.index("surface"):
            raise ScriptError(
                f"the scene has no direction {through[0]}",
                argument="through",
                expected=", ".join((*WAYS[: 2 * d], *WAYS[-2:])),
            )
        fluids = (solid.material.fluid for solid in hub.solids.values())
        densities = sorted({fluid.rho for fluid in fluids if fluid is not None})
        if len(densities) > 1:
            raise ScriptError(
                "solids have water of different densities, " + " and ".join(map(str, densities)),
                argument="group",
                expected="pore_water with one rho",
            )
        way -= (6 - 2 * d) * (way >= 6)  # numbers of the ways as in `GivenFlux`
        self.formulas = (q, Expression(float(way)), Expression(densities[0]))

    defined = PorePressure.defined


class InitialPorePressure(InitialFix):
    """Set the pore pressure of points once, before the next step.

    Parameters
    ----------
    p
        Pore pressure, a function of x, y, z, x0, y0, z0.

    Example
    -------
    fix(table, initial_pore_pressure, all, 9810*(10 - y0))

    Notes
    -----
    Dry points are unaffected. The stress of the soil does not change: see fix initial_stress.

    See Also
    --------
    pore_pressure, initial_stress
    """

    water_only = True

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
