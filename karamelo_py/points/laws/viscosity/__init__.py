"""Viscous pressure of one point, which spreads shocks over a few cells. One file each.

A viscosity is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). Its memory, a flat tuple, is the viscous pressure.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function


class NoViscosity(NamedTuple):
    """Tag of laws without."""


@point_function()
def initial_viscous_pressure(viscosity, like):
    """The viscous pressure at rest, or () where there is none."""


@initial_viscous_pressure.otherwise
def _(viscosity, like):
    return ()


@point_function()
def viscous_pressure(viscosity, rate, density, sound):
    """The memory at a rate of volume change: viscous pressure, positive in compression."""


@viscous_pressure.otherwise
def _(viscosity, rate, density, sound):
    return ()


@point_function()
def viscous_speed(viscosity, memory, density, sound):
    """(nu / h,), nu the kinematic viscosity against compression and h the cell size, or ()."""


@viscous_speed.otherwise
def _(viscosity, memory, density, sound):
    return ()
