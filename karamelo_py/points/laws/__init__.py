"""Constitutive laws of one point, one file each: the style for scripts, and the point functions.

A law is a NamedTuple of parameters (its class is the tag). It owns a state, a NamedTuple of numbers
and tensors; kernels only load it, pass it on and store it. Tensors have the components of the
kinematics `kin` (`karamelo_py.points.kinematics`); `j` = det F is the volume over the reference
volume. A law may consist of parts, NamedTuples among its parameters (`eos_strength`).

The class is also the style: its docstring is the manual, and its annotated fields are the
arguments. If a script gives other parameters than the law uses, a classmethod `given` takes the
arguments and returns the law. The method `checked` refuses values that annotations cannot, and
returns the law or an equivalent simpler one.

A law with ``in_lanes``, as all its parts must have, is computed for several points at once. Its
point functions do not branch on numbers of a point, except with `where`; those that do are named in
``scalarised``. Points of other laws are processed one by one.

Laws and their parts whose ``traits`` differ from the usual ones have them as a class attribute
(:class:`LawTraits`).

Output columns of a law are declared next to it (`column`).
"""

from __future__ import annotations

import sys
from collections import namedtuple
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function, real


class LawTraits(NamedTuple):
    """Traits of a law, or of a part of one."""

    rebounds: bool = False  # sustains tension and returns all the work done on it
    flows: bool = False  # holds no shape, as liquids and soils
    rings: bool = True  # vibrates, unless it has no shear modulus
    any_speed: bool = False  # may move many times faster than its waves, as gases
    least_density: float = 10.0  # kg/m^3, below which units are likely wrong
    wraps: bool = False  # can what the law within can


def law_traits(part: Any) -> LawTraits:
    """Return the traits of a law, of a part of one, or of its class."""
    return getattr(part, "traits", LawTraits())


def parameter(part: Any, name: str, otherwise: Any = 0.0) -> Any:
    """Return a parameter of a law, or of a part of one, by its name."""
    return part._asdict().get(name, otherwise) if isinstance(part, tuple) else otherwise


class Absent(NamedTuple):
    """Tag of a missing part of a law."""

    in_lanes = True


def law_kind(law: NamedTuple) -> tuple[type, ...]:
    """The classes of a law and its parts: laws of one kind share kernels and arrays.

    A table of laws (`karamelo_py.kernels.laws.law_table`) is of the kind of its laws.
    """
    parts = [law_kind(part) for part in law if isinstance(part, tuple)]
    return type(law), *(kind for part in parts for kind in part)


def law_parts(law: tuple) -> Iterator[tuple]:
    """The law and all its parts."""
    yield law
    for part in law:
        if isinstance(part, tuple):
            yield from law_parts(part)


def can(law: NamedTuple, function: Callable) -> bool:
    """Check that a point function is defined for a law, or for one of its parts."""
    kinds = (kind for kind in law_kind(law) if not law_traits(kind).wraps)
    return any(function.defined(kind) for kind in kinds)


_columns: dict[type, dict[str, NamedTuple]] = {}


def column(part: type, name: str, what: Callable | NamedTuple) -> None:
    """Declare an output column of laws with `part`, or of this class.

    Parameters
    ----------
    part
        The class of the law, or of one of its parts.
    name
        Its name in dumps, plots and tables.
    what
        A point function of the whole law (`number`), or a tag of `shown`.
    """
    _columns.setdefault(part, {})[name] = what if isinstance(what, tuple) else what.tag


def columns_of(law: NamedTuple) -> dict[str, NamedTuple]:
    """The output columns of a law, those from its parts first: name, and tag for `shown`."""
    own = _columns.get(type(law), {})
    kinds = reversed(law_kind(law)[1:])
    found = {name: what for kind in kinds for name, what in _columns.get(kind, {}).items()}
    return {name: of_part(law, what) for name, what in found.items()} | own


@point_function(otherwise=True)
def of_part(law, what):
    """The tag by which `law` shows the column `what` of one of its parts."""
    return what


@point_function()
def shown(what, law, kin, state):
    """The value of a tag for a point in `state`."""


