"""strength plastic: plasticity of von Mises."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import onto_yield_surface
from karamelo_py.points.laws.strengths.linear import elastic_trial


class LinearHardening(NamedTuple):
    """Elastic shear up to a yield stress, constant or with linear hardening (von Mises).

    Parameters
    ----------
    G
        Shear modulus.
    yield_stress
        Yield stress in uniaxial tension; in pure shear it yields at 1/sqrt(3) of it.
    H
        Hardening modulus: by how much the yield stress rises for each unit of plastic strain.

    Example
    -------
    strength(mild, plastic, 80e9, 400e6)
    strength(copper, plastic, 43.3e9, 400e6, 100e6)

    Notes
    -----
    Where the von Mises stress q = sqrt(3/2 s:s) of an elastic step is above the yield stress Y, the
    equivalent plastic strain (the column ep of dumps) grows by (q - Y)/(3 G + H) and the deviatoric
    stress s shrinks to the yield stress (radial return; Wilkins 1964; de Souza Neto et al. 2008,
    section 7.3).

    See Also
    --------
    linear, johnson_cook, swift, eos, material eos-strength, compute max_plastic_strain
    """

    in_lanes = True

    G: Annotated[float, Positive]
    yield_stress: Annotated[float, Positive]
    H: Annotated[float, NonNegative] = 0.0

    def checked(self):
        """The law; that without hardening where there is none."""
        return self if self.H > 0 else Plastic(self.G, self.yield_stress)


class Plastic(NamedTuple):
    """The same with a yield stress that stays."""

    in_lanes = True

    G: float
    yield_stress: float


remembers(Plastic, ep=0.0)
remembers(LinearHardening, ep=0.0)


@shear_response.on(Plastic)
@shear_response.on(LinearHardening)
def _shear_response_linear_hardening(strength, kin, s, strain, memory, heat, dt):
    trial = elastic_trial(strength.G, s, strain)
    q = von_mises(trial)
    H = hardening_modulus(strength)
    flow = strength.yield_stress + H * memory.ep
    x = max(q - flow, 0) / (3 * strength.G + H)
    flow += H * x
    return onto_yield_surface(trial, q, flow, x), memory._replace(ep=memory.ep + x), flow * x


@point_function()
def hardening_modulus(strength):
    """By how much the flow stress rises for each unit of plastic strain."""


@hardening_modulus.on(Plastic)
def _hardening_modulus_plastic(strength):
    return 0.0


@hardening_modulus.on(LinearHardening)
def _hardening_modulus_linear_hardening(strength):
    return strength.H
