"""Viscosity prony: relaxation of the deviatoric stress of an elastic law."""

from math import log
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler import round_off, where
from karamelo_py.compiler.powers import exponential
from karamelo_py.language import registry
from karamelo_py.language.arguments import Argument
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
)  # fmt: skip
from karamelo_py.points.laws import Absent, LawTraits, law_parts, law_traits
from karamelo_py.points.laws.parameters import MaterialArgument
from karamelo_py.points.laws.thermoelastic import heated_by, is_warm
from karamelo_py.script.errors import Mark, ScriptError, plural

ENOUGH = 1e3  # strain increment / round-off above which the stiffness of an increment is used
LEAST = 0.01  # smallest stiffness / stiffness at rest of an increment that is used
SMALL = 0.01  # step / relaxation time below which a series is exact


class ElasticMaterial(MaterialArgument):
    script_kind = "the ID of an elastic material"
    purpose: ClassVar[str] = "relax"
    order: ClassVar[str] = "one viscosity(prony, ...), before viscosity(newtonian, ...)"

    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        named = [registry.name_of("viscosity", type(one)) for one in law_parts(law)]
        if viscous := [name for name in named if registry.knows("viscosity", name)]:
            return f"has viscosity {viscous[0]} already", cls.order
        if law_traits(law).rebounds and is_isotropic(law):
            return None
        others = "a material such as neo-hookean, ogden, hyperelastic, hencky or linear"
        return f"is not an isotropic elastic solid, whose stress could {cls.purpose}", others


def strained(law: Any, component: int) -> Any:
    """Return stress / strain after a small increment of one component of F from rest."""
    space, size = Space(), 1e-6
    dl = tensor(space, [size * (component == k) for k in range(9)])
    state = laws.advance(law, space, laws.initial_state(law, space, 1.0), dl, 1.0)
    return laws.cauchy_stress(law, space, state) / size


def is_isotropic(law: Any) -> bool:
    along = [strained(law, 4 * k)[k] for k in range(3)]
    shears = [strained(law, component)[k] for k, component in ((3, 1), (4, 2), (5, 5))]
    across = strained(law, 0)[1]
    # In isotropic bodies, stress along minus across an axial strain is 2 G, as in shear.
    even = [2 * shears[0] / (along[0] - across), 1.0]
    return max(map(np.ptp, (along, shears, max(along) * np.array(even)))) < 1e-3 * max(along)


class Wlf(NamedTuple):
    """Shift of relaxation times with temperature; script argument (C1, C2, Tr)."""

    in_lanes = True
    traits = LawTraits(by_temperature=True)
    script_kind = "the constants (C1, C2, Tr)"

    C1: float
    C2: float
    Tr: float

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        values = [one.value(hub) for one in argument.listed()]
        numbers = [one for one in values if isinstance(one, float)]
        if not len(values) == len(numbers) == 3:
            message = f"'{argument.text}' is not a shift"
            raise ScriptError(message, mark=argument.mark, expected=cls.script_kind)
        if not min(numbers[:2]) > 0:
            message = "C1 and C2 of a shift are above 0"
            raise ScriptError(message, mark=argument.mark, expected="such as (17.44, 51.6, Tg)")
        return cls(*numbers)


class Positives(tuple):
    """Script argument: positive numbers (0.2, 0.1), with their marks in the script."""

    script_kind = "a number above 0, or several such as (0.2, 0.1)"
    marks: tuple[Mark, ...]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        listed = argument.listed()
        for one in listed:
            number = one.value(hub)
            if not (isinstance(number, float) and number > 0):
                message = f"{one.text} is not a number above 0"
                raise ScriptError(message, mark=one.mark, expected=cls.script_kind)
        made = cls(one.value(hub) for one in listed)
        made.marks = tuple(one.mark for one in listed)
        return made


DECADES = 30.0  # largest shift, as the formula has a pole at T = Tr - C2


def shifted(shift, dt, T):
    """Return dt / (shift factor of relaxation times at the temperature T)."""
    if isinstance(shift, Absent):
        return dt
    above = T - shift.Tr
    decades = shift.C1 * above / max(shift.C2 + above, 1e-6 * shift.C2)
    return dt * exponential(log(10) * min(max(decades, -DECADES), DECADES))


class Branch(NamedTuple):
    in_lanes = True

    g: float  # relaxing fraction of the stiffness
    tau: float
    softness: float  # stored energy / squared stress, 1/(4 g G)
    rest: Any


