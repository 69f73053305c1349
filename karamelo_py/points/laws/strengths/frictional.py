"""What strengths that depend on pressure share: cohesion and friction, perhaps softening; memory.

The memory is (equivalent plastic strain, plastic volume ratio).
"""

from __future__ import annotations

from math import log, sqrt

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.tuples import plus, scale, subtract
from karamelo_py.points.kinematics import contract
from karamelo_py.points.laws.eos import bulk_modulus, pressure, ratio_at_pressure
from karamelo_py.points.laws.strengths import (
    elastic_ratio,
    pressure_response,
    remembers,
    respond,
    with_elastic_ratio,
)
from karamelo_py.points.laws.strengths.linear import elastic_trial
from karamelo_py.points.laws.temperatures import thermal_pressure


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


def frictional(strength: type) -> None:
    """Give `strength` (with a field ``G`` and those of `surface`) memory, and response."""
    remembers(strength, ep=0.0, Jp=1.0)

    @elastic_ratio.on(strength)
    def _(strength, memory, j):
        return j / memory[1]

    @with_elastic_ratio.on(strength)
    def _(strength, memory, j, elastic):
        return (memory[0], j / elastic)

    @respond.on(strength)
    def _(strength, law, kin, s, strain, j, memories, dt):
        memory, heat = memories.strength, memories.heat
        trial = elastic_trial(kin, strength.G, s, strain)
        elastic = elastic_ratio(strength, memory, j)
        warm = plus(real(0, j), thermal_pressure(law.temperature, heat))
        p = pressure(law.eos, elastic, memories.energy, heat) + warm
        K = bulk_modulus(law.eos, elastic, memories.energy, heat)
        new, reached = pressure_response(strength, kin, trial, p, K, memory[0])
        plastic = scale(real(0.5, j) / strength.G, subtract(trial, new))
        increment = sqrt(real(2 / 3, j) * contract(kin, plastic, plastic))
        memory = (memory[0] + increment, memory[1])
        work = contract(kin, new, plastic)
        if reached != p:
            # The volume that bears the new pressure is elastic; the rest is plastic.
            after = ratio_at_pressure(law.eos, reached - warm, heat)
            memory = with_elastic_ratio(strength, memory, j, after)
            work -= reached * log(elastic / after)
        return new, memory, work
