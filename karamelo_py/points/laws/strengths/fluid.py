"""strength fluid: viscous shear of a Newtonian fluid."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import scale
from karamelo_py.language.signature import NonNegative
from karamelo_py.points.kinematics import contract, deviator, zero_symmetric
from karamelo_py.points.laws import strengths
from karamelo_py.points.laws.viscosity import damped


class Viscous(NamedTuple):
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

    in_lanes = True
    flows = True

    mu: float  # dynamic viscosity
    cell_size: float  # h, known when the scene is lowered

    @classmethod
    def given(cls, mu: Annotated[float, NonNegative]):
        """The law from the viscosity."""
        return cls(mu, 0.0)


@strengths.initial_loss.on(Viscous)
def _initial_loss_viscous(strength, like):
    return (real(0, like),)


@strengths.shear_response.on(Viscous)
def _shear_response_viscous(strength, kin, s, strain, memory, heat, dt):
    new = scale(real(2, dt) * strength.mu / dt, deviator(kin, strain))
    return new, memory, contract(kin, new, strain)


@strengths.damped_speed_squared.on(Viscous)
def _damped_speed_squared_viscous(strength, squared, density):
    # nu = 4/3 mu/rho
    return damped(squared, real(4 / 3, density) * strength.mu / (density * strength.cell_size))


@strengths.shear_modulus.on(Viscous)
def _shear_modulus_viscous(strength):
    return real(0, strength.mu)


@strengths.shear_strain.on(Viscous)
def _shear_strain_viscous(strength, kin, s):
    return zero_symmetric(kin, strength.mu)


@strengths.shear_energy.on(Viscous)
def _shear_energy_viscous(strength, kin, s):
    return real(0, strength.mu)
