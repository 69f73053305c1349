"""Equations of state of one point: pressure from volume. One file each.

An equation of state is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.materials.eos_strength`). Pressure is positive in compression; `j` = det F is
the volume over the reference volume. It also has a `specific_volume`, as a law does.
"""

from karamelo_py.compile import point_function


@point_function()
def pressure(eos, j):
    """Pressure at the volume ratio j."""


@point_function()
def bulk_modulus(eos, j):
    """-j dp/dj, the stiffness against a further change of volume."""


@point_function()
def compression_energy(eos, j):
    """Integral of p dj from j to 1: the energy stored by compression, per reference volume."""


@point_function()
def ratio_at_pressure(eos, p):
    """The volume ratio at which the pressure is p."""
