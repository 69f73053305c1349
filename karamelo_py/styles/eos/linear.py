"""eos linear: pressure in proportion to the change of volume."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws.eos.linear import LinearPressure
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.eos.base import Eos


class Linear(Eos):
    """Pressure in proportion to the change of volume.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)

    Notes
    -----
    p = K (1 - J), with J the volume over the volume before deformation; positive in compression.

    See Also
    --------
    strength, material eos-strength
    """

    def __init__(self, hub: Hub, rho0: Annotated[float, Positive], K: Annotated[float, Positive]):
        self.law = LinearPressure(1 / rho0, K)
