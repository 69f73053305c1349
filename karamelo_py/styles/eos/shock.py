"""eos shock: Mie-Grueneisen equation of state."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos.shock import Shock as ShockLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.eos.base import Eos, artificial_viscosity


class Shock(Eos):
    """Pressure of shocked metals: the Hugoniot curve, heat, and artificial viscosity.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus, as Karamelo's scripts have it. Nothing depends on it: the stiffness is that of
        the Hugoniot curve, rho0 c0^2 at first.
    c0
        Speed of sound without shear, at zero pressure.
    S
        Slope of the shock speed U = c0 + S u over the speed u of the material behind the shock.
    Gamma
        Grueneisen's parameter, of the density before deformation.
    cv
        Heat capacity per mass.
    Tr
        Temperature above which heat adds to the pressure.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear; 0 and 0 for none.

    Example
    -------
    eos(copper, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06)

    Notes
    -----
    With mu = rho/rho0 - 1, p = rho0 c0^2 mu (1 + mu) / (1 - (S - 1) mu)^2 + Gamma rho0 cv (T - Tr)
    for T above Tr (Meyers 1994, chapter 5): the curve of the shocked states, shifted by the heat of
    plastic work. There is heat where the material has a temperature. In tension the first part is
    rho0 c0^2 mu. The curve has a pole at (S - 1) mu = 1; from where S (1 - rho0/rho) = 0.9 the
    pressure goes on along the tangent.

    Where the material is compressed at a rate d < 0 of its volume, the viscous pressure
    rho h (Q1 h d^2 - Q2 c d) is added, with the cell size h and the speed of sound c (von Neumann &
    Richtmyer 1950; Landshoff 1955). It spreads a shock over a few cells, and the time step takes
    account of it.

    See Also
    --------
    linear, ideal-gas, strength johnson_cook, material eos-strength
    """

    def __init__(
        self,
        hub: Hub,
        rho0: Annotated[float, Positive],
        K: Annotated[float, Positive],
        c0: Annotated[float, Positive],
        S: Annotated[float, NonNegative],
        Gamma: Annotated[float, NonNegative],
        cv: Annotated[float, NonNegative],
        Tr: float,
        Q1: Annotated[float, NonNegative],
        Q2: Annotated[float, NonNegative],
    ):
        self.law = ShockLaw(1 / rho0, rho0 * c0**2, S, Gamma * rho0 * cv, Tr)
        self.viscosity = artificial_viscosity(Q1, Q2)
