"""Materials with a stored energy: hyperelastic, and built-in formulas for rubber and tissue."""

from collections import namedtuple
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.points.laws.by_energy import (
    FIBRES,
    FIELDS,
    INVARIANTS,
    STRETCHES,
    OfInvariants,
    law_of,
)
from karamelo_py.points.laws.fibres import Fibres, OfFibres, PlacedFibre, PlacedFibres
from karamelo_py.points.laws.formulas import FormulaOf, with_numbers
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero
from karamelo_py.points.laws.placed import Direction, Vector, nominal, placed
from karamelo_py.points.laws.thermoelastic import expanding
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression

SEEDS = (*INVARIANTS, "I3", *FIBRES, *STRETCHES, "T")


class EnergyFormula(FormulaOf):
    """Script argument: a stored energy of invariants or principal stretches."""

    script_kind: ClassVar[str] = "a formula of I1, I2, I3, J, I4, I6 and T, or of l1, l2, l3 and J"
    names = SEEDS
    quantity = "the energy"
    expected = "a formula of I1, I2 and J, or of l1, l2 and l3"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Expression:
        energy = super().from_script(hub, argument)
        if not energy.names - {"T"}:
            raise ScriptError(
                "the energy is a constant: the body has no stress",
                mark=argument.mark,
                expected=cls.expected,
            )
        return energy


Fields = namedtuple("Fields", FIELDS)


class HyperelasticFormula(OfInvariants, Fields):
    """Elastic solid given by a formula of its stored energy.

    Parameters
    ----------
    rho
        Density before deformation.
    energy
        Stored energy per reference volume: a formula of I1 = tr C, I2 = (I1^2 - tr C^2)/2, I3 = det
        C, J = det F, with C = F^T F, and of I4 and I6, the squared stretches of two families of
        fibres; or a formula of the principal stretches l1, l2, l3 and J. Both may contain the
        temperature T, variables of the script, and numbers that are named in the same line
        (mu=4e5). At rest I1 = I2 = 3; all other variables are 1.
    fibre, fibre2
        Directions of the fibres at rest, for I4 and I6: numbers, or formulas of x0, y0, z0.
    cp, kappa, alpha
        Heat capacity per unit mass, conductivity and coefficient of linear expansion of a material
        with a temperature, as for neo-hookean.
    T
        Initial temperature, unless the solid sets one; also used for checking the formula.

    Example
    -------
    material(rubber, hyperelastic, 1000, 2e5*(I1*J^(-2/3) - 3) + 1e7*(J - 1)^2)
    material(seal, hyperelastic, 1000, energy="mu/2*(I1 - 3) - mu*log(J)", mu=4e5)
    material(strip, hyperelastic, 1000, 2e5*(I1 - 3 - 2*log(J)) + 5e5*(I4 - 1)^2, fibre=(1, 1, 0))
    material(ring, hyperelastic, 1000, 2e5*(I1 - 3 - 2*log(J)) + 5e5*(I4 - 1)^2, fibre=(-y0, x0, 0))
    material(sheet, hyperelastic, 1000, 2e5*(l1^2 + l2^2 + l3^2 - 3 - 2*log(J)) + 1e7*log(J)^2)
    material(warm, hyperelastic, 1000, 700*T*(I1*J^(-2/3) - 3) + 1e7*(J - 1)^2, cp=2000, kappa=0.2)

    Notes
    -----
    The stress is the exact derivative of the formula: tau = 2 (W_1 + I1 W_2) b - 2 W_2 b^2 + J W_J
    I (Holzapfel 2000, section 6.2), or tau_a = l_a dW/dl_a. Tangent and wave speed are second
    derivatives. The stored energy is measured from rest. Formulas with stress at rest, or without
    stiffness, are refused. A warning names the stretch beyond which the energy is not convex along
    a principal direction, so that deformation would localise. Formulas of stretches are slower.

    See Also
    --------
    neo-hookean, mooney-rivlin, ogden, yeoh, gent, arruda-boyce, holzapfel, saint-venant-kirchhoff
    """

    __slots__ = ()
    syntax = (
        "rho, energy[, number=...][, fibre=(x, y, z)][, fibre2=(x, y, z)]"
        "[, cp=, kappa=][, alpha=][, T=293]"
    )

    @classmethod
    def given(
        cls,
        rho: AboveZero,
        energy: EnergyFormula,
        *,
        fibre: Direction | None = None,
        fibre2: Direction | None = None,
        cp: AboveZero | None = None,
        kappa: FromZero | None = None,
        alpha: float = 0.0,
        T: FromZero = 293.0,
    ) -> Any:
        if "T" in energy.names and cp is None:
            raise ScriptError(
                "the energy depends on T, but the material has no temperature",
                argument="energy",
                expected="cp=..., kappa=... after the formula",
            )
        directions = {"I4": fibre, "I6": fibre2}
        for option, (name, direction) in zip(("fibre", "fibre2"), directions.items(), strict=True):
            if name in energy.names and direction is None:
                raise ScriptError(f"{name} needs a direction", expected=f"{option}=(x, y, z)")
            if direction and name not in energy.names:
                message = f"the energy does not contain {name}"
                raise ScriptError(message, argument=option, expected=f"a formula with {name}")
        one = fibre or fibre2
        fibres = (fibre or one, fibre2 or one) if one else ()
        return of_energy(rho, energy, fibres, T, (cp, kappa, alpha))


