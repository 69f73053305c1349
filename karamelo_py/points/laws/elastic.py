"""Bases: isotropic elastic laws, and laws of the deformation gradient."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points import laws
from karamelo_py.points.kinematics import det, unit
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.parameters import lame_parameters, tell_of_locking
from karamelo_py.points.laws.thermoelastic import expanding


class ElasticLaw(NamedTuple):
    """Elastic solid with Young's modulus and Poisson's ratio, optionally with a temperature."""

    in_lanes = True
    traits = LawTraits(rebounds=True)

    specific_volume: float  # reference volume per mass
    lam: float  # Lame's first parameter
    G: float  # shear modulus

    @classmethod
    def given(
        cls,
        rho: Annotated[float, Positive],
        E: Annotated[float, Positive],
        nu: float,
        cp: Annotated[float, Positive] | None = None,
        kappa: Annotated[float, NonNegative] | None = None,
        alpha: float = 0.0,
    ):
        return expanding(cls(1 / rho, *lame_parameters(E, nu)), cp, kappa, alpha)


tell_of_locking(ElasticLaw)


class OfDeformation:
    """Base of laws whose stress is a function of the deformation gradient."""

    __slots__ = ()


class Hyperelastic(OfDeformation, ElasticLaw):
    """Base of laws of the deformation gradient with Young's modulus and Poisson's ratio."""

    __slots__ = ()


class State(NamedTuple):
    """State of a point."""

    F: Any  # deformation gradient


laws.initial_state.on(OfDeformation)(lambda law, kin, like: State(unit(kin)))
laws.by_rates.on(OfDeformation)(lambda law: False)
laws.deformation.on(OfDeformation)(lambda law, kin, state: state.F)
laws.jacobian.on(OfDeformation)(lambda law, kin, state: det(state.F))


laws.advance.on(OfDeformation)(lambda law, kin, state, dl, dt: State(state.F.after(dl)))


@laws.cauchy_stress.on(OfDeformation)
def _cauchy_stress_of_deformation(law, kin, state):
    return laws.kirchhoff_stress(law, kin, state) / det(state.F)
