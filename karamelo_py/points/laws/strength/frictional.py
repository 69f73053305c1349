"""What strengths that depend on pressure share: cohesion and friction, perhaps softening; memory.

The memory is (equivalent plastic strain, plastic volume ratio).
"""

from __future__ import annotations

from karamelo_py.compiler.compile import real, shared
from karamelo_py.points.laws.strength import (
    elastic_ratio,
    equivalent_plastic_strain,
    initial_loss,
    initial_memory,
    with_elastic_ratio,
)
from karamelo_py.points.laws.strength.elastic import give_elastic_shear


@shared
def surface(strength, strain):
    """Cohesion, friction and dilation of the yield surface after a plastic strain.

    They go from the peak to the residual in a straight line; a step uses those of its beginning.
    """
    one = real(1, strain)
    share = min(strain * strength.softening, one)
    kept = one - share
    cohesion = kept * strength.cohesion + share * strength.residual_cohesion
    friction = kept * strength.friction + share * strength.residual_friction
    return cohesion, friction, min(strength.dilation, friction)


def give_friction(strength: type) -> None:
    """Give `strength` (with a field ``G`` and those of `surface`) its memory."""
    give_elastic_shear(strength)

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
