"""Material viscoelastic: an elastic law whose deviatoric stress partly relaxes (Prony series)."""

from functools import reduce
from typing import Any, ClassVar, NamedTuple

from karamelo_py.compiler import where
from karamelo_py.compiler.powers import exponential
from karamelo_py.language.arguments import Argument, look_up
from karamelo_py.language.rules import known_failure
from karamelo_py.language.scene import Scene
from karamelo_py.points import laws
from karamelo_py.points.kinematics import (
    I,
    LargeIncrement,
    Space,
    dev,
    inner,
    inv,
    nothing,
    sym,
    symmetric_tensor,
    tensor,
    tr,
)
from karamelo_py.points.laws import Absent, LawTraits, law_traits
from karamelo_py.script.errors import ScriptError

PROBE = 1e-6  # strain at which moduli are measured
SMALL = 0.01  # step over relaxation time below which series are exact


class ElasticMaterial:
    script_kind: ClassVar[str] = "the ID of an elastic material"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        material = look_up(hub.materials, argument)
        if not law_traits(material.whole).rebounds or not is_isotropic(material.whole):
            raise ScriptError(
                f"material '{material.id}' is no isotropic elastic solid, whose stress could relax",
                place=argument.place,
                expected="a material such as neo-hookean, ogden, hyperelastic, hencky or linear",
            )
        return material


def strained(law: Any, *gradient: float) -> Any:
    """Stress over strain after a small strain from rest."""
    space = Space()
    dl = tensor(space, [PROBE * x for x in gradient])
    state = laws.advance(law, space, laws.initial_state(law, space, 1.0), dl, 1.0)
    return laws.cauchy_stress(law, space, state) / PROBE


def is_isotropic(law: Any) -> bool:
    along = [strained(law, *[i == k for k in range(9)])[n] for n, i in enumerate((0, 4, 8))]
    shears = [strained(law, *[i == k for k in range(9)])[n] for n, i in ((3, 1), (4, 2), (5, 5))]
    close = 1e-3 * max(along)
    return max(along) - min(along) < close and max(shears) - min(shears) < close


class Branch(NamedTuple):
    in_lanes = True

    g: float  # fraction of the stiffness that relaxes
    tau: float  # relaxation time
    softness: float  # 1/(4 g G), stored energy over the square of its stress
    rest: Any  # further branches


class Viscoelastic(NamedTuple):
    """Elastic solid whose deviatoric stress relaxes, by a Prony series.

    Parameters
    ----------
    elastic
        ID of an isotropic elastic material: the instantaneous response.
    pairs
        g and tau of each term: the fraction of the instantaneous shear stiffness that relaxes, and
        its relaxation time.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.4)
    material(damper, viscoelastic, rubber, 0.3, 0.01, 0.2, 1)

    Notes
    -----
    Finite linear viscoelasticity (Simo 1987; Simo & Hughes 1998, section 10.4): tau = tau_e - sum
    (g s - h), with the Kirchhoff stress tau_e of the elastic law, s = dev tau_e, and internal
    stresses h that follow s and decay: h' = g s' - h/tau. The rate is convected with the body. A
    step is exact for a constant rate of s, however long it is. The relaxation modulus is G(t) = G
    (1 - sum g (1 - exp(-t/tau))); the volume response is elastic.

    The strain energy contains the branches, |h|^2/(4 g G) each. The column ``dissipated`` is the
    energy that they have lost, at the rate |h|^2/(2 g G tau), with the shear modulus G at rest. A
    relaxed body has 1 - sum g of the stiffness. Fix initial_stress starts from a relaxed body.

    See Also
    --------
    neo-hookean, ogden, hyperelastic, compute dissipated_energy
    """

    in_lanes = True
    traits = LawTraits(wraps=True)

    law: Any
    branches: Any

    syntax = "elastic, g1, tau1[, g2, tau2, ...]"

    @classmethod
    def given(cls, elastic: ElasticMaterial, *pairs: float):
        if not pairs or len(pairs) % 2:
            raise ScriptError("the terms are pairs of g and tau", expected=cls.syntax)
        for k, value in enumerate(pairs):
            if k % 2 and not value > 0:
                raise ScriptError(
                    f"the relaxation time {value:g} is impossible",
                    argument=1 + k,
                    expected="a time above 0",
                )
            if not k % 2 and not 0 < value < 1:
                raise ScriptError(
                    f"the fraction {value:g} of the stiffness cannot relax",
                    argument=1 + k,
                    expected="a number between 0 and 1",
                    hint="g and tau alternate: " + cls.syntax,
                )
        if not sum(pairs[::2]) < 1:
            raise ScriptError(
                f"the fractions g sum to {sum(pairs[::2]):g}: nothing would remain",
                argument=len(pairs) - 1,
                expected="a sum below 1",
            )
        G = strained(elastic.whole, 0, 1, 0, 0, 0, 0, 0, 0, 0)[3]
        terms = zip(pairs[::2], pairs[1::2], strict=True)
        made = [(g, tau, 0.25 / (g * G)) for g, tau in terms]
        return cls(elastic.whole, reduce(lambda rest, one: Branch(*one, rest), made, Absent()))


