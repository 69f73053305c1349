"""Base classes of isotropic elastic laws and of laws of the deformation gradient."""

from typing import Any, NamedTuple

from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, unit
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.parameters import AboveZero, FromZero, lame_parameters, warn_of_locking
from karamelo_py.points.laws.thermoelastic import expanding


class ElasticLaw(NamedTuple):
    in_lanes = True
    traits = LawTraits(rebounds=True)

    specific_volume: float
    lam: float  # Lame's first parameter
    G: float


class IsotropicConstants(NamedTuple):
    """Base of the constants of isotropic elastic laws.

    Parameters
    ----------
    rho
        Density before deformation.
    E
        Young's modulus at small strain.
    nu
        Poisson's ratio at small strain, above -1 and below 0.5.
    cp, kappa
        Heat capacity per unit mass, and conductivity; both or neither. With both, points have a
        temperature, initially the solid's.
    alpha
        Coefficient of linear expansion.
    """

    law = ElasticLaw

    rho: AboveZero
    E: AboveZero
    nu: float
    cp: AboveZero | None = None
    kappa: FromZero | None = None
    alpha: float = 0.0

    def checked(self):
        return isotropic(self.law, self)


def isotropic(law: type, constants: tuple) -> Any:
    rho, E, nu, *heat = constants
    return expanding(law(1 / rho, *lame_parameters(E, nu)), *heat)


warn_of_locking(ElasticLaw)


class OfDeformation:
    __slots__ = ()


def of_deformation(law: type) -> type:
    """Declare a law whose state is its deformation gradient F (class decorator)."""
    for function in (
        laws.initial_state, laws.by_rates, laws.deformation, laws.jacobian, laws.advance,
        laws.elastic_strain,
    ):  # fmt: skip
        function.on(law)(function.find((OfDeformation,)))
    return law


class Hyperelastic(OfDeformation, ElasticLaw):
    __slots__ = ()


class State(NamedTuple):
    F: Any


@laws.initial_state.on(OfDeformation)
def _initial_state_of_deformation(law, kin, template):
    return State(unit(kin))


laws.answers(OfDeformation, {laws.by_rates: False, laws.deformation: "F"})


@laws.jacobian.on(OfDeformation)
def _jacobian_of_deformation(law, kin, state):
    return det(state.F)


@laws.advance.on(OfDeformation)
def _advance_of_deformation(law, kin, state, dl, dt):
    return State(state.F.after(dl))


@laws.elastic_strain.on(OfDeformation)
def _elastic_strain_of_deformation(law, kin, state):
    return 0.5 * state.F.right_cauchy_green() - 0.5 * I
