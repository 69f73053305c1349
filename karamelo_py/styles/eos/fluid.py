"""eos fluid: Tait's equation of state."""

from __future__ import annotations

from math import inf
from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos.tait import Tait
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.eos.base import Eos


class Fluid(Eos):
    """Pressure of a liquid from a power of its density (Tait).

    Parameters
    ----------
    rho0
        Density at zero pressure.
    K
        Reference pressure; the bulk modulus is K gamma.
    gamma
        Exponent, 7 for water.
    tension
        Tension that the liquid bears (0: none); by default what the formula gives, up to K.

    Example
    -------
    eos(water, fluid, 1000, 2.2e9/7, 7)
    eos(spray, fluid, 1000, 1e5, 7, tension=0)

    Notes
    -----
    p = K ((rho/rho0)^gamma - 1) (Cole 1948; Monaghan 1994). The speed of sound is
    sqrt(K gamma/rho0) at zero pressure. A smaller K than that of the liquid allows longer time
    steps, and the density stays within 1 % where no speed is above a tenth of that of sound.
    Where a liquid splashes, drops that are pulled apart swell and cling together by tension:
    ``tension=0`` lets them go.

    See Also
    --------
    strength fluid, ideal-gas, material eos-strength
    """

    def __init__(
        self,
        hub: Hub,
        rho0: Annotated[float, Positive],
        K: Annotated[float, Positive],
        gamma: Annotated[float, Positive],
        *,
        tension: Annotated[float, NonNegative] = inf,
    ):
        self.law = Tait(1 / rho0, K, gamma, tension)
