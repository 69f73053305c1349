"""What strengths that depend on pressure share: cohesion and friction, perhaps softening; memory.

The memory is (equivalent plastic strain, plastic volume ratio).
"""

from __future__ import annotations

from karamelo_py.compile import point_function, real
from karamelo_py.points.materials.strength import (
    elastic_ratio,
    equivalent_plastic_strain,
    initial_loss,
    initial_memory,
    with_elastic_ratio,
)
from karamelo_py.points.materials.strength.elastic import give_elastic_shear


@point_function()
def surface(strength, strain):
    """Cohesion, friction and dilation of the yield surface after a plastic strain."""


def give_friction(strength: type) -> None:
    """Give `strength` (with fields ``G``, ``cohesion``, ``friction``, ``dilation``) its memory."""
    give_elastic_shear(strength)

    @surface.on(strength)
    def _(strength, strain):
        return strength.cohesion, strength.friction, strength.dilation

    @initial_memory.on(strength)
    def _(strength, like):
        return (real(0, like), real(1, like))

    @initial_loss.on(strength)
    def _(strength, like):
        return (real(0, like),)

    @equivalent_plastic_strain.on(strength)
    def _(strength, memory):
        return memory[0]

    @elastic_ratio.on(strength)
    def _(strength, memory, j):
        return j / memory[1]

    @with_elastic_ratio.on(strength)
    def _(strength, memory, j, elastic):
        return (memory[0], j / elastic)


def give_softening(strength: type) -> None:
    """The same for one with ``residual_cohesion``, ``residual_friction`` and ``over``, too."""
    give_friction(strength)

    @surface.on(strength)
    def _(strength, strain):
        # In a straight line; a step uses the surface of its beginning.
        share = min(strain / strength.over, real(1, strain))
        kept = real(1, strain) - share
        cohesion = kept * strength.cohesion + share * strength.residual_cohesion
        friction = kept * strength.friction + share * strength.residual_friction
        return cohesion, friction, min(strength.dilation, friction)
