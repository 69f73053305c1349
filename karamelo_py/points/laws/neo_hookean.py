"""Material neo-hookean."""

from math import exp

from karamelo_py.compiler.powers import logarithm_near_one as log
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, tr
from karamelo_py.points.laws.elastic import Hyperelastic, IsotropicConstants


class NeoHookean(Hyperelastic):
    style = "neo-hookean"
    __slots__ = ()


class NeoHookeanConstants(IsotropicConstants):
    """Compressible neo-Hookean solid, valid for any strain and rotation.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.3)
    material(seal, neo-hookean, 1000, 1e6, 0.3, 1900, 0.2, 2e-4)

    Notes
    -----
    First Piola-Kirchhoff stress P = G (F - F^-T) + lambda ln(det F) F^-T. Stored energy W = G/2 (tr
    F^T F - 3) - G ln J + lambda/2 (ln J)^2 (Bonet & Wood 2008, section 6.4.3).

    A temperature T adds the stress -3 K alpha (T - T0) (bulk modulus K, initial temperature T0).
    The elastic strain excludes alpha (T - T0).

    See Also
    --------
    material, linear
    """

    __slots__ = ()
    law = NeoHookean


@laws.kirchhoff_stress.on(NeoHookean)
def _kirchhoff_stress_neo_hookean(law, kin, state):
    # P = G (F - F^-T) + lam ln J F^-T, so tau = P F^T = G (b - I) + lam ln J I
    b = state.F.left_cauchy_green()
    return law.G * b + (law.lam * log(det(state.F)) - law.G) * I


@laws.wave_speed_squared.on(NeoHookean)
def _wave_speed_squared_neo_hookean(law, kin, state):
    # Tangent of P along a principal stretch a: rho c^2 = G (1 + a^2) + lam (1 - ln J). The largest
    # row sum of b bounds a^2.
    return speed_squared(law, state.F, law.lam * (1 - log(det(state.F))))


@laws.wave_speed_bound.on(NeoHookean)
def _wave_speed_bound_neo_hookean(law, kin, state):
    # Without a logarithm: 1/J > 1 - ln J (by 2 % at J = 0.8), and J / e^2 > -(1 - ln J).
    J = det(state.F)
    return speed_squared(law, state.F, max(law.lam / J, -law.lam * J * exp(-2)))


@laws.shear_part.on(NeoHookean)
def _shear_part_neo_hookean(law, kin, state):
    return speed_squared(law, state.F, 0)


def speed_squared(law, F, bulk):
    stretch = F.left_cauchy_green().largest_row_sum()
    return (law.G * (1 + stretch) + max(bulk, 0)) * law.specific_volume


@laws.energy_density.on(NeoHookean)
def _energy_density_neo_hookean(law, kin, state):
    ln_J = log(det(state.F))
    excess = tr(state.F.left_cauchy_green()) - 3
    return 0.5 * law.G * excess - law.G * ln_J + 0.5 * law.lam * ln_J * ln_J