class Viscoelastic(NamedTuple):
    """Relaxation of the deviatoric stress of an elastic solid, by a Prony series.

    Parameters
    ----------
    material
        ID of an isotropic elastic material: the instantaneous response.
    g
        Fraction of the instantaneous shear stiffness that relaxes, for each term.
    tau
        Relaxation time of each term.
    wlf
        C1, C2, Tr: in a material with a temperature T, relaxation times are multiplied by 10^(-C1
        (T - Tr)/(C2 + T - Tr)) (Williams, Landel & Ferry 1955).

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.4)
    viscosity(prony, rubber, g=(0.3, 0.2), tau=(0.01, 1))
    material(polymer, neo-hookean, 1000, 1e6, 0.4, 2000, 0.2)
    viscosity(prony, polymer, g=0.3, tau=1, wlf=(17.44, 51.6, 373))

    Notes
    -----
    Finite linear viscoelasticity (Simo 1987; Simo & Hughes 1998, section 10.4): the Kirchhoff
    stress is k - sum dev(g s - h), where k is the Kirchhoff stress of the elastic law, s = dev k,
    and the internal stress h of each term follows s and decays with the relaxation time tau: h' = g
    s' - h/tau. Rates are upper-convected (Oldroyd). Steps are exact for a constant rate of s. The
    relaxation modulus is G(t) = G (1 - sum g (1 - exp(-t/tau))); the volume response is elastic.

    Each branch dissipates at the rate |h|^2/(2 g G tau) (column ``dissipated``), with the tangent
    shear modulus G of the elastic law along the last strain increment; this heats a material with a
    temperature. At small strains a branch stores |h|^2/(4 g G). In a closed cycle to a stretch
    of 3, the reported dissipation matches the work done to within 8 %. With fix initial_stress the
    body is fully relaxed, so its shear modulus is (1 - sum g) G.

    See Also
    --------
    viscosity newtonian, material ogden, material mullins, compute dissipated_energy
    """

    in_lanes = True

    elastic: Any
    branches: Any
    shift: Any = Absent()

    syntax = "material, g=(g1, ...), tau=(tau1, ...)[, wlf=(C1, C2, Tr)]"

    @classmethod
    def given(
        cls, material: ElasticMaterial, *, g: Positives, tau: Positives, wlf: Wlf | None = None
    ) -> "Viscoelastic":
        if wlf and not is_warm(material.whole):
            message = f"material '{material.id}' has no temperature, which wlf needs"
            raise ScriptError(message, argument="wlf", expected="an elastic law with cp and kappa")
        if len(g) != len(tau):
            message = f"there are {plural(len(g), 'fraction')} g and {plural(len(tau), 'time')} tau"
            raise ScriptError(message, argument="tau", expected="a time for each fraction")
        if not sum(g) < 1:
            message = f"the fractions g sum to {sum(g):g}: no stiffness would remain"
            raise ScriptError(message, argument="g", expected="a sum of g below 1")
        branches, G = Absent(), strained(material.whole, 1)[3]
        for fraction, time in zip(g, tau, strict=True):
            branches = Branch(fraction, time, 0.25 / (fraction * G), branches)
        return cls(material.whole, branches, wlf or Absent())


def _too_short(branch, scene):
    if scene.simulation.implicit or not branch.tau < scene.simulation.dt:
        return None
    parts = [part for one in scene.hub.materials.values() for part in one.parts()]
    relaxing = [one.arguments["tau"] for one in parts if "g" in one.arguments]
    times = next(times for times in relaxing if branch.tau in times)
    return {"mark": times.marks[times.index(branch.tau)], "dt": scene.simulation.dt}


known_failure(
    Branch,
    "short relaxation times",
    when=_too_short,
    reason="the relaxation time {part.tau:.4g} of material '{owner.id}' is below the time step, "
    "{dt:.4g}: the stress with this time never acts",
    cure="leave the term out, with a softer elastic law",
)


class State(NamedTuple):
    elastic: Any
    branches: Any  # h of the first branch, and h of all other branches
    loss: Any  # dissipated energy per reference volume
    gone: Any  # elastic energy that is not stored, per reference volume
    stiffness: Any  # shear stiffness of the last increment / stiffness at rest


def at_rest(branches, kin):
    return () if isinstance(branches, Absent) else (nothing(kin), at_rest(branches.rest, kin))


def relaxed_part(branches):
    return 0 if isinstance(branches, Absent) else branches.g + relaxed_part(branches.rest)


def internal_stress(memory, kin):
    return memory[0] + internal_stress(memory[1], kin) if len(memory) else nothing(kin)


def lost_stress(law, kin, s, branches):
    """Return the relaxed deviatoric Kirchhoff stress, from the elastic deviator s."""
    return relaxed_part(law.branches) * s - dev(internal_stress(branches, kin))


def mean_decay(x):
    few = 1 + x * (-1 / 2 + x * (1 / 6 + x * (-1 / 24 + x * (1 / 120))))
    return where(x < SMALL, few, (1 - exponential(-x)) / max(x, SMALL))


def weight_before(x):
    """Return the weight a of the old |h|^2 in the integral over dt/tau; the new one has x - a."""
    few = x * (1 / 2 + x * (-1 / 6 + x * x * (1 / 90)))
    left = exponential(-2 * max(x, SMALL))
    return where(x < SMALL, few, 0.5 - x * left / (1 - left))


