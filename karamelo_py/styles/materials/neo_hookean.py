"""material neo-hookean: compressible hyperelasticity."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.neo_hookean import Hyperelastic
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material, check_poisson_ratio, expanding, lame_parameters


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
    cp, kappa
        Heat capacity per mass, and conductivity; both or neither. With them points have a
        temperature, at first that of their solid.
    alpha
        Coefficient of linear expansion.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.3)
    material(seal, neo-hookean, 1000, 1e6, 0.3, 1900, 0.2, 2e-4)

    Notes
    -----
    First Piola-Kirchhoff stress P = G (F - F^-T) + lambda ln(det F) F^-T; stored energy
    W = G/2 (tr F^T F - 3) - G ln J + lambda/2 (ln J)^2 (Bonet & Wood 2008, section 6.4.3).

    A temperature T other than that at the start, T0, adds the stress -3 K alpha (T - T0), K the
    bulk modulus; the elastic strain is without the expansion alpha (T - T0).

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
        cp: Annotated[float, Positive] | None = None,
        kappa: Annotated[float, NonNegative] | None = None,
        alpha: float = 0.0,
    ):
        check_poisson_ratio(nu)
        moduli = lame_parameters(E, nu)
        law = Hyperelastic(1 / rho, *moduli)
        self.law = expanding(law, moduli, cp, kappa, alpha)
