"""Strength of one point: deviatoric stress from strain. One file each.

A strength is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.materials.eos_strength`). What it remembers of the past (plastic strain and
the like) is its memory, a flat tuple with as many numbers as it needs, none at best.
"""

from karamelo_py.compile import point_function


@point_function()
def initial_memory(strength, like):
    """The memory of a point without a past, in the number type of `like`."""


@point_function()
def shear_response(strength, kin, s, strain, memory, dt):
    """Deviatoric stress and memory after a strain increment of a step dt.

    `s` is the old deviatoric stress, turned with the point already; `strain` is not deviatoric.
    """


@point_function()
def shear_modulus(strength):
    """Stiffness against a further change of shape, for the speed of waves."""


@point_function()
def shear_strain(strength, kin, s):
    """Elastic part of the deviatoric strain, as a symmetric tensor."""


@point_function()
def shear_energy(strength, kin, s):
    """Energy stored by elastic shear, per present volume."""


@point_function()
def equivalent_plastic_strain(strength, memory):
    """Sum of sqrt(2/3 d:d) of the plastic strain increments d."""
