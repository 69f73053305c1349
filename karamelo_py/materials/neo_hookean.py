"""material neo-hookean: compressible hyperelasticity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from karamelo_py.material import Material, check_poisson_ratio, lame_parameters
from karamelo_py.points.materials.neo_hookean import Hyperelastic
from karamelo_py.signature import Positive

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class NeoHookean(Material):
    """Compressible neo-Hookean solid, right at any strain and rotation.

    Parameters
    ----------
    rho
        Density before deformation.
    E
        Young's modulus at small strain.
    nu
        Poisson's ratio at small strain, above -1 and below 0.5.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.3)

    Notes
    -----
    First Piola-Kirchhoff stress P = G (F - F^-T) + lambda ln(det F) F^-T; stored energy
    W = G/2 (tr F^T F - 3) - G ln J + lambda/2 (ln J)^2 (Bonet & Wood 2008, section 6.4.3).

    See Also
    --------
    material, linear
    """

    def __init__(
        self,
        hub: Hub,
        rho: Annotated[float, Positive],
        E: Annotated[float, Positive],
        nu: float,
    ):
        check_poisson_ratio(nu)
        lam, G = lame_parameters(E, nu)
        self.law = Hyperelastic(1 / rho, lam, G)