def of_energy(
    rho: float,
    energy: Expression,
    fibres: Sequence[Vector | Direction] = (),
    T: float = 293.0,
    heat: tuple = (None, None, 0.0),
) -> Any:
    """Return a law with the directions of two families of `fibres`, if any."""
    if not fibres:
        return expanding(law_of(rho, energy, (), T), *heat, T=T)
    law = expanding(law_of(rho, energy, Fibres(*nominal(*fibres)), T, OfFibres), *heat, T=T)
    return placed(law, PlacedFibre if fibres[0] is fibres[1] else PlacedFibres, *fibres)


def ready(formula: str, argument: str | None = None, *, rho: float, **constants: Any) -> Any:
    """Return the law of a built-in formula; errors of unstable constants name `argument`."""
    fibres = [constants.pop(name) for name in ("fibre", "fibre2") if name in constants]
    try:
        return of_energy(rho, with_numbers(formula, **constants), fibres)
    except ScriptError as error:
        error.argument = argument
        raise


VOLUME = "K/2*(J - 1)^2"
LANGEVIN = "1/2", "1/20", "11/1050", "19/7000", "519/673750"


class MooneyRivlin(NamedTuple):
    """Rubber of Mooney (1940) and Rivlin (1948), slightly compressible.

    Parameters
    ----------
    rho
        Density before deformation.
    C10, C01
        Constants of the terms; the shear modulus is G = 2 (C10 + C01).
    K
        Bulk modulus.

    Example
    -------
    material(rubber, mooney-rivlin, 1000, 1.5e5, 0.5e5, 2e7)

    Notes
    -----
    W = C10 (I1 J^(-2/3) - 3) + C01 (I2 J^(-4/3) - 3) + K/2 (J - 1)^2.

    See Also
    --------
    hyperelastic, yeoh, ogden
    """

    rho: AboveZero
    C10: float
    C01: float
    K: AboveZero

    def checked(self):
        formula = f"C10*(I1*J^(-2/3) - 3) + C01*(I2*J^(-4/3) - 3) + {VOLUME}"
        return ready(formula, "C10", **self._asdict())