def number(function: Callable) -> Callable:
    """Mark a point function of (law, kin, state) as an output column.

    It gets a tag by which kernels choose by type. The tag's class is stored in the module of the
    function, so that it can be imported, and kernels with it be cached.
    """
    name = f"{function.__name__}_tag"
    made = namedtuple(name, (), module=function.__module__)
    shown.on(made)(lambda what, law, kin, state: function(law, kin, state))
    setattr(sys.modules[function.__module__], name, made)
    function.tag = made()
    return function


@point_function()
def initial_state(law, kin, like):
    """The state of an undeformed, unstressed point."""


@point_function()
def advance(law, kin, state, dl, dt):
    """The state after the increment dl = dt grad v of a step dt."""


@point_function(otherwise=True)
def advance_beside(law, kin, state, dl, dt, beside):
    """As `advance`, if forces have `beside` more pressure than the point (F-bar)."""
    return advance(law, kin, state, dl, dt)


@point_function()
def kirchhoff_stress(law, kin, state):
    """det F times the Cauchy stress; times the reference volume it gives the nodal forces."""


@point_function()
def cauchy_stress(law, kin, state):
    """Cauchy stress, for output."""


@point_function()
def jacobian(law, kin, state):
    """det F."""


@point_function()
def deformation(law, kin, state):
    """F, for laws whose state holds it."""


@point_function(otherwise=True)
def by_rates(law):
    """Return True if a law sums strains, so that load steps need their logarithm: a constant."""
    return True


@point_function()
def wave_speed_squared(law, kin, state):
    """Squared speed of the fastest small disturbance, for the stable step."""


@point_function(otherwise=True)
def wave_speed_bound(law, kin, state):
    """Upper bound of `wave_speed_squared`, if that is cheaper: most points are slower anyway."""
    return wave_speed_squared(law, kin, state)


@point_function(otherwise=True)
def stretch_across(law, state):
    """Stretch across a thin body, thickness over initial thickness; 1 for all other laws."""
    return 1


@point_function(otherwise=True)
def is_round(law):
    """Return True if a bar along x that is pulled contracts by the same in y and z."""
    return True


@point_function(otherwise=True)
def shear_part(law, kin, state):
    """The part 2 G / rho of `wave_speed_squared`, or more: thin bodies have slower waves."""
    return wave_speed_squared(law, kin, state)


@number
@point_function()
def energy_density(law, kin, state):
    """Stored energy per reference volume."""


@point_function(otherwise=True)
def constrained_velocity(law, own, given):
    """Velocity of a point after a step: from the grid, or for rigid bodies their own."""
    return given


def moves_as_told(law: tuple) -> bool:
    """Return True for laws of rigid bodies."""
    return constrained_velocity.defined(type(law))


@number
@point_function(otherwise=True)
def dissipated_energy(law, kin, state):
    """Dissipated energy per reference volume; undefined for laws without dissipation."""
    return specific_volume(law) - specific_volume(law)


@number
@point_function()
def damage(law, kin, state):
    """0 intact to 1 broken; undefined for laws without damage."""


@number
@point_function()
def damage_initiation(law, kin, state):
    """Grows from 0, damage begins at 1; undefined for laws without damage."""


@number
@point_function(otherwise=True)
def temperature(law, kin, state):
    """Temperature; 0 for laws without one."""
    return specific_volume(law) - specific_volume(law)


@point_function(otherwise=True)
def with_temperature(law, kin, state, T):
    """The state at the temperature `T`; unchanged for laws without a temperature."""
    return state


@point_function(otherwise=True)
def heat_capacity(law, like):
    """Heat per mass and kelvin; 0 for laws without temperature."""
    return real(0, like)


@point_function(otherwise=True)
def warmed(law, kin, state, heat):
    """The state with `heat` more internal energy per reference volume, if the law has any."""
    return state


@point_function(otherwise=True)
def conductivity(law, like):
    """Heat flux per temperature gradient; 0 for laws without temperature."""
    return real(0, like)


@point_function()
def elastic_strain(law, kin, state):
    """Elastic strain, for output."""


@number
@point_function()
def plastic_strain(law, kin, state):
    """Equivalent plastic strain, for output; undefined for laws without."""


@point_function()
def with_stress(law, kin, state, stress):
    """The state with the Cauchy stress `stress` (initial_stress); undefined for laws without."""


@point_function(otherwise=True)
def specific_volume(law):
    """Reference volume per mass."""
    return law.specific_volume
