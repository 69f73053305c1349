"""Constitutive laws of a point, one file each: the script style and its point functions.

A law is a NamedTuple of parameters, some of which may be NamedTuples (parts, as in `eos_strength`).
The state is a NamedTuple of numbers and tensors in the kinematics `kin`; `j` = det F.

The class docstring is the manual. A style's arguments are the annotated fields, or the parameters
of a classmethod `given` that returns the law. `checked` refuses values that annotations cannot
exclude, and returns the law or an equivalent simpler law. ``traits`` (:class:`LawTraits`) is a
class attribute; `column` declares output columns.

If a law and all its parts have ``in_lanes``, several points are computed at once; point functions
then branch only with `where`, except those in ``scalarised``.
"""

from __future__ import annotations

import sys
from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real


class LawTraits(NamedTuple):
    rebounds: bool = False  # True if it sustains tension and returns all work done on it
    flows: bool = False  # True if it has no permanent shape: liquids, soils
    rings: bool = True  # True if bodies with a shear modulus vibrate
    any_speed: bool = False  # True if speeds may be far above its wave speed: gases
    hypoelastic: bool = False  # True if it never yields, but does not return all work
    of_solids: bool = False  # True for an eos that sustains tension
    burns: bool = False  # True for products of an explosive
    fluid: bool = False  # True for an eos of a liquid or gas
    by_temperature: bool = False  # True if it needs a temperature from its solid
    least_density: float = 10.0  # kg/m^3; a lower density suggests wrong units


def law_traits(component: Any) -> LawTraits:
    return getattr(component, "traits", LawTraits())


def parameter(component: Any, name: str, otherwise: Any = 0.0) -> Any:
    return component._asdict().get(name, otherwise) if isinstance(component, tuple) else otherwise


class Absent(NamedTuple):
    in_lanes = True


def law_kind(law: NamedTuple) -> tuple[type, ...]:
    """Return the classes of a law (or table of laws) and its parts, on which kernels depend."""
    parts = [law_kind(component) for component in law if isinstance(component, tuple)]
    return type(law), *(kind for component in parts for kind in component)


def law_parts(law: tuple) -> Iterator[tuple]:
    yield law
    for component in law:
        if isinstance(component, tuple):
            yield from law_parts(component)


def can(law: NamedTuple, function: Callable) -> bool:
    """Return True if the law or a part itself, not a wrapped law, defines the point function."""
    return defined_by(law_kind(law), function)


def defined_by(kinds: Iterable[type], function: Callable) -> bool:
    defining = (kind for kind in kinds if function.defined(kind))
    return any(function.find((kind,)) not in _delegating for kind in defining)


def answered(law: NamedTuple, function: Callable) -> bool:
    """Return True if the law defines the point function, itself or by the law that it wraps."""
    kind = type(law)
    if not function.defined(kind):
        return False
    if function.find((kind,)) not in _delegating:
        return True
    return any(answered(part, function) for part in law if isinstance(part, tuple))


_delegating: set[Callable] = set()


@point_function(otherwise=True)
def elastic_law(law):
    """Return the stress law inside a law that adds temperature or relaxation, else the law."""
    return law


def _elastic_law_within(law):
    return elastic_law(law.elastic)


def answers(law: type, values: dict[Callable, Any]) -> None:
    """Define point functions of a law that return a field of the state, or a constant.

    A string names the field of the state, the last argument of the functions: ``answers(CamClay,
    {elastic_strain: "e", by_rates: False})``.
    """
    for function, value in values.items():
        function.on(law)(_by_field(value) if isinstance(value, str) else _by_constant(value))


def _by_field(name: str) -> Callable:
    def of_field(*arguments):
        return getattr(arguments[-1], name)

    return of_field


def _by_constant(value: Any) -> Callable:
    def of_constant(*arguments):
        return value

    return of_constant


def delegating(function: Callable, outer: type) -> Callable[[Callable], Callable]:
    """Decorate the implementation for a wrapping law; the wrapped law must have the function."""

    def register(implementation: Callable) -> Callable:
        _delegating.add(implementation)
        return function.on(outer)(implementation)

    return register


