"""Material hencky."""

from karamelo_py.compiler.powers import logarithm_near_one as log
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, inner
from karamelo_py.points.kinematics.principal import logarithm_of
from karamelo_py.points.laws.elastic import Hyperelastic, IsotropicConstants


class Hencky(Hyperelastic):
    style = "hencky"
    __slots__ = ()


class HenckyConstants(IsotropicConstants):
    """Elastic solid with stress linear in logarithmic strain, for any strain and rotation.

    Example
    -------
    material(rubber, hencky, 1000, 1e6, 0.3)

    Notes
    -----
    Kirchhoff stress tau = 2 G ln V + lambda ln(det F) I, with ln V = 1/2 ln F F^T of the left
    stretch V. Stored energy W = G ln V : ln V + lambda/2 (ln J)^2 (Hencky 1928; Anand 1979, "On H.
    Hencky's approximate strain-energy function for moderate deformations", J. Appl. Mech. 46). As
    its strains are additive, this law is the elastic part of most soil plasticity at large strain.

    A temperature T adds the stress -3 K alpha (T - T0) (bulk modulus K, initial temperature T0).
    The elastic strain excludes alpha (T - T0).

    See Also
    --------
    material, neo-hookean, linear, eos-strength, cam-clay
    """

    __slots__ = ()
    law = Hencky
    scalarised = ("kirchhoff_stress", "elastic_strain")


@laws.elastic_strain.on(Hencky)
def _elastic_strain_hencky(law, kin, state):
    return 0.5 * logarithm_of(state.F.left_cauchy_green())


@laws.kirchhoff_stress.on(Hencky)
def _kirchhoff_stress_hencky(law, kin, state):
    return law.G * logarithm_of(state.F.left_cauchy_green()) + law.lam * log(det(state.F)) * I


@laws.wave_speed_squared.on(Hencky)
def _wave_speed_squared_hencky(law, kin, state):
    # Along a principal direction rho_0 c^2 = lam + 2 G - tau. Shear waves, 2 G ln(a/b) a^2 / (a^2 -
    # b^2) for stretches a and b, are slower while a/b is below 4.
    tau = laws.kirchhoff_stress(law, kin, state)
    return (law.lam + 2 * law.G + tau.largest_row_sum()) * law.specific_volume


@laws.energy_density.on(Hencky)
def _energy_density_hencky(law, kin, state):
    strain, ln_J = laws.elastic_strain(law, kin, state), log(det(state.F))
    return law.G * inner(strain, strain) + 0.5 * law.lam * ln_J * ln_J
