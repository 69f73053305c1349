"""State of a law made of parts, and the quantities that follow from several parts.

`law` is a record with the parts of `karamelo_py.points.laws.eos_strength`. Pressure, speed of sound
and damage need more than one of them.
"""

from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function, where
from karamelo_py.compiler.tuples import either, only
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws import Absent, specific_volume
from karamelo_py.points.laws.damages import damage_after, integrity
from karamelo_py.points.laws.eos import bulk_modulus, compression_energy, pressure
from karamelo_py.points.laws.further import further_pressure
from karamelo_py.points.laws.strengths import (
    elastic_ratio,
    initial_loss,
    shear_energy,
)
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.points.laws.viscosity import (
    damped,
    initial_viscous_pressure,
    viscous_pressure,
    viscous_speed,
)


class Memory(NamedTuple):
    """States of the parts of a law at one point: tuples, empty for parts without."""

    energy: Any  # of the equation of state
    viscous: Any  # viscous pressure
    damage: Any
    heat: Any  # temperature
    loss: Any  # dissipated energy per reference volume
    strength: Any
    further: Any


def lossless(law, like):
    """(0,) where a part dissipates energy, else ()."""
    return either(initial_loss(law.strength, like), initial_viscous_pressure(law.viscosity, like))


class State(NamedTuple):
    """State of a point."""

    J: Any  # det F
    s: Any  # deviatoric stress of the intact material
    m: Memory


# ---- pressure -----------------------------------------------------------------------------------


def intact_pressure(law, j, m):
    """Pressure of the intact material, without viscous pressure."""
    elastic = elastic_ratio(law.strength, m.strength, j)
    p = pressure(law.eos, elastic, m.energy, m.heat)
    p += only(thermal_pressure(law.temperature, m.heat))
    return further_pressure(law.further, m.further, p)


def full_pressure(law, j, m):
    """The pressure in the stress: damage takes of tension, not of compression."""
    p = intact_pressure(law, j, m)
    return where(p < 0, p * borne_share(law.damage, m.damage, p), p) + only(m.viscous)


def sound(law, j, m):
    """Speed of sound without shear."""
    elastic = elastic_ratio(law.strength, m.strength, j)
    K = bulk_modulus(law.eos, elastic, m.energy, m.heat)
    return sqrt(K * specific_volume(law.eos) * j)


@point_function(otherwise=True)
def viscous_after(viscosity, law, j, m, rate):
    """Viscous pressure (q,) at a rate of volume change, or ()."""
    density = 1 / (specific_volume(law.eos) * j)
    return viscous_pressure(viscosity, rate, density, sound(law, j, m))


@viscous_after.on(Absent)
def _viscous_after_absent(viscosity, law, j, m, rate):
    return ()


@point_function(otherwise=True)
def slowed_by_viscosity(viscosity, law, j, m, squared, density):
    """The square of the speed of waves that the time step has to resolve."""
    return damped(squared, viscous_speed(viscosity, m.viscous, density, sound(law, j, m)))


@slowed_by_viscosity.on(Absent)
def _slowed_by_viscosity_absent(viscosity, law, j, m, squared, density):
    return squared


# ---- damage -------------------------------------------------------------------------------------


@point_function(otherwise=True)
def borne_share(damage, memory, like):
    """The share of a stress or energy that the damaged material bears, 1 - D."""
    return integrity(damage, memory)


@borne_share.on(Absent)
def _borne_share_absent(damage, memory, like):
    return 1


@point_function(otherwise=True)
def broken_further(damage, law, kin, m, strain, s, j, dt):
    """Memory of the damage after an increment of plastic strain; () where nothing breaks."""
    p = intact_pressure(law, j, m)
    bound = von_mises(s) + 1e-3 * abs(p)
    known = bound > 0
    triaxiality = where(known, -p / where(known, bound, 1), 0)
    return damage_after(damage, m.damage, strain, triaxiality, m.heat, dt)


@broken_further.on(Absent)
def _broken_further_absent(damage, law, kin, m, strain, s, j, dt):
    return ()


@point_function(otherwise=True)
def released(damage, law, kin, j, s, m, broken):
    """Stored energy that an increment of damage sets free."""
    shear = j * shear_energy(law.strength, kin, s)
    tension = intact_pressure(law, j, m) < 0
    energy = shear + where(tension, compression_energy(law.eos, j, m.energy), 0)
    return (integrity(damage, m.damage) - integrity(damage, broken)) * energy


@released.on(Absent)
def _released_absent(damage, law, kin, j, s, m, broken):
    return 0
