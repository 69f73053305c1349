"""Constitutive laws of one point. One file each.

A law is a NamedTuple of parameters (its class is the tag). It owns a state, a flat tuple with as
many numbers as it needs; kernels only load it, pass it on and store it. All tensors have the
components of the kinematics `kin`; `j` = det F is the volume over the reference volume. A law may
be composed of parts, NamedTuples among its parameters (`eos_strength`).
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function, real


class Whole(NamedTuple):
    """Tag of laws that have no parts."""


@point_function()
def separate(law):
    """A tag that stands for the class of a law, and its parts, five at most; () for none.

    Numba hands tuples of arrays to threads, but no tuples of such tuples: laws that are made of
    parts cross one by one.
    """


@separate.otherwise
def _(law):
    return Whole(), (law, (), (), (), ())


@point_function()
def assemble(tag, first, second, third, fourth, fifth):
    """The law again from what `separate` returned."""


@assemble.on(Whole)
def _(tag, first, second, third, fourth, fifth):
    return first


@point_function()
def initial_state(law, kin, like):
    """The state of an undeformed, unstressed point."""


@point_function()
def advance(law, kin, state, dl, dt):
    """The state after the increment dl = dt grad v of a step dt."""


@point_function()
def kirchhoff_stress(law, kin, state):
    """det F times the Cauchy stress, which times the reference volume makes the nodal forces."""


@point_function()
def cauchy_stress(law, kin, state):
    """Cauchy stress, for output."""


@point_function()
def jacobian(law, kin, state):
    """det F."""


@point_function()
def deformation(law, kin, state):
    """F, of laws whose state holds it; left out by the others."""


@point_function()
def wave_speed_squared(law, kin, state):
    """Square of the speed of the fastest small disturbance, for the stable step."""


@point_function()
def energy_density(law, kin, state):
    """Stored energy per reference volume."""


@point_function()
def driven(law, own, given):
    """Velocity of a point after a step: what the grid gives, or of rigid bodies their own."""


@driven.otherwise
def _(law, own, given):
    return given


@point_function()
def dissipated_energy(law, kin, state):
    """Energy that is gone, per reference volume; left out by laws that dissipate nothing."""


@point_function()
def damage(law, kin, state):
    """0 intact to 1 broken; left out by laws without."""


@point_function()
def damage_initiation(law, kin, state):
    """Grows from 0, damage begins at 1; left out by laws without."""


@point_function()
def temperature(law, kin, state):
    """Temperature; 0 of laws without."""


@temperature.otherwise
def _(law, kin, state):
    return specific_volume(law) - specific_volume(law)


@point_function()
def with_temperature(law, kin, state, T):
    """The state at the temperature `T`, which laws without a temperature pass over."""


@with_temperature.otherwise
def _(law, kin, state, T):
    return state


@point_function()
def heat_capacity(law, like):
    """Heat per mass and kelvin; 0 of laws without temperature."""


@heat_capacity.otherwise
def _(law, like):
    return real(0, like)


@point_function()
def conductivity(law, like):
    """Heat flux per gradient of temperature; 0 of laws without temperature."""


@conductivity.otherwise
def _(law, like):
    return real(0, like)


@point_function()
def elastic_strain(law, kin, state):
    """Elastic strain, for output."""


@point_function()
def plastic_strain(law, kin, state):
    """Equivalent plastic strain, for output; left out by laws without."""


@point_function()
def with_stress(law, kin, state, stress):
    """The state whose Cauchy stress is `stress` (initial_stress); left out by laws without."""


@point_function()
def specific_volume(law):
    """Reference volume per mass."""