class Yeoh(NamedTuple):
    """Rubber of Yeoh (1993), slightly compressible: filled rubber that stiffens.

    Parameters
    ----------
    rho
        Density before deformation.
    K
        Bulk modulus.
    C10, C20, C30
        Constants of the terms. The shear modulus is 2 C10.

    Example
    -------
    material(tyre, yeoh, 1100, 2e8, 5e5, -1e4, 2e3)

    Notes
    -----
    W = C10 i + C20 i^2 + C30 i^3 + K/2 (J - 1)^2 with i = I1 J^(-2/3) - 3.

    See Also
    --------
    hyperelastic, mooney-rivlin, gent
    """

    rho: AboveZero
    K: AboveZero
    C10: float
    C20: float = 0.0
    C30: float = 0.0

    def checked(self):
        count = 3 if self.C30 else 2 if self.C20 else 1
        parts = [f"C{k}0*(I1*J^(-2/3) - 3)^{k}" for k in range(1, count + 1)]
        return ready(" + ".join([*parts, VOLUME]), "C10", **self._asdict())


class Gent(NamedTuple):
    """Rubber of Gent (1996) with limited chain extension, slightly compressible.

    Parameters
    ----------
    rho
        Density before deformation.
    G
        Shear modulus.
    Jm
        Limit of I1 J^(-2/3) - 3.
    K
        Bulk modulus.

    Example
    -------
    material(rubber, gent, 1000, 4e5, 80, 2e7)

    Notes
    -----
    W = -G Jm/2 ln(1 - (I1 J^(-2/3) - 3)/Jm) + K/2 (J - 1)^2.

    See Also
    --------
    hyperelastic, yeoh, arruda-boyce
    """

    rho: AboveZero
    G: AboveZero
    Jm: AboveZero
    K: AboveZero

    def checked(self):
        formula = f"-G*Jm/2*log(1 - (I1*J^(-2/3) - 3)/Jm) + {VOLUME}"
        return ready(formula, **self._asdict())


class ArrudaBoyce(NamedTuple):
    """Rubber as a network of eight chains with limited extension, slightly compressible.

    Parameters
    ----------
    rho
        Density before deformation.
    mu
        Stiffness of the network; the shear modulus is mu (1 + 3/(5 L^2) + 99/(175 L^4) + ...).
    limit
        Stretch L at which the chains are straight.
    K
        Bulk modulus.

    Example
    -------
    material(rubber, arruda-boyce, 1000, 2.8e5, 5.4, 2e7)

    Notes
    -----
    W = mu sum C_k/L^(2 k - 2) ((I1 J^(-2/3))^k - 3^k) + K/2 (J - 1)^2 with C = 1/2, 1/20, 11/1050,
    19/7000, 519/673750: five terms of the inverse Langevin function (Arruda & Boyce 1993, J. Mech.
    Phys. Solids 41, 389-412).

    See Also
    --------
    hyperelastic, gent, ogden
    """

    rho: AboveZero
    mu: AboveZero
    limit: AboveZero
    K: AboveZero

    def checked(self):
        if not self.limit > 1:
            raise ScriptError(
                f"chains that are straight at a stretch of {self.limit:g} are straight at rest",
                argument="limit",
                expected="a stretch above 1",
            )
        terms = [
            f"{C}/limit^{2 * k - 2}*((I1*J^(-2/3))^{k} - 3^{k})" for k, C in enumerate(LANGEVIN, 1)
        ]
        return ready(f"mu*({' + '.join(terms)}) + {VOLUME}", **self._asdict())


class SaintVenantKirchhoff(NamedTuple):
    """Hooke's law between second Piola-Kirchhoff stress and Green-Lagrange strain.

    Parameters
    ----------
    rho
        Density before deformation.
    lam, G
        Lame's parameters.

    Example
    -------
    material(frame, saint-venant-kirchhoff, 7850, 1.2e11, 0.8e11)

    Notes
    -----
    W = lam/2 (tr E)^2 + G E:E. Use it for large rotations with small strains: compressed to 0.58 of
    its length, a body loses its stiffness.

    See Also
    --------
    hyperelastic, hencky, neo-hookean
    """

    rho: AboveZero
    lam: float
    G: AboveZero

    def checked(self):
        formula = "lam/8*(I1 - 3)^2 + G/4*(I1^2 - 2*I2 - 2*I1 + 3)"
        return ready(formula, "G", **self._asdict())