known_failure(
    Branch,
    "short relaxation times",
    when=lambda branch, scene: branch.tau < scene.simulation.dt,
    reason="material '{owner.id}' has a relaxation time below the time step, in which that part "
    "of the stress never acts",
    cure="leave the term out, with a softer elastic law",
)


class State(NamedTuple):
    elastic: Any
    branches: Any  # internal stresses, from the last one
    loss: Any  # dissipated energy per reference volume
    gone: Any  # energy of the elastic law that is not stored, per reference volume


class Internal(NamedTuple):
    h: Any
    rest: Any


class OfElastic(NamedTuple):
    column: Any


def at_rest(branches, kin):
    return (
        () if isinstance(branches, Absent) else Internal(nothing(kin), at_rest(branches.rest, kin))
    )


def relaxed_part(branches):
    return 0 if isinstance(branches, Absent) else branches.g + relaxed_part(branches.rest)


def internal_stress(memory, kin):
    """Sum of the internal stresses."""
    return memory.h + internal_stress(memory.rest, kin) if len(memory) else nothing(kin)


def lost_stress(law, kin, s, branches):
    """Deviatoric Kirchhoff stress that has relaxed, from the elastic deviator s."""
    return relaxed_part(law.branches) * s - dev(internal_stress(branches, kin))


def elastic_deviator(law, kin, elastic):
    return dev(laws.kirchhoff_stress(law.law, kin, elastic))


def mean_decay(x):
    """(1 - exp(-x))/x."""
    few = 1 + x * (-1 / 2 + x * (1 / 6 + x * (-1 / 24 + x * (1 / 120))))
    return where(x < SMALL, few, (1 - exponential(-x)) / max(x, SMALL))


def weight_before(x):
    """Weight a of |h|^2 before in the integral of |h|^2 dt/tau, x - a after; exact in decay."""
    few = x * (1 / 2 + x * (-1 / 6 + x * x * (1 / 90)))
    left = exponential(-2 * max(x, SMALL))
    return where(x < SMALL, few, 0.5 - x * left / (1 - left))


def decayed(branches, memory, dl, added, dt):
    """Internal stresses after a step, and the energy that they lose.

    `added` is s after the step less the convected s before.
    """
    if isinstance(branches, Absent):
        return (), 0
    x = dt / branches.tau
    h = exponential(-x) * memory.h.carried(dl) + branches.g * mean_decay(x) * added
    squares = [inner(dev(one), dev(one)) for one in (memory.h, h)]
    a = weight_before(x)
    loss = 2 * branches.softness * (a * squares[0] + (x - a) * squares[1])
    rest, more = decayed(branches.rest, memory.rest, dl, added, dt)
    return Internal(h, rest), loss + more


def strain_of(dl):
    """Almansi's strain of I + dl: it does work with Kirchhoff stresses at the end of the step."""
    back = dl @ inv(I + dl)
    return sym(back) - 0.5 * sym(back.transposed() @ back)


