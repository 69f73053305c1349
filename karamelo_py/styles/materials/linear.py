"""material linear: isotropic linear elasticity for large rotations."""

from __future__ import annotations

from typing import Annotated, Literal

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.linear import FixedFrame, Jaumann
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material, check_poisson_ratio, expanding, lame_parameters


class LinearElastic(Material):
    """Hooke's law in rate form: the stress rate follows the strain rate, and turns with the point.

    Parameters
    ----------
    rho
        Density.
    E
        Young's modulus.
    nu
        Poisson's ratio, above -1 and below 0.5.
    cp, kappa
        Heat capacity per mass, and conductivity; both or neither. With them points have a
        temperature, at first that of their solid.
    alpha
        Coefficient of linear expansion.
    rate
        ``jaumann``: the stress turns with the point, as it must. ``none``: it does not, as in
        Karamelo; only to repeat results of programs that leave the turn out.

    Example
    -------
    material(rubber, linear, 1000, 1e6, 0.3)
    material(girder, linear, 7850, 211e9, 0.3, 460, 45, 12e-6)

    Notes
    -----
    sigma' = R sigma R^T + 2 G d + lambda tr(d) I, with d the strain increment and R the rotation
    increment of the step (Jaumann rate; Hughes & Winget 1980). For strains of more than some ten
    per cent a hyperelastic law such as neo-hookean is the better model. One dimension means
    uniaxial strain, as plane strain and space have it.

    A temperature T other than that at the start, T0, adds the stress -3 K alpha (T - T0), K the
    bulk modulus; the elastic strain is without the expansion alpha (T - T0).

    See Also
    --------
    material, neo-hookean
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
        *,
        rate: Literal["jaumann", "none"] = "jaumann",
    ):
        check_poisson_ratio(nu)
        moduli = lame_parameters(E, nu)
        law = Jaumann if rate == "jaumann" else FixedFrame
        self.law = expanding(law(1 / rho, *moduli), moduli, cp, kappa, alpha)
