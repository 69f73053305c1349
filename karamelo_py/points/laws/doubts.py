"""Numbers of materials that a law can have and hardly any body has: slips in a script."""

from collections.abc import Iterator
from math import asin, degrees, inf, radians, sin, sqrt
from typing import Any

from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import (
    can,
    constrained_velocity,
    initial_state,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.laws.eos import bulk_modulus
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.strengths.hardening import flow_stress, precompute

SLOW = 0.01  # of a body whose density and modulus have changed places, in m/s as in mm/ms
SMALL = 2.0  # degrees: angles of friction are larger, and those in radians are not


def doubts(law: Any) -> Iterator[tuple[str, str]]:
    """Yield what is strange about a law, and what may be meant."""
    if can(law, constrained_velocity):
        return
    if hasattr(getattr(law, "strength", None), "cell_size"):
        # Viscosity slows the waves of the cells, whose size is not known yet.
        law = law._replace(strength=law.strength._replace(cell_size=inf))
    state = initial_state(law, Space(), 1.0)
    squared, density = wave_speed_squared(law, Space(), state), 1 / specific_volume(law)
    if 0 < squared < SLOW**2 < density**2 * SLOW**2:
        yield (
            f"waves of it move at {sqrt(squared):.3g}, since its density {density:.3g} is "
            f"{1 / squared:.2g} times its modulus {squared * density:.3g}",
            "the density comes before the modulus",
        )
    if isinstance(law, EosStrength):
        yield from _doubts_of_parts(law, state)


def _doubts_of_parts(law: Any, state: Any) -> Iterator[tuple[str, str]]:
    strength, memory = law.strength, state.m.strength
    G, K = getattr(strength, "G", 0.0), bulk_modulus(law.eos, 1.0, state.m.energy, state.m.heat)
    nu = (3 * K - 2 * G) / (2 * (3 * K + G)) if K > 0 else 0.0
    if nu < 0:
        yield (
            f"its bulk modulus {K:.3g} and shear modulus {G:.3g} make Poisson's ratio {nu:.3g}",
            f"for nu = 0.3 a bulk modulus of {2.167 * G:.3g}, by density and speed of the eos",
        )
    flow = getattr(strength, "yield_stress", 0.0)
    if flow_stress.defined(type(strength)):
        known = precompute(strength, memory, state.m.heat)
        flow, _ = flow_stress(strength, memory, known, 0.0, state.m.heat, 1.0)
    if flow > G > 0:
        yield (
            f"it yields at {flow:.3g}, above its shear modulus {G:.3g}: at a strain that no solid "
            "bears without yielding",
            "the shear modulus stands first, then the yield stress",
        )
    friction = getattr(strength, "friction", 0.0)
    if isinstance(friction, float) and 0 < friction < sin(radians(SMALL)):
        yield (
            f"its angle of friction is about {degrees(asin(friction)):.2g} degrees",
            "angles are in degrees, not in radians",
        )