def delegate(outer: type, component: str, kept: str, functions: tuple, kin: Any = None) -> None:
    """Define `functions` of `outer` by the law in field `component`, with the state in `kept`.

    The functions take (law), (law, template), or (law, kinematics, state, ...), where `kin`
    replaces the kinematics.
    """

    def register(function: Callable, changes: bool) -> None:
        @delegating(function, outer)
        def _of_law_within(law, *arguments):
            within = getattr(law, component)
            if len(arguments) < 2:
                return function(within, *arguments)
            kinematics, state, *others = arguments
            first = kinematics if kin is None else kin
            made = function(law_here(law, within, state), first, getattr(state, kept), *others)
            return state._replace(**{kept: made}) if changes else made

    for function in functions:
        register(function, function in (advance, with_temperature, with_stress, warmed, lit))
    if component == "elastic":
        elastic_law.on(outer)(_elastic_law_within)


def wraps(outer: type, component: str, kept: str, functions: tuple, kin: Any = None) -> None:
    """Call `delegate`, and show the columns of the inner law."""
    delegate(outer, component, kept, functions, kin)

    @within.on(outer)
    def _within(law, kinematics, state):
        first = kinematics if kin is None else kin
        return law_here(law, getattr(law, component), state), first, getattr(state, kept)


_columns: dict[type, dict[str, NamedTuple] | None] = {}


def column(component: type, name: str, source: Callable | NamedTuple | None = None) -> None:
    """Declare an output column by a `number` or a tag of `shown`; by default, a field of the state.

    Derived classes inherit the column. Laws with a `dissipated_energy` also have the column
    `dissipated`.
    """
    if source is None:
        source = _by_field(name)
        source.__name__, source.__module__ = name, component.__module__
        source = number(source)
    declared = _columns.setdefault(component, {})
    declared[name] = source if isinstance(source, tuple) else source.tag


def no_columns(component: type) -> None:
    """Declare that a class has no columns, even if its bases have."""
    _columns[component] = None


def columns_of(law: NamedTuple) -> dict[str, NamedTuple]:
    """Map column names, parts first, to tags for `shown`."""
    tags: dict[str, NamedTuple] = {}
    for part in reversed([part for part in law if isinstance(part, tuple)]):
        tags |= columns_of(part)
    if within.defined(type(law)):
        tags = {name: Within(tag) for name, tag in tags.items()}
    kind = type(law)
    own_tags: dict[str, NamedTuple] = {}
    for base in reversed(kind.__mro__):
        declared = _columns.get(base, {})
        own_tags = {} if declared is None else own_tags | declared
    if dissipated_energy.defined(kind) and dissipated_energy.find((kind,)) not in _delegating:
        own_tags.setdefault("dissipated", dissipated_energy.tag)
    return tags | own_tags


@point_function(otherwise=True)
def law_here(law, within, state):
    """Return the inner law with the numbers stored at the point."""
    return within


@point_function()
def within(law, kin, state):
    """Return the inner law of a wrapping law, with its kinematics and state."""


@point_function()
def shown(tag, law, kin, state):
    pass


class Within(NamedTuple):
    column: Any


@shown.on(Within)
def _shown_within(tag, law, kin, state):
    return shown(tag.column, *within(law, kin, state))


def number(function: Callable) -> Callable:
    """Make a point function of (law, kin, state) an output column.

    Cached kernels import the tag's class from its module.
    """
    name = f"{function.__name__}_tag"
    tag_class = namedtuple(name, (), module=function.__module__)

    @shown.on(tag_class)
    def _shown_column(tag, law, kin, state):
        return function(law, kin, state)

    setattr(sys.modules[function.__module__], name, tag_class)
    function.tag = tag_class()
    return function


@point_function()
def initial_state(law, kin, template):
    pass


@point_function()
def advance(law, kin, state, dl, dt):
    """Return the state after a step dt with the increment dl = dt grad v."""


