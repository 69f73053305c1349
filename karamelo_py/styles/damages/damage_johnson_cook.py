"""damage damage_johnson_cook: ductile failure by plastic strain."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative
from karamelo_py.points.laws.damages.johnson_cook import JohnsonCookDamage
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.part import check_temperatures, reference_rate
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.damages.base import Damage


class DamageJohnsonCook(Damage):
    """Ductile failure of metals by plastic strain.

    Parameters
    ----------
    d1, d2, d3
        Failure strain at the reference rate: d1 + d2 exp(d3 t), with t the mean stress over the von
        Mises stress.
    d4
        Coefficient of the rate; 0 for none.
    d5
        Coefficient of temperature; 0 for none.
    epsdot0
        Reference rate of plastic strain.
    Tr, Tm
        Reference and melting temperature.

    Example
    -------
    damage(ductile, damage_johnson_cook, 0.54, 4.89, -3.03, 0.014, 1.12, 1, 298, 1356)

    Notes
    -----
    The failure strain is (d1 + d2 exp(d3 t)) (1 + d4 ln(rate/epsdot0)) (1 + d5 T*), T* = (T - Tr) /
    (Tm - Tr) (Johnson & Cook 1985); at and below the reference rate the second factor is 1, without
    a temperature the third one is. The sum w of plastic strain over failure strain (the column
    damage_init of dumps) grows from 0; from 1 on the damage D (the column damage) grows to 1 as
    10 (w - 1). Under t below -3 nothing fails. d1 may be negative; failure strains are 1e-6 at
    least.

    D takes its share of the deviatoric stress and of tension, once; pressure in compression stays:
    sigma = (1 - D) s - p I, p times 1 - D where it is tension. Plastic flow goes on as in what is
    left of the intact material. The energy that was stored there and is lost with it counts as
    dissipated.

    See Also
    --------
    strength johnson_cook, temperature plastic_work, material eos-strength
    """

    def __init__(
        self,
        hub: Hub,
        d1: float,
        d2: Annotated[float, NonNegative],
        d3: float,
        d4: Annotated[float, NonNegative],
        d5: Annotated[float, NonNegative],
        epsdot0: Annotated[float, NonNegative],
        Tr: float,
        Tm: float,
    ):
        check_temperatures(Tr, Tm)
        if not d1 + d2 > 0:
            raise ScriptError(
                f"the failure strain in shear, d1 + d2 = {d1 + d2:g}, is not above 0",
                argument="d1",
                expected="d1 + d2 above 0",
            )
        epsdot0 = reference_rate(epsdot0, d4, "d4")
        self.law = JohnsonCookDamage(d1, d2, d3, d4, d5, epsdot0, Tr, Tm)
