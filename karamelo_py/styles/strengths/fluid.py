"""strength fluid: viscous shear of a Newtonian fluid."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative
from karamelo_py.points.laws.strength.viscous import Viscous
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.strengths.base import Strength


class Fluid(Strength):
    """Viscous shear of a Newtonian fluid: no stress at rest.

    Parameters
    ----------
    mu
        Dynamic viscosity; 0 for none.

    Example
    -------
    strength(thin, fluid, 1e-3)

    Notes
    -----
    s = 2 mu dev(D), D the rate of strain. The time step takes account of the viscosity, which
    matters where 4/3 mu/(rho h) is not small against the speed of sound. Equivalent plastic strain
    and elastic shear are 0; viscous work counts as dissipated energy.

    See Also
    --------
    eos fluid, eos ideal-gas, material eos-strength
    """

    def __init__(self, hub: Hub, mu: Annotated[float, NonNegative]):
        self.law = Viscous(mu, 0.0)