class FbarStep(NamedTuple):
    dl: Any
    dt: Any
    extra: Any  # pressure in the nodal forces minus pressure of the point (F-bar)


@point_function(otherwise=True)
def advance_fbar(law, kin, state, step):
    return advance(law, kin, state, step.dl, step.dt)


@point_function()
def kirchhoff_stress(law, kin, state):
    """Return det F times the Cauchy stress, which forces multiply by the reference volume."""


@point_function(otherwise=True)
def cauchy_stress(law, kin, state):
    return kirchhoff_stress(law, kin, state) / jacobian(law, kin, state)


@point_function(otherwise=True)
def jacobian(law, kin, state):
    """Return det F."""
    return state.J


@point_function()
def deformation(law, kin, state):
    pass


@point_function(otherwise=True)
def by_rates(law):
    """Return True, known when compiled, if load steps need the logarithm of the strain."""
    return True


@point_function()
def wave_speed_squared(law, kin, state):
    """Return the squared speed of the fastest small disturbance, for the stable step."""


@point_function(otherwise=True)
def wave_speed_bound(law, kin, state):
    """Return an upper bound of `wave_speed_squared` that is cheaper to compute."""
    return wave_speed_squared(law, kin, state)


@point_function(otherwise=True)
def meeting(law, state, speed):
    """Return the state with the viscous pressure of a shock in a cell that closes at `speed`."""
    return state


@point_function(otherwise=True)
def stretch_across(law, state):
    return 1


@point_function(otherwise=True)
def is_round(law):
    """Return True if a bar pulled along x contracts equally in y and z."""
    return True


@point_function(otherwise=True)
def shear_part(law, kin, state):
    """Return the part 2 G / rho of `wave_speed_squared`, or an upper bound, for thin bodies."""
    return wave_speed_squared(law, kin, state)


@number
@point_function()
def energy_density(law, kin, state):
    """Return the stored energy per reference volume."""


@point_function(otherwise=True)
def constrained_velocity(law, v, v_grid):
    """Return the velocity after a step: `v_grid`, or v for rigid bodies."""
    return v_grid


def is_rigid(law: tuple) -> bool:
    return constrained_velocity.defined(type(law))


@number
@point_function(otherwise=True)
def dissipated_energy(law, kin, state):
    """Return the dissipated energy per reference volume; undefined if the law dissipates none."""
    return specific_volume(law) - specific_volume(law)


@number
@point_function()
def damage(law, kin, state):
    """Return the damage, 0 (intact) to 1 (broken)."""


@number
@point_function()
def damage_initiation(law, kin, state):
    """Return the damage initiation, growing from 0; damage begins at 1."""


@number
@point_function(otherwise=True)
def temperature(law, kin, state):
    return specific_volume(law) - specific_volume(law)


@point_function(otherwise=True)
def with_temperature(law, kin, state, T):
    return state


@point_function(otherwise=True)
def heat_capacity(law, template):
    """Return the heat capacity per mass and kelvin, 0 for laws without a temperature."""
    return real(0, template)


@point_function(otherwise=True)
def lit(law, kin, state, since):
    """Return an explosive's state a time `since` after ignition."""
    return state


@point_function(otherwise=True)
def warmed(law, kin, state, heat):
    """Return the state with `heat` added to the internal energy per reference volume, if any."""
    return state


@point_function(otherwise=True)
def conductivity(law, template):
    return real(0, template)


@point_function(otherwise=True)
def conductivity_now(law, kin, state, most):
    """Return the conductivity in the present state; `most` is the largest stable diffusivity."""
    return conductivity(law, most)


@point_function()
def elastic_strain(law, kin, state):
    pass


@number
@point_function()
def plastic_strain(law, kin, state):
    pass


@point_function()
def with_stress(law, kin, state, stress):
    """Return the state with this Cauchy stress (fix initial_stress)."""


@point_function(otherwise=True)
def specific_volume(law):
    return 1 / law.rho if "rho" in law._fields else law.specific_volume
