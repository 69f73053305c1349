"""Fixes for heat."""

from math import inf
from typing import Any

import numpy as np

from karamelo_py.output.point_table import places_before, volumes_before
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import LAST, Fix, heat_hook, node_hook
from karamelo_py.scene.solid import COLD, WARM
from karamelo_py.script.errors import ScriptError, render_message
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.velocity_nodes import prescribe_mapped


class HeatFix(Fix):
    published = ("s",)

    def __init__(self, hub: Hub, group: Any, *formulas: Any):
        super().__init__(hub, group)
        if not hub.update.thermal:
            raise ScriptError(
                "the method is mechanical: no heat flows", expected="method(..., thermo-mechanical)"
            )
        self.formulas = formulas

    def _compare(self, T: Expression) -> None:
        begins = (solid.T0 for solid in self.hub.solids.values() if solid.T0 is not None)
        warmest = max(begins, default=-inf)
        if T.is_constant and T.constant < COLD and warmest - T.constant > WARM:
            self.hub.warn(
                f"the temperature is {T.constant:g}, but bodies start at {warmest:g}",
                hint="kelvin throughout, or degrees Celsius throughout",
            )

    def _look_inside(self) -> None:
        for solid in self.hub.solids.values():
            if not 0 < solid.count < MANY:
                continue
            numbers = np.arange(solid.count)
            deep = np.ptp(solid.x0_of(numbers), axis=0) > 5 * solid.half_size.max(axis=0)
            if deep.all() and self.group.has(numbers + solid.first_id).all():
                self.hub.warn(
                    f"all points of solid '{solid.id}' get heat as if each had an outer face",
                    hint="a group of one layer of points along the surface",
                )


def check_coefficient(h: Expression) -> None:
    if h.is_constant and not h.constant >= 0:
        message = f"the heat transfer coefficient is {h.constant:g}"
        expected = "a number of at least 0; whether it heats or cools follows from T_inf"
        raise ScriptError(message, argument="h", expected=expected)


MANY = 1_000_000  # largest number of points of a solid that is checked


def hold_node(node):
    """Set T of a node to the value; the published sum is the heating power for this."""
    capacity, T, T_star, flow, value, _, dt, _ = node
    return T, value, flow, capacity * (value - T_star) / dt


class TemperatureNodes(HeatFix):
    """Prescribe the temperature of nodes: hot and cold walls.

    Parameters
    ----------
    T
        Temperature, a function of x0, y0, z0, time and published values.

    Example
    -------
    fix(hot, temperature_nodes, left, 400)
    fix(oven, temperature_nodes, all, 298 + 50*min(time/10, 1))

    Notes
    -----
    Publishes the required heating power as ID_s. If several such fixes include a node, the last one
    applies and publishes the heat.

    See Also
    --------
    temperature_particles, heat_flux_particles, convection_particles, method
    """

    # Temperatures are prescribed before heat flows, so that gradients include them.
    post_heat_to_grid = node_hook(prescribe_mapped, publishes=False)
    post_update_grid_heat = node_hook(hold_node, holds=True)

    def __init__(self, hub: Hub, group: NodeGroup, T: Expression):
        super().__init__(hub, group, T)
        self._compare(T)

    def defined(self) -> None:
        self.group.refuse_past_domain()


def hold_point(pt):
    return 0.0, pt.supply, pt.value


class TemperatureParticles(HeatFix):
    """Prescribe the temperature of points, which then heat or cool the points around them.

    Parameters
    ----------
    T
        Temperature, a function of x, y, z, x0, y0, z0, time and published values.

    Example
    -------
    fix(hot, temperature_particles, heater, 400)

    Notes
    -----
    The fix publishes nothing.

    See Also
    --------
    temperature_nodes, heat_flux_particles, convection_particles, method
    """

    published = ()
    supply_heat = heat_hook(hold_point)

    def __init__(self, hub: Hub, group: ParticleGroup, T: Expression):
        super().__init__(hub, group, T)
        self._compare(T)


def heat(pt):
    return 1.0, pt.supply + pt.face * pt.value, pt.T


class FacesOfPoints(HeatFix):
    by_sizes = True

    def defined(self) -> None:
        hub, d = self.hub, self.hub.domain.dimension
        if hub.rehearsing or d == 1 or not len(self.group):
            return
        self._look_inside()
        area = 0.0
        for ids in self.group.pieces():
            volume, x = volumes_before(hub, ids), places_before(hub, ids)
            depth = hub.domain.depth(x)
            area += float((depth * (volume / depth) ** (1 - 1 / d)).sum())
        per = hub.domain.kin.per
        words = (
            f"fix {self.style} '{self.id}': {len(self.group)} points cover an area of {area:.4g}"
            f"{per}"
        )
        hint = f"fix {self.on_edge} takes the area of the surface of a region"
        hub.console.say(render_message("note", words, hint=hint))


class HeatFluxParticles(FacesOfPoints):
    """Apply a heat flux to points at the surface of a body: lasers, flames, friction.

    Parameters
    ----------
    group
        A single layer of points along the surface.
    q
        Heat per unit area and unit time, negative if it leaves the body, a function of x, y, z, x0,
        y0, z0, time and published values.

    Example
    -------
    fix(laser, heat_flux_particles, top, 1e6*exp(-(x/0.01)^2))

    Notes
    -----
    Each point has one outer face, with the area of a side of a cube of its volume (in 1D the whole
    section). A point at a corner of the body, with two outer faces, needs two fixes. In axisymmetry
    the face is at the radius of the point, slightly inside the surface. On curved surfaces the
    total area, which is printed, is 0.66 to 1.44 times the true area, depending on the layer of
    points; edge_heat_flux uses the exact area. Publishes the heating power as ID_s (in 2D per unit
    thickness, in axisymmetry per radian).

    See Also
    --------
    edge_heat_flux, convection_particles, temperature_nodes, temperature_particles, method
    """

    on_edge = "edge_heat_flux"
    supply_heat = heat_hook(heat)

    def __init__(self, hub: Hub, group: ParticleGroup, q: Expression):
        super().__init__(hub, group, q)


def exchange(pt):
    """Apply Newton's law of cooling, with the temperature of the point after the step.

    With the temperature before the step, a large coefficient would cool the point below the fluid.
    """
    if not pt.capacity > 0:
        return 1.0, pt.supply, pt.T
    rate = pt.face * pt.value
    return 1.0, pt.supply + rate * (pt.other - pt.T) / (1 + rate * pt.dt / pt.capacity), pt.T


class ConvectionParticles(FacesOfPoints):
    """Apply convection to points at the surface of a body: q = h (T_inf - T).

    Parameters
    ----------
    group
        A single layer of points along the surface.
    h
        Heat transfer coefficient, heat per unit area, time and kelvin, a function of x, y, z, x0,
        y0, z0, time and published values.
    T_inf
        Temperature of the surrounding fluid, a function of the same quantities.

    Example
    -------
    fix(air, convection_particles, surface, 25, 293)

    Notes
    -----
    Faces are as in heat_flux_particles. Publishes the heating power of all points as ID_s.

    See Also
    --------
    edge_convection, heat_flux_particles, temperature_nodes, temperature_particles, method
    """

    on_edge = "edge_convection"
    order = LAST  # after the fixes whose heat it limits
    supply_heat = heat_hook(exchange, holds=True)

    def __init__(self, hub: Hub, group: ParticleGroup, h: Expression, T_inf: Expression):
        super().__init__(hub, group, h, T_inf)
        self._compare(T_inf)
        check_coefficient(h)
