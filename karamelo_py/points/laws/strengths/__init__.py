"""Strength of one point: deviatoric stress from strain. One file each.

A strength is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). Its memory (plastic strain and the like) is a NamedTuple
of as many numbers as needed, preferably none (`remembers`). `heat` is the temperature (`Warm`), or
() if the law has none.

Strengths that depend on pressure, and change the volume, define `pressure_response` instead of
`shear_response` (`karamelo_py.points.laws.strengths.frictional`). The defaults are those of an
elastic strength with a shear modulus ``G`` and no memory.
"""

import sys
from collections import namedtuple
from typing import NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws import column


class Remembered(NamedTuple):
    """Tag of a number in the memory of a strength, by its index."""

    place: int


def remembers(strength: type, **numbers: float | str) -> None:
    """Declare the memory of `strength`: the names of its numbers.

    Parameters
    ----------
    strength
        The class.
    **numbers
        For each number the name of its column, and its initial value: a number, or the name of a
        parameter. ``ep`` is the equivalent plastic strain; it comes first.
    """
    name = f"{strength.__name__}Memory"
    made = namedtuple(name, numbers, module=strength.__module__)
    setattr(sys.modules[strength.__module__], name, made)  # cached kernels refer to it
    starts = tuple(numbers.values())
    parameters = tuple(start if isinstance(start, str) else "" for start in starts)

    @initial_memory.on(strength)
    def _initial_memory_strength(strength, like):
        pairs = zip(parameters, starts, strict=True)
        return made(*[getattr(strength, name) if name else start for name, start in pairs])

    for place, name in enumerate(numbers):
        column(strength, name, Remembered(place))
    if "ep" in numbers:
        initial_loss.on(strength)(lambda strength, like: (0.0,))
        equivalent_plastic_strain.on(strength)(lambda strength, memory: memory.ep)


@point_function(otherwise=True)
def initial_memory(strength, like):
    """Initial memory of a point."""
    return ()


@point_function(otherwise=True)
def respond(strength, law, kin, s, strain, j, memories, dt, beside):
    """Deviatoric stress, memory, and work per volume that is not stored, after a step dt.

    `s` is the old deviatoric stress, already rotated with the point; `strain`, the increment, is
    not deviatoric; `memories` are the memories of all parts of the `law`. With F-bar, forces have
    `beside` more pressure than the point.
    """
    return shear_response(strength, kin, s, strain, memories.strength, memories.heat, dt)


@point_function()
def shear_response(strength, kin, s, strain, memory, heat, dt):
    """As `respond`, for strengths that need nothing from the other parts."""


@point_function()
def pressure_response(strength, kin, s, p, K, strain):
    """Deviatoric stress and pressure on or inside the yield surface, from an elastic trial.

    `K` is the bulk modulus, `strain` the equivalent plastic strain.
    """


@point_function()
def share_beside(strength, memory):
    """The fraction of the averaged pressure that the yield surface uses, with F-bar.

    Undefined for strengths that do not depend on pressure.
    """


@point_function(otherwise=True)
def initial_loss(strength, like):
    """(0,) for a strength that dissipates energy, or ()."""
    return ()


@point_function(otherwise=True)
def elastic_ratio(strength, memory, j):
    """The elastic part of the volume ratio j, which determines pressure."""
    return j


@point_function(otherwise=True)
def shear_modulus(strength):
    """Stiffness against further shear, for the wave speed."""
    return strength.G


@point_function(otherwise=True)
def damped_speed_squared(strength, squared, density):
    """The squared wave speed, increased by viscosity, which reduces the stable step."""
    return squared


@point_function(otherwise=True)
def shear_strain(strength, kin, s):
    """Elastic part of the deviatoric strain, as a symmetric tensor."""
    return 0.5 / strength.G * s


@point_function(otherwise=True)
def shear_energy(strength, kin, s):
    """Energy stored by elastic shear, per present volume."""
    return 0.25 / strength.G * inner(s, s)


@point_function(otherwise=True)
def equivalent_plastic_strain(strength, memory):
    """Sum of sqrt(2/3 d:d) of the plastic strain increments d."""
    return 0