class Ogden(OfInvariants, Fields):
    """Rubber of Ogden (1972) with up to four terms, slightly compressible.

    Parameters
    ----------
    rho
        Density before deformation.
    K
        Bulk modulus.
    pairs
        mu and alpha of each term; the shear modulus is half the sum of mu alpha.

    Example
    -------
    material(rubber, ogden, 1000, 2e7, 6.3e5, 1.3, 1200, 5, -1e4, -2)

    Notes
    -----
    W = sum mu/alpha (L1^alpha + L2^alpha + L3^alpha - 3) + K/2 (J - 1)^2 with L = l J^(-1/3).

    See Also
    --------
    hyperelastic, mooney-rivlin
    """

    __slots__ = ()
    syntax = "rho, K, mu1, alpha1[, mu2, alpha2, ...]"

    @classmethod
    def given(cls, rho: AboveZero, K: AboveZero, *pairs: float) -> Any:
        if len(pairs) % 2 or not 2 <= len(pairs) <= 8 or 0 in pairs[1::2]:
            raise ScriptError(
                "the terms are pairs of mu and alpha, where no alpha is 0",
                argument="pairs",
                expected="mu1, alpha1[, mu2, alpha2, ...], at most four pairs",
            )
        parts = [VOLUME]
        numbers = {"K": K}
        for k, (mu, alpha) in enumerate(zip(pairs[::2], pairs[1::2], strict=True)):
            powers = f"l1^a{k} + l2^a{k} + l3^a{k}"
            parts.append(f"m{k}/a{k}*(({powers})*J^(-a{k}/3) - 3)")
            numbers |= {f"m{k}": mu, f"a{k}": alpha}
        return ready(" + ".join(parts), "pairs", rho=rho, **numbers)


class Holzapfel(NamedTuple):
    """Soft tissue such as arteries, with two families of fibres (Holzapfel, Gasser, Ogden).

    Parameters
    ----------
    rho
        Density before deformation.
    G
        Shear modulus of the matrix.
    k1
        Stiffness of the fibres, a stress.
    k2
        Exponent of the stiffening of the fibres.
    K
        Bulk modulus.
    fibre, fibre2
        Directions of one or two families at rest: numbers, or formulas of x0, y0, z0; in
        axisymmetry (radius, axis, hoop).

    Example
    -------
    material(artery, holzapfel, 1100, 3e3, 2.36e3, 0.84, 1e6, fibre=(0, 1, 2), fibre2=(0, -1, 2))

    Notes
    -----
    W = G/2 (I1 J^(-2/3) - 3) + K/2 (J - 1)^2 + k1/(2 k2) sum (exp(k2 <I - 1>^2) - 1), with the
    squared stretches I = I4, I6 of the fibres, which are slack in compression: <x> = max(x, 0)
    (Holzapfel, Gasser & Ogden 2000, J. Elasticity 61, 1-48; with full, not isochoric, stretches:
    Nolan et al. 2014).

    See Also
    --------
    hyperelastic, transverse
    """

    rho: AboveZero
    G: AboveZero
    k1: FromZero
    k2: AboveZero
    K: AboveZero
    fibre: ByName[Direction]
    fibre2: ByName[Direction | None] = None

    syntax = "rho, G, k1, k2, K, fibre=(x, y, z)[, fibre2=(x, y, z)]"

    def checked(self):
        *_, fibre, fibre2 = self
        families = ("I4", "I6") if fibre2 else ("I4",)
        fibres = [f"exp(k2*max({name} - 1, 0)^2) - 1" for name in families]
        formula = f"G/2*(I1*J^(-2/3) - 3) + {VOLUME} + k1/(2*k2)*({' + '.join(fibres)})"
        return ready(formula, **self._asdict() | {"fibre2": fibre2 or fibre})
