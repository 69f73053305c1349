"""Damage of one point: the share D of its strength that is gone. One file each.

A damage is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`): the stress is 1 - D times that of the intact
material, but for pressure, which also rubble bears. Equation of state and strength know nothing of
it, so that it enters once. What it remembers is its memory, a tuple.
"""

from karamelo_py.compiler.compile import point_function


@point_function(otherwise=True)
def initial_damage(damage, like):
    """The memory of an intact point, or () where nothing breaks."""
    return ()


@point_function()
def damage_after(damage, memory, strain, triaxiality, heat, dt):
    """The memory after an increment of the equivalent plastic strain in a step dt.

    `triaxiality` is the mean stress over the von Mises stress.
    """


@point_function()
def integrity(damage, memory):
    """1 - D."""


@point_function()
def initiation(damage, memory):
    """Return the initiation of damage: it grows to 1 before damage begins."""
