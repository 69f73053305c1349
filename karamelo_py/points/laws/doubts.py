"""Warnings about material constants that are possible but likely mistakes."""

from collections.abc import Iterator
from math import asin, degrees, inf, radians, sin, sqrt
from typing import Any

from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import (
    can,
    constrained_velocity,
    initial_state,
    parameter,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.laws.by_energy import ByEnergy, first_instability
from karamelo_py.points.laws.eos import bulk_modulus
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.placed import Placed
from karamelo_py.points.laws.strengths.hardening import before_flow, flow_stress
from karamelo_py.points.laws.temperatures import PlasticWork
from karamelo_py.points.laws.thermoelastic import Thermoelastic

SLOW = 0.01  # wave speed in m/s or mm/ms, if density and modulus are exchanged
SMALL = 2.0  # degrees; smaller friction angles are likely in radians
EXPANSION = 1e-10, 1e-3  # per kelvin; the range of quartz to polymers is far inside
TOUGH = 50.0  # failure strain in shear; larger ones are likely in percent
APART = 100.0  # K, largest difference of reference temperatures in the same unit
MELTS = 0.1  # plastic strain whose heat melts no real metal
COEFFICIENT = 2.0  # friction between grains; real values are far smaller
STEEP, THICK = 10.0, 20.0  # Hugoniot slope and viscosity coefficient; real values are far smaller


def doubts(law: Any) -> Iterator[tuple[str, str]]:
    """Yield each implausible constant of a law, and what was probably intended."""
    if can(law, constrained_velocity):
        return
    if parameter(parameter(law, "strength"), "cell_size", None) is not None:
        # The cell size, with which viscosity damps waves, is not known yet.
        law = law._replace(strength=law.strength._replace(cell_size=inf))
    state = initial_state(law, Space(), 1.0)
    squared, density = wave_speed_squared(law, Space(), state), 1 / specific_volume(law)
    if 0 < squared < SLOW**2 < density**2 * SLOW**2:
        yield (
            f"its waves move at {sqrt(squared):.3g}, since its density {density:.3g} is "
            f"{1 / squared:.2g} times its modulus {squared * density:.3g}",
            "the density comes before the modulus",
        )
    if alpha := parameter(parameter(law, "heat"), "alpha"):
        yield from _doubts_of_expansion(alpha, "the coefficient of linear expansion")
    if isinstance(law, EosStrength):
        yield from _doubts_of_parts(law, state)
    turning = False
    while isinstance(law, Thermoelastic | Placed):
        turning = isinstance(law, Placed)
        law = law.elastic
    if (lam := parameter(law, "lam")) < 0:
        nu = lam / (2 * (lam + law.G))
        likely = f"{-nu:.3g}" if -nu < 0.5 else "from 0 to 0.5"
        if isinstance(law, ByEnergy):
            likely = f"a bulk modulus above {2 / 3 * law.G:.3g} (it is {lam + 2 / 3 * law.G:.3g})"
        yield (
            f"its Poisson's ratio is {nu:.3g}: a bar of it swells when it is pulled",
            f"{likely}, unless it is auxetic",
        )
    if isinstance(law, ByEnergy) and (unstable := first_instability(law, turning)):
        path, stretch = unstable
        yield (
            f"it loses its stiffness in {path} at a stretch of {stretch:.2g}",
            f"stay {'below' if stretch > 1 else 'above'}: beyond, strain localizes in one cell; "
            "terms that stiffen prevent it",
        )


def _doubts_of_parts(law: Any, state: Any) -> Iterator[tuple[str, str]]:
    strength, memory = law.strength, state.m.strength
    G, K = parameter(strength, "G"), bulk_modulus(law.eos, 1.0, state.m.energy, state.m.heat)
    nu = (3 * K - 2 * G) / (2 * (3 * K + G)) if K > 0 else 0.0
    if nu < 0:
        yield (
            f"its bulk modulus {K:.3g} and shear modulus {G:.3g} make Poisson's ratio {nu:.3g}",
            f"for nu = 0.3 a bulk modulus of {2.167 * G:.3g}, by density and speed of the eos",
        )
    flow = parameter(strength, "yield_stress")
    hard = flow + parameter(strength, "H")
    if flow_stress.defined(type(strength)):
        before = before_flow(strength, memory, state.m.heat)
        flow, _ = flow_stress(strength, before, 0.0, 1.0)
        hard, _ = flow_stress(strength, before, 1.0, 1.0)
    if flow > G > 0:
        yield (
            f"it yields at {flow:.3g}, above its shear modulus {G:.3g}: at a strain that no solid "
            "reaches without yielding",
            "the shear modulus comes first, then the yield stress",
        )
    elif hard > G > 0:
        yield (
            f"its flow stress at a plastic strain of 1 is {hard:.3g}, above its modulus {G:.3g}",
            "give the hardening modulus in the units of the other moduli",
        )
    if (rate := parameter(parameter(strength, "rate"), "C")) > 1:
        yield (
            f"its flow stress rises by {rate:g} times its value if the rate rises by a factor of e",
            "C is about 0.01 for metals",
        )
    if parameter(strength, "mu_s") > COEFFICIENT:
        yield (
            f"its coefficient of friction is {strength.mu_s:g}",
            "coefficients are tangents of angles: 0.38 for glass beads",
        )
    friction = parameter(strength, "friction")
    if isinstance(friction, float) and 0 < friction < sin(radians(SMALL)):
        yield (
            f"its angle of friction is about {degrees(asin(friction)):.2g} degrees",
            "angles are in degrees, not in radians",
        )
    yield from _doubts_of_heat(law, K, flow)
    damage, eos = law.damage, law.eos
    shear = parameter(damage, "d1") + parameter(damage, "d2")
    if shear > TOUGH:
        yield f"it fails in shear at a plastic strain of {shear:.3g}", "strains are not in per cent"
    if parameter(damage, "d3") > 0:
        yield (
            f"with d3 = {damage.d3:g} its failure strain is larger in tension than in compression",
            "d3 of metals is below 0 here: some programs have exp(-d3 t)",
        )
    if parameter(eos, "S") > STEEP:
        yield (
            f"the slope S of its shock speed is {eos.S:g}",
            "S has no unit: 1 to 2 for metals, and c0 comes before it",
        )
    coefficients = [parameter(law.viscosity, name) for name in ("Q1", "Q2")]
    if max(coefficients) > THICK:
        yield (
            f"its artificial viscosity has the coefficients {coefficients[0]:g} and "
            f"{coefficients[1]:g}",
            "1.5 and 0.06 smear a shock over some cells",
        )


def reference_temperatures(law: Any) -> dict[str, float]:
    heat, softening = parameter(law, "temperature"), parameter(law, "strength")
    if not isinstance(heat, PlasticWork):
        return {}
    temperatures = {"T0 of the temperature": heat.T0}
    for name, component, counts in (
        ("Tr of the strength", parameter(softening, "softening"), 1.0),
        ("Tr of the damage", law.damage, parameter(law.damage, "d5")),
        ("Tr of the eos", law.eos, parameter(law.eos, "thermal")),
    ):
        Tr = parameter(component, "Tr", None)
        if Tr is not None and counts:
            temperatures[name] = Tr
    return temperatures


def _doubts_of_heat(law: Any, K: float, flow: float) -> Iterator[tuple[str, str]]:
    heat, counted = law.temperature, reference_temperatures(law)
    if counted and max(counted.values()) - min(counted.values()) > APART:
        yield (
            "temperatures have different scales: "
            + ", ".join(f"{name} is {T:g}" for name, T in counted.items()),
            "kelvin throughout, or degrees Celsius throughout",
        )
    if K > 0 and parameter(heat, "alpha"):
        yield from _doubts_of_expansion(
            heat.alpha / (3 * K), f"alpha is 3 K = {3 * K:.3g} times the coefficient of expansion"
        )
    if isinstance(heat, PlasticWork) and heat.Tm < inf:
        warmer = heat.chi * flow * specific_volume(law) / heat.cp
        if MELTS * warmer > heat.Tm - heat.T0:
            yield (
                f"a plastic strain of 1 warms it by {warmer:.2g} kelvin",
                "the heat capacity cp is per mass and kelvin, in the units of the stresses: "
                "500 for steel in m, kg, s; 5e8 in mm, t, s",
            )


def _doubts_of_expansion(alpha: float, right: str) -> Iterator[tuple[str, str]]:
    if not EXPANSION[0] < abs(alpha) < EXPANSION[1]:
        yield f"it expands by {alpha:.3g} per kelvin", f"{right}; for steel it is 1.2e-5"
