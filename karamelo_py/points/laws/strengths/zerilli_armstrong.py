"""strength zerilli-armstrong: flow stress of bcc and fcc metals (Zerilli & Armstrong 1987)."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.compile import real, where
from karamelo_py.compiler.powers import exponential
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import flow_stress, precompute, radial_return
from karamelo_py.points.laws.strengths.johnson_cook import power_law, power_of_strain
from karamelo_py.points.laws.temperatures import temperature_or


class ZerilliArmstrong(NamedTuple):
    """Flow stress of metals by the motion of dislocations: strain, rate and temperature.

    Parameters
    ----------
    G
        Shear modulus.
    C0
        Part of the flow stress that depends on nothing (impurities, size of the grains).
    C1
        Factor of the thermal part: that of bcc metals.
    C2
        The same of its part that grows with the root of plastic strain: that of fcc metals.
    C3
        How fast the thermal part falls with temperature, per kelvin.
    C4
        How much less so for each e-fold of the rate, per kelvin.
    C5, n
        Hardening C5 ep^n that depends on strain alone: that of bcc metals.
    epsdot0
        Rate of plastic strain that rates are counted in: 1/s in the units of the script.
    T
        Absolute temperature where neither the material nor its solid has one.

    Example
    -------
    strength(copper, zerilli-armstrong, 46e9, 65e6, 0, 890e6, 0.0028, 0.000115, 0, 1)
    strength(iron, zerilli-armstrong, 80e9, 65e6, 1033e6, 0, 0.00698, 0.000415, 266e6, 0.289)

    Notes
    -----
    Y = C0 + (C1 + C2 sqrt(ep)) exp(-C3 T + C4 T ln(rate/epsdot0)) + C5 ep^n, with C2 = 0 for bcc
    and C1 = C5 = 0 for fcc metals (Zerilli & Armstrong 1987). Without rate the thermal part is
    nothing, so that the strength of a body at rest is C0 + C5 ep^n. Each step solves for the
    plastic strain with the flow stress at its end and the rate of the step.

    See Also
    --------
    johnson_cook, plastic, temperature plastic_work
    """

    in_lanes = True

    G: float
    C0: float
    C1: float
    C2: float
    C3: float
    C4: float
    C5: float
    n: float
    epsdot0: float
    initial_temperature: float

    @classmethod
    def given(
        cls,
        G: Annotated[float, Positive],
        C0: Annotated[float, NonNegative],
        C1: Annotated[float, NonNegative],
        C2: Annotated[float, NonNegative],
        C3: Annotated[float, NonNegative],
        C4: Annotated[float, NonNegative],
        C5: Annotated[float, NonNegative],
        n: Annotated[float, NonNegative],
        *,
        epsdot0: Annotated[float, Positive] = 1.0,
        T: Annotated[float, NonNegative] = 293.0,
    ):
        """The law from its constants."""
        return cls(G, C0, C1, C2, C3, C4, C5, n, epsdot0, T)


remembers(ZerilliArmstrong, ep=0.0)
shear_response.on(ZerilliArmstrong)(radial_return)


class Thermal(NamedTuple):
    """Known at the beginning of a step: the parts of the flow stress."""

    athermal: Any  # C5 ep^n
    root: Any  # C2 sqrt(ep)
    thermal: Any  # exp(-C3 T)


@precompute.on(ZerilliArmstrong)
def _precompute_zerilli_armstrong(strength, memory, heat):
    T = temperature_or(heat, strength.initial_temperature)
    return Thermal(
        power_of_strain(strength.C5, strength.n, memory.ep),
        power_of_strain(strength.C2, 0.5, memory.ep),
        exponential(-strength.C3 * T),
    )


@flow_stress.on(ZerilliArmstrong)
def _flow_stress_zerilli_armstrong(strength, memory, known, increment, heat, dt):
    ep = memory.ep
    athermal, slope = power_law(strength.C5, strength.n, ep, known.athermal, increment)
    root, root_slope = power_law(strength.C2, 0.5, ep, known.root, increment)
    # exp(C4 T ln(rate)) is the rate to a power.
    power = strength.C4 * temperature_or(heat, strength.initial_temperature)
    rate = increment / (dt * strength.epsdot0)
    at_rate = power_of_strain(1, power, rate)
    rate, rate_slope = power_law(1, power, rate, at_rate, 0)
    rate = where(power > 0, rate, real(1, rate))
    factor = strength.C1 + root
    slope += known.thermal * (rate * root_slope + factor * rate_slope / (dt * strength.epsdot0))
    return strength.C0 + known.thermal * rate * factor + athermal, slope
