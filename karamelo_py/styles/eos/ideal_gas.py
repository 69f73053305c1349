"""eos ideal-gas: a gas whose energy follows from the work done on it."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos.ideal_gas import IdealGas as IdealGasLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.eos.base import Eos, artificial_viscosity


class IdealGas(Eos):
    """Pressure of an ideal gas without conduction of heat.

    Parameters
    ----------
    rho0
        Density at the start.
    gamma
        Ratio of specific heats, above 1.
    p
        Pressure at the start.
    e
        Internal energy per mass at the start, in the place of p.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(air, ideal-gas, 1.2, 1.4, p=1e5)

    Notes
    -----
    p = (gamma - 1) rho e, and de = -p dv with the volume v per mass: along an adiabat e grows as
    rho^(gamma - 1), which each step follows exactly. Viscous work heats the gas. Where there are
    shocks, Q1 = 2 and Q2 = 0.2 are usual.

    The gas presses on what is around it from the first step: a free surface expands. Fix
    initial_stress sets the pressure by the energy, and leaves the volume.

    See Also
    --------
    fluid, shock, strength fluid, material eos-strength
    """

    def __init__(
        self,
        hub: Hub,
        rho0: Annotated[float, Positive],
        gamma: float,
        *,
        p: Annotated[float, Positive] | None = None,
        e: Annotated[float, Positive] | None = None,
        Q1: Annotated[float, NonNegative] = 0.0,
        Q2: Annotated[float, NonNegative] = 0.0,
    ):
        if not gamma > 1:
            raise ScriptError(
                f"the ratio of specific heats {gamma:g} is impossible",
                argument="gamma",
                expected="a number above 1, such as 1.4",
            )
        if (p is None) == (e is None):
            raise ScriptError(
                "the gas needs a pressure or an energy at the start"
                if p is None
                else "pressure and energy at the start are given; one follows from the other",
                expected="p=pressure or e=energy per mass",
            )
        energy = rho0 * e if p is None else p / (gamma - 1)
        self.law = IdealGasLaw(1 / rho0, gamma, energy)
        self.viscosity = artificial_viscosity(Q1, Q2)
