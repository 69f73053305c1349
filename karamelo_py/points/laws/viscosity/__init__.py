"""Viscous pressure of one point, which spreads shocks over a few cells. One file each.

A viscosity is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). Its memory is (q,), the viscous pressure.
"""

from math import sqrt

from karamelo_py.compiler.compile import point_function


@point_function(otherwise=True)
def initial_viscous_pressure(viscosity, like):
    """The viscous pressure at rest, or () where there is none."""
    return ()


@point_function()
def viscous_pressure(viscosity, rate, density, sound):
    """The memory at a rate of volume change: viscous pressure, positive in compression."""


@point_function()
def viscous_speed(viscosity, memory, density, sound):
    """nu / h, nu the kinematic viscosity against compression and h the cell size."""


def damped(squared, a):
    """Square of c' = sqrt(c^2 + a^2) + a, from c^2 and a = nu / h.

    Viscosity nu damps the shortest wave of a cell by xi = nu / (c h), which takes c dt / h down to
    sqrt(1 + xi^2) - xi (Belytschko et al. 2014, eq. 6.3.10): as if c were c'.
    """
    speed = sqrt(squared + a * a) + a
    return speed * speed
