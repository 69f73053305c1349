"""Material mullins."""

from math import erf, pi, sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.compiler.powers import exponential, power
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, Space, dev, tensor
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.thermoelastic import heated_by
from karamelo_py.points.laws.viscoelastic import ElasticMaterial, around_elastic
from karamelo_py.script.errors import ScriptError

SPACE = Space()


class HyperelasticMaterial(ElasticMaterial):
    script_kind = "the ID of a hyperelastic material"
    purpose = "soften"
    order = "material(ID, mullins, ...) of the material without viscosity, then viscosity"

    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        if (refusal := super().refusal(law)) or laws.can(law, laws.deformation):
            return refusal
        others = "a material such as neo-hookean, yeoh, ogden or hyperelastic"
        return "has no energy that could soften", others


class Mullins(NamedTuple):
    """Filled rubber that is softer below its largest strain so far (Mullins effect).

    Parameters
    ----------
    elastic
        ID of an isotropic hyperelastic material: the response to the first loading.
    r
        Limit of the softening: at least 1 - 1/r of the stress in first loading remains.
    m
        Energy per unit volume that scales the softening.
    beta
        Increase of m per unit of the largest energy so far.

    Example
    -------
    material(virgin, yeoh, 1100, 2e8, 5e5, -1e4, 2e3)
    material(tyre, mullins, virgin, 2, 5e5)

    Notes
    -----
    dev tau = eta dev tau_e, eta = 1 - erf((Wm - W)/(m + beta Wm))/r, with the distortional energy W
    of the elastic material, W(F) - W(J^(1/3) I), and the largest W so far, Wm (Ogden & Roxburgh
    1999, Proc. R. Soc. Lond. A 455, 2861-2877; beta: Bose et al. 2003). In loading beyond Wm, eta
    is 1. The work that unloading does not return counts as dissipated, and heats a material with a
    temperature. Relaxation may be added: ``viscosity(prony, tyre, g=0.2, tau=1)``.

    See Also
    --------
    viscosity prony, hyperelastic, yeoh, ogden
    """

    in_lanes = True
    scalarised = ("softened",)
    traits = LawTraits(rebounds=True)

    elastic: Any
    r: float
    m: float
    beta: float

    @classmethod
    def given(
        cls, elastic: HyperelasticMaterial, r: float, m: AboveZero, beta: FromZero = 0.0
    ) -> Any:
        if not r > 1:
            raise ScriptError(
                f"r = {r:g} would reverse the stress", argument="r", expected="above 1"
            )
        return cls(elastic.whole, r, m, beta)


class State(NamedTuple):
    elastic: Any
    peak: Any  # largest distortional energy
    eta: Any


def swollen(law, kin, state):
    """Return the state without distortion, at the same volume and temperature."""
    size = power(laws.jacobian(law, kin, state), 1 / 3) - 1
    start = laws.initial_state(law, SPACE, size)
    start = laws.with_temperature(law, SPACE, start, laws.temperature(law, kin, state))
    zero = size - size
    dl = tensor(SPACE, (size, zero, zero, zero, size, zero, zero, zero, size))
    return laws.advance(law, SPACE, start, dl, 1)


def distortional_energy(law, kin, state):
    return laws.energy_density(law, kin, state) - laws.energy_density(
        law, SPACE, swollen(law, kin, state)
    )


@point_function()
def softened(law, W, peak):
    """Return eta, its derivative with respect to W, and Ogden and Roxburgh's phi."""


@softened.on(Mullins)
def _softened_mullins(law, W, peak):
    scale = law.m + law.beta * peak
    z = (peak - W) / scale
    bell = 2 / sqrt(pi) * exponential(-z * z)
    # phi: the integral of -W d eta from 1
    phi = peak * erf(z) - scale * (1 / sqrt(pi) - 0.5 * bell)
    return 1 - erf(z) / law.r, bell / (law.r * scale), phi / law.r


@laws.initial_state.on(Mullins)
def _initial_state_mullins(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template), 0.0, 1)


@laws.advance.on(Mullins)
def _advance_mullins(law, kin, state, dl, dt):
    elastic = laws.advance(law.elastic, kin, state.elastic, dl, dt)
    W = distortional_energy(law.elastic, kin, elastic)
    peak = max(state.peak, W)
    _, _, before = softened(law, W - W, state.peak)
    _, _, after = softened(law, W - W, peak)
    elastic = heated_by(law.elastic, kin, elastic, after - before)
    return State(elastic, peak, softened(law, W, peak)[0])


@laws.kirchhoff_stress.on(Mullins)
def _kirchhoff_stress_mullins(law, kin, state):
    tau = laws.kirchhoff_stress(law.elastic, kin, state.elastic)
    mean = laws.kirchhoff_stress(law.elastic, SPACE, swollen(law.elastic, kin, state.elastic))[0]
    return state.eta * tau + (1 - state.eta) * mean * I


@laws.dissipated_energy.on(Mullins)
def _dissipated_energy_mullins(law, kin, state):
    return softened(law, state.peak - state.peak, state.peak)[2]


@laws.energy_density.on(Mullins)
def _energy_density_mullins(law, kin, state):
    whole = laws.energy_density(law.elastic, kin, state.elastic)
    W = distortional_energy(law.elastic, kin, state.elastic)
    _, _, phi = softened(law, W, state.peak)
    return whole - (1 - state.eta) * W + phi - laws.dissipated_energy(law, kin, state)


def _stiffening(law, kin, state):
    # In unloading from the peak, eta changes, too.
    s = dev(laws.kirchhoff_stress(law.elastic, kin, state.elastic)).largest_row_sum()
    _, slope, _ = softened(law, state.peak, state.peak)
    return slope * s * s * laws.specific_volume(law)


around_elastic(Mullins, _stiffening)
