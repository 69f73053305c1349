"""Strength of one point: deviatoric stress from strain. One file each.

A strength is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). What it remembers of the past (plastic strain and
the like) is its memory, a flat tuple with as many numbers as it needs, none at best. `heat` is the
temperature (T,), or () where the law has none.

Strengths that depend on pressure, and change the volume, have `pressure_response` in the place of
`shear_response` (`karamelo_py.points.laws.strength.frictional`).
"""

from karamelo_py.compiler.compile import point_function


@point_function()
def initial_memory(strength, like):
    """The memory of a point without a past, in the number type of `like`."""


@point_function()
def shear_response(strength, kin, s, strain, memory, heat, dt):
    """Deviatoric stress, memory, and work per volume that is not stored, after a step dt.

    `s` is the old deviatoric stress, turned with the point already; `strain`, the increment, is not
    deviatoric.
    """


@point_function()
def pressure_response(strength, kin, s, p, K, strain):
    """Deviatoric stress and pressure on or within the yield surface, from an elastic trial.

    `K` is the bulk modulus, `strain` the equivalent plastic strain.
    """


@point_function()
def initial_loss(strength, like):
    """(0,) for a strength that dissipates energy, or ()."""


@initial_loss.otherwise
def _(strength, like):
    return ()


@point_function()
def elastic_ratio(strength, memory, j):
    """The part of the volume ratio j that is elastic: what makes pressure."""


@elastic_ratio.otherwise
def _(strength, memory, j):
    return j


@point_function()
def with_elastic_ratio(strength, memory, j, elastic):
    """The memory with which `elastic_ratio` of j is `elastic`."""


@point_function()
def shear_modulus(strength):
    """Stiffness against a further change of shape, for the speed of waves."""


@point_function()
def viscosity_of(strength):
    """(mu, h) of a viscous strength, h the cell size, or ()."""


@viscosity_of.otherwise
def _(strength):
    return ()


@point_function()
def shear_strain(strength, kin, s):
    """Elastic part of the deviatoric strain, as a symmetric tensor."""


@point_function()
def shear_energy(strength, kin, s):
    """Energy stored by elastic shear, per present volume."""


@point_function()
def equivalent_plastic_strain(strength, memory):
    """Sum of sqrt(2/3 d:d) of the plastic strain increments d."""