@laws.initial_state.on(Viscoelastic)
def _initial_state_viscoelastic(law, kin, like):
    return State(laws.initial_state(law.law, kin, like), at_rest(law.branches, kin), 0.0, 0.0)


@laws.advance.on(Viscoelastic)
def _advance_viscoelastic(law, kin, state, dl, dt):
    plain = dl.dl if isinstance(dl, LargeIncrement) else dl
    elastic = laws.advance(law.law, kin, state.elastic, dl, dt)
    before = elastic_deviator(law, kin, state.elastic)
    after = elastic_deviator(law, kin, elastic)
    branches, loss = decayed(law.branches, state.branches, plain, after - before.carried(plain), dt)
    # Work that the relaxed stress does not do.
    lost = lost_stress(law, kin, before, state.branches).carried(plain)
    lost += lost_stress(law, kin, after, branches)
    gone = state.gone + loss + 0.5 * inner(lost, strain_of(plain))
    return State(elastic, branches, state.loss + loss, gone)


@laws.kirchhoff_stress.on(Viscoelastic)
def _kirchhoff_stress_viscoelastic(law, kin, state):
    tau = laws.kirchhoff_stress(law.law, kin, state.elastic)
    return tau - lost_stress(law, kin, dev(tau), state.branches)


@laws.cauchy_stress.on(Viscoelastic)
def _cauchy_stress_viscoelastic(law, kin, state):
    return laws.kirchhoff_stress(law, kin, state) / laws.jacobian(law, kin, state)


@laws.energy_density.on(Viscoelastic)
def _energy_density_viscoelastic(law, kin, state):
    return laws.energy_density(law.law, kin, state.elastic) - state.gone


@laws.dissipated_energy.on(Branch)
def _dissipated_energy_branch(branch, kin, state):
    return state.loss


@laws.dissipated_energy.on(Viscoelastic)
def _dissipated_energy_viscoelastic(law, kin, state):
    return state.loss


laws.column(Viscoelastic, "dissipated", laws.dissipated_energy)


def _with_lost_stress(function):
    @function.on(Viscoelastic)
    def _speed_viscoelastic(law, kin, state):
        # The elastic stiffness, and the stress that the elastic law has and the body has not.
        s = elastic_deviator(law, kin, state.elastic)
        lost = lost_stress(law, kin, s, state.branches).largest_row_sum()
        return function(law.law, kin, state.elastic) + 2 * lost * laws.specific_volume(law)


for _function in (laws.wave_speed_squared, laws.wave_speed_bound, laws.shear_part):
    _with_lost_stress(_function)


def _of_law_within(function):
    @function.on(Viscoelastic)
    def _within(law, *arguments):
        if len(arguments) < 2:
            return function(law.law, *arguments)
        return function(law.law, arguments[0], arguments[1].elastic)


for _function in (
    laws.jacobian, laws.deformation, laws.elastic_strain, laws.temperature, laws.by_rates,
    laws.specific_volume, laws.heat_capacity, laws.conductivity,
):  # fmt: skip
    _of_law_within(_function)


@laws.with_temperature.on(Viscoelastic)
def _with_temperature_viscoelastic(law, kin, state, T):
    return state._replace(elastic=laws.with_temperature(law.law, kin, state.elastic, T))


@laws.with_stress.on(Viscoelastic)
def _with_stress_viscoelastic(law, kin, state, stress):
    s = symmetric_tensor(kin, stress)
    left = 1 - relaxed_part(law.branches)
    relaxed = laws.with_stress(law.law, kin, state.elastic, dev(s) / left + 1 / 3 * tr(s) * I)
    stored = 0.5 * inner(dev(s), laws.elastic_strain(law.law, kin, relaxed))
    return State(relaxed, at_rest(law.branches, kin), state.loss, stored * (1 - left) / left)


@laws.shown.on(OfElastic)
def _shown_within(tag, law, kin, state):
    return laws.shown(tag.column, law.law, kin, state.elastic)


@laws.of_part.on(Viscoelastic)
def _of_part_viscoelastic(law, tag):
    return OfElastic(tag)
