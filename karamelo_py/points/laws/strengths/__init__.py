"""Strengths: deviatoric stress of a point from its strain, one file each.

A strength is a NamedTuple of parameters, a part of `eos_strength`. `heat` is the temperature
(`Warm`) or (). Strengths that depend on pressure and change the volume define `pressure_response`
instead of `shear_response`. The default functions are for an elastic strength, with a shear modulus
``G`` and no history variables.
"""

import sys
from collections import namedtuple
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.kinematics import inner, nothing
from karamelo_py.points.laws import answers, column


class StrainStep(NamedTuple):
    s: Any  # stress before the step, rotated with the point
    strain: Any  # strain increment, including volume change
    j: Any  # volume ratio after the step
    dt: Any
    extra: Any  # pressure in the nodal forces minus pressure of the point (F-bar)


class FrictionTrial(NamedTuple):
    s: Any  # deviatoric stress
    p: Any
    K: Any


class Remembered(NamedTuple):
    index: int


def remembers(strength: type, **numbers: float | str) -> None:
    """Declare a strength's history variables: names (also of dump columns) and initial values.

    A value is a number or the name of a parameter; ``ep`` (equivalent plastic strain) is first.
    """
    name = f"{strength.__name__}Memory"
    memory_class = namedtuple(name, numbers, module=strength.__module__)
    setattr(sys.modules[strength.__module__], name, memory_class)  # for cached kernels
    starts = tuple(numbers.values())
    parameters = tuple(start if isinstance(start, str) else "" for start in starts)

    @initial_memory.on(strength)
    def _initial_memory_strength(strength, template):
        pairs = zip(parameters, starts, strict=True)
        return memory_class(*[getattr(strength, name) if name else start for name, start in pairs])

    for index, name in enumerate(numbers):
        column(strength, name, Remembered(index))
    if "ep" in numbers:
        initial_loss.on(strength)(no_loss_yet)
        equivalent_plastic_strain.on(strength)(stored_plastic_strain)


@point_function(otherwise=True)
def initial_memory(strength, template):
    return ()


@point_function(otherwise=True)
def respond(strength, law, kin, step, memories):
    """Return deviatoric stress, history, and dissipated work per volume after a `StrainStep`.

    `memories` holds the history variables of all parts of the `law`.
    """
    return shear_response(strength, kin, step, memories.strength, memories.heat)


@point_function()
def shear_response(strength, kin, step, memory, heat):
    """Return the results of `respond`, for strengths that are independent of other parts."""


@point_function()
def pressure_response(strength, kin, trial, strain):
    """Return deviatoric stress and pressure on or inside the yield surface, from a `FrictionTrial`.

    `strain` is the equivalent plastic strain.
    """


@point_function()
def fbar_fraction(strength, memory):
    """Return the fraction of F-bar's averaged pressure that a yield surface uses."""


@point_function(otherwise=True)
def initial_loss(strength, template):
    """Return (0,) if the strength dissipates energy, else ()."""
    return ()


def no_loss_yet(strength, template):
    return (0.0,)


def without_shear_stiffness(strength: type) -> type:
    """Declare a strength without elastic shear, whose work is dissipated (class decorator)."""
    answers(strength, {shear_modulus: 0, shear_energy: 0})
    initial_loss.on(strength)(no_loss_yet)

    @shear_strain.on(strength)
    def _no_shear_strain(strength, kin, s):
        return nothing(kin)

    return strength


@point_function(otherwise=True)
def inelastic_ratio(strength, memory):
    """Return (ratio,), the volume ratio of plastic flow or gaps, or ()."""
    return ()


@point_function(otherwise=True)
def elastic_ratio(strength, memory, j):
    """Return the elastic part of the volume ratio j, which determines pressure."""
    for inelastic in inelastic_ratio(strength, memory):
        j = j / inelastic
    return j


@point_function(otherwise=True)
def added_pressure(strength, memory):
    """Return the pressure that is added to the pressure of the equation of state."""
    return 0


@point_function(otherwise=True)
def added_energy(strength, law, elastic, memories):
    """Return the energy of the added pressure at the elastic volume ratio."""
    return 0


@point_function(otherwise=True)
def present(strength, memory):
    """Return the strength with its present shear modulus."""
    return strength


@point_function(otherwise=True)
def shear_modulus(strength):
    return strength.G


@point_function(otherwise=True)
def damped_speed_squared(strength, squared, density):
    """Return the squared wave speed raised by viscosity, which shortens the stable step."""
    return squared


@point_function(otherwise=True)
def shear_strain(strength, kin, s):
    return 0.5 / strength.G * s


@point_function(otherwise=True)
def shear_energy(strength, kin, s):
    """Return the energy of elastic shear per present volume."""
    return 0.25 / strength.G * inner(s, s)


@point_function(otherwise=True)
def equivalent_plastic_strain(strength, memory):
    """Return the sum of sqrt(2/3 d:d) over plastic strain increments d."""
    return 0


def stored_plastic_strain(strength, memory):
    return memory.ep