def decayed(branches, memory, dl, added, dt):
    """Return internal stresses after a step, and the energy they lose.

    `added` is s after the step minus the convected s before.
    """
    if isinstance(branches, Absent):
        return (), 0
    x = dt / branches.tau
    h = exponential(-x) * memory[0].carried(dl) + branches.g * mean_decay(x) * added
    squares = [inner(dev(one), dev(one)) for one in (memory[0], h)]
    a = weight_before(x)
    loss = 2 * branches.softness * (a * squares[0] + (x - a) * squares[1])
    rest, more = decayed(branches.rest, memory[1], dl, added, dt)
    return (h, rest), loss + more


def stiffness_along(branches, added, strain, last):
    """Return shear stiffness along a strain increment / stiffness at rest, or the `last` one."""
    square = inner(strain, strain)
    precise = square > (ENOUGH * round_off(square)) ** 2
    # At rest, 1/(2 G) is 2 g softness.
    rise = inner(added, strain) / where(precise, square, 1) * (2 * branches.g * branches.softness)
    return where(precise & (rise > LEAST), rise, last)


def strain_of(dl):
    """Return Almansi's strain of I + dl, the conjugate of the Kirchhoff stress after the step."""
    back = dl @ inv(I + dl)
    return sym(back) - 0.5 * sym(back.transposed() @ back)


@laws.initial_state.on(Viscoelastic)
def _initial_state_viscoelastic(law, kin, template):
    return State(
        laws.initial_state(law.elastic, kin, template), at_rest(law.branches, kin), 0.0, 0.0, 1.0
    )


@laws.advance.on(Viscoelastic)
def _advance_viscoelastic(law, kin, state, dl, dt):
    plain = dl.dl if isinstance(dl, LargeIncrement) else dl
    elastic = laws.advance(law.elastic, kin, state.elastic, dl, dt)
    before = dev(laws.kirchhoff_stress(law.elastic, kin, state.elastic))
    after = dev(laws.kirchhoff_stress(law.elastic, kin, elastic))
    dt = shifted(law.shift, dt, laws.temperature(law.elastic, kin, elastic))
    strain, added = strain_of(plain), after - before.carried(plain)
    stiffness = stiffness_along(law.branches, added, dev(strain), state.stiffness)
    branches, loss = decayed(law.branches, state.branches, plain, added, dt)
    loss /= stiffness
    # The energy of the elastic law includes the work of the relaxed stress.
    lost = lost_stress(law, kin, before, state.branches).carried(plain)
    lost += lost_stress(law, kin, after, branches)
    gone = state.gone + loss + 0.5 * inner(lost, strain)
    elastic = heated_by(law.elastic, kin, elastic, loss)
    return State(elastic, branches, state.loss + loss, gone, stiffness)


@laws.kirchhoff_stress.on(Viscoelastic)
def _kirchhoff_stress_viscoelastic(law, kin, state):
    tau = laws.kirchhoff_stress(law.elastic, kin, state.elastic)
    return tau - lost_stress(law, kin, dev(tau), state.branches)


@laws.energy_density.on(Viscoelastic)
def _energy_density_viscoelastic(law, kin, state):
    return laws.energy_density(law.elastic, kin, state.elastic) - state.gone


@laws.dissipated_energy.on(Viscoelastic)
def _dissipated_energy_viscoelastic(law, kin, state):
    return state.loss + laws.dissipated_energy(law.elastic, kin, state.elastic)


def around_elastic(outer, stiffening):
    """Delegate functions to the elastic law; `stiffening` raises the squared wave speed."""
    laws.wraps(
        outer, "elastic", "elastic", (
            laws.jacobian, laws.deformation, laws.elastic_strain, laws.temperature, laws.by_rates,
            laws.specific_volume, laws.heat_capacity, laws.conductivity, laws.with_temperature,
            is_warm,
        ),
    )  # fmt: skip

    def stiffen(function):
        @function.on(outer)
        def _stiffened(law, kin, state):
            return function(law.elastic, kin, state.elastic) + stiffening(law, kin, state)

    for function in (laws.wave_speed_squared, laws.wave_speed_bound, laws.shear_part):
        stiffen(function)


def _stiffening(law, kin, state):
    # The relaxed part of the elastic stress.
    s = dev(laws.kirchhoff_stress(law.elastic, kin, state.elastic))
    lost = lost_stress(law, kin, s, state.branches).largest_row_sum()
    return 2 * lost * laws.specific_volume(law)


around_elastic(Viscoelastic, _stiffening)


@laws.delegating(laws.with_stress, Viscoelastic)
def _with_stress_viscoelastic(law, kin, state, stress):
    s = symmetric_tensor(kin, stress)
    left = 1 - relaxed_part(law.branches)
    relaxed = laws.with_stress(law.elastic, kin, state.elastic, dev(s) / left + 1 / 3 * tr(s) * I)
    stored = 0.5 * inner(dev(s), laws.elastic_strain(law.elastic, kin, relaxed))
    gone = stored * (1 - left) / left
    return State(relaxed, at_rest(law.branches, kin), state.loss, gone, state.stiffness)
