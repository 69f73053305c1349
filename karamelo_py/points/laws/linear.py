"""Material linear."""

from typing import Any, Literal, NamedTuple

from karamelo_py.language.rules import gain
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, inner, nothing, sym, symmetric_tensor, tr
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.elastic import ElasticLaw, isotropic
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero


class LinearElastic(ElasticLaw):
    style = "linear"
    __slots__ = ()
    turns = True


class FixedFrame(LinearElastic):
    """Hooke's law whose stress does not rotate with the point, as in Karamelo."""

    __slots__ = ()
    traits = LawTraits(hypoelastic=True)
    turns = False


class LinearConstants(NamedTuple):
    """Hooke's law in rate form, for large rotations.

    Parameters
    ----------
    rho
        Density.
    E
        Young's modulus.
    nu
        Poisson's ratio, above -1 and below 0.5.
    cp, kappa
        Heat capacity per unit mass, and conductivity; both or neither. With both, points have a
        temperature, initially the solid's.
    alpha
        Coefficient of linear expansion.
    rate
        ``jaumann``: the stress rotates with the point. ``none``: the stress does not rotate, as in
        Karamelo.

    Example
    -------
    material(rubber, linear, 1000, 1e6, 0.3)
    material(girder, linear, 7850, 211e9, 0.3, 460, 45, 12e-6)

    Notes
    -----
    sigma' = R sigma R^T + 2 G d + lambda tr(d) I (Jaumann rate; Hughes & Winget 1980), d and R the
    step's strain and rotation. Above 10 % strain, prefer a hyperelastic law such as neo-hookean. In
    1D, strain is uniaxial.

    A temperature T adds the stress -3 K alpha (T - T0) (bulk modulus K, initial temperature T0).
    The elastic strain excludes alpha (T - T0).

    See Also
    --------
    material, neo-hookean
    """

    rho: AboveZero
    E: AboveZero
    nu: float
    cp: AboveZero | None = None
    kappa: FromZero | None = None
    alpha: float = 0.0
    rate: ByName[Literal["jaumann", "none"]] = "jaumann"

    def checked(self):
        *constants, rate = self
        return isotropic(LinearElastic if rate == "jaumann" else FixedFrame, constants)


class State(NamedTuple):
    J: Any
    sigma: Any  # Cauchy stress


gain(
    LinearElastic,
    when=lambda law, scene: scene.shear_stress > 0.25 * law.G,
    cause="material linear at large strain: stress summed by rates does not conserve the work "
    "of a closed cycle",
    cure="material neo-hookean, which conserves energy",
)


@laws.initial_state.on(LinearElastic)
def _initial_state_linear_elastic(law, kin, template):
    return State(1, nothing(kin))


laws.answers(LinearElastic, {laws.cauchy_stress: "sigma"})


@laws.advance.on(LinearElastic)
def _advance_linear_elastic(law, kin, state, dl, dt):
    eps = dl.strain_at_end() if law.turns else sym(dl)
    sigma = state.sigma.turned(dl) if law.turns else state.sigma
    increment = 2 * law.G * eps + law.lam * tr(eps) * I
    return State(state.J * det(I + dl), sigma + increment)


@laws.kirchhoff_stress.on(LinearElastic)
def _kirchhoff_stress_linear_elastic(law, kin, state):
    return state.J * state.sigma


@laws.wave_speed_squared.on(LinearElastic)
def _wave_speed_squared_linear_elastic(law, kin, state):
    # (lam + 2 G) / rho with constant moduli; the volume per mass is proportional to det F.
    return (law.lam + 2 * law.G) * law.specific_volume * state.J


@laws.shear_part.on(LinearElastic)
def _shear_part_linear_elastic(law, kin, state):
    return 2 * law.G * law.specific_volume * state.J


@laws.elastic_strain.on(LinearElastic)
def _elastic_strain_linear_elastic(law, kin, state):
    mean = law.lam / (3 * law.lam + 2 * law.G) * tr(state.sigma)
    return 0.5 / law.G * (state.sigma - mean * I)


@laws.energy_density.on(LinearElastic)
def _energy_density_linear_elastic(law, kin, state):
    return 0.5 * state.J * inner(state.sigma, laws.elastic_strain(law, kin, state))


@laws.with_stress.on(LinearElastic)
def _with_stress_linear_elastic(law, kin, state, stress):
    return State(state.J, symmetric_tensor(kin, stress))
