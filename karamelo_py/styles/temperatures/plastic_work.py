"""temperature plastic_work: heating by plastic work."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import In, NonNegative, Positive
from karamelo_py.points.laws.temperatures.plastic_work import PlasticWork as PlasticWorkLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.temperatures.base import Temperature


class PlasticWork(Temperature):
    """Heating by plastic work, and the pressure that heat makes.

    Parameters
    ----------
    chi
        Share of plastic work that becomes heat (Taylor & Quinney 1934), often 0.9.
    cp
        Heat capacity per mass.
    kappa
        Conductivity, by which heat flows with ``method(..., thermo-mechanical)``; without, heat
        stays where it is made.
    alpha
        Pressure per kelvin: 3 K times the coefficient of linear expansion, with the bulk modulus K.
    T0
        Temperature without thermal pressure, at which points start where their solid does not
        say otherwise.
    Tm
        Melting temperature, from which on there is no heating.

    Example
    -------
    temperature(warm, plastic_work, 0.9, 385, 0, 0, 298, 1356)

    Notes
    -----
    T grows by chi/(rho0 cp) times the plastic work per volume before deformation; the pressure
    grows by alpha (T - T0): a warm body that cannot expand is under pressure. The column T of dumps
    shows the temperature.

    See Also
    --------
    strength johnson_cook, eos shock, material eos-strength, solid
    """

    def __init__(
        self,
        hub: Hub,
        chi: Annotated[float, In(0, 1)],
        cp: Annotated[float, Positive],
        kappa: Annotated[float, NonNegative],
        alpha: float,
        T0: float,
        Tm: float,
    ):
        if not Tm > T0:
            raise ScriptError(
                f"the melting temperature Tm = {Tm:g} is not above T0 = {T0:g}",
                argument="Tm",
                expected=f"a number above {T0:g}",
            )
        self.law = PlasticWorkLaw(chi, cp, kappa, alpha, T0, Tm)
