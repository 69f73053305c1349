"""Directions of a law by formulas of position, stored as numbers in each point's state.

A law that supports this has a field ``directions``, a NamedTuple of numbers. `Placed` wraps the law
and replaces these numbers by the numbers of the point; its :class:`Place` has the formulas. States
start with nominal directions; `with_directions` sets them when a scene is lowered.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler.tuples import count_in
from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.points import laws
from karamelo_py.points.laws.thermoelastic import Thermoelastic, warmed_elastic
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.script.expressions import FIRST, Expression
from karamelo_py.script.values import Values

Vector = tuple[float, ...]
SOME = 1000  # number of points per solid whose directions are checked before a run


class Direction:
    """Script argument: a direction ``(x, y, z)``, numbers or formulas of x0, y0, z0.

    Numbers give a unit vector, formulas a `Direction`.
    """

    script_kind: ClassVar[str] = "a direction (x, y, z)"

    def __init__(self, formulas: tuple[Expression, ...], mark: Mark | None):
        self.formulas = formulas
        self.mark = mark

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "Vector | Direction":
        formulas = formulas_of_place(hub, argument)
        if len(formulas) != 3:
            raise ScriptError(
                f"'{argument.text}' is not a direction",
                mark=argument.mark,
                expected="(x, y, z), not (0, 0, 0)",
            )
        if any(one.names for one in formulas):
            return cls(formulas, argument.mark)
        return unit_vector([one.constant for one in formulas], argument)

    def at(self, values: Values, x0: np.ndarray) -> np.ndarray:
        """Return unit vectors (n, 3) at positions `x0` (n, d)."""
        refuse_absent(self.formulas, x0.shape[1], self.mark)
        a = [one.evaluate_points(values, x0) for one in self.formulas]
        size = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        if not (wrong := ~(np.isfinite(size) & (size > 0))).any():
            return np.stack(a, axis=1) / size[:, None]
        k = int(np.flatnonzero(wrong)[0])
        direction = ", ".join(f"{one[k]:g}" for one in a)
        raise ScriptError(
            f"the direction is ({direction}) at the point {words_of(x0[k])}",
            mark=self.mark,
            expected="three numbers at every point, not all 0",
        )


def words_of(x0: np.ndarray) -> str:
    return ", ".join(f"{axis}0 = {x:.6g}" for axis, x in zip("xyz", x0, strict=False))


def refuse_absent(formulas: Sequence[Expression], d: int, mark: Mark | None) -> None:
    """Raise ScriptError for formulas of coordinates that scenes in `d` dimensions do not have."""
    if absent := names_in(formulas) & {"x0", "y0", "z0"} - {*("x0", "y0", "z0")[:d]}:
        message = f"a direction depends on {min(absent)}, which a scene in {d}D does not have"
        raise ScriptError(message, mark=mark, expected="a formula of x0" + " and y0" * (d > 1))


def names_in(formulas: Sequence[Expression]) -> frozenset[str]:
    return frozenset().union(*(one.names for one in formulas))


def formulas_of_place(hub: Scene, argument: Argument) -> tuple[Expression, ...]:
    """Return the numbers or formulas of x0, y0, z0 in parentheses; () if one of them is a text."""
    parts = [part for one in argument.listed() for part in one.listed()]  # (a), or ((a), (b))
    values = [one.value(hub) for one in parts]
    formulas = tuple(Expression(one) for one in values if not isinstance(one, str))
    for part, one in zip(parts, formulas, strict=False):
        if others := one.names - FIRST:
            raise ScriptError(
                f"a direction at rest cannot depend on {min(others)}",
                mark=part.mark,
                expected="a number, or a formula of x0, y0, z0",
            )
    return formulas if len(formulas) == len(values) else ()


def unit_vector(components: Sequence[float], argument: Argument) -> Vector:
    size = hypot(*components)
    if not 0 < size < np.inf:
        raise ScriptError(
            f"'{argument.text}' is not a direction",
            mark=argument.mark,
            expected="(x, y, z), not (0, 0, 0)",
        )
    return tuple(one / size for one in components)


@dataclass(frozen=True)
class Place:
    """Formulas of a law's directions; unused in kernels."""

    of: tuple[Vector | Direction, ...]

    def __float__(self) -> float:
        return 0.0

    @property
    def formulas(self) -> tuple[Expression, ...]:
        return sum((one.formulas for one in self.of if isinstance(one, Direction)), ())

    def rows(self, values: Values, x0: np.ndarray, _: Any = None) -> np.ndarray:
        """Return the numbers (n, k) of the law's field ``directions`` at `x0` (n, d)."""
        return np.hstack(
            [
                one.at(values, x0) if isinstance(one, Direction) else np.tile(one, (len(x0), 1))
                for one in self.of
            ]
        )


def placed(law: Any, kind: "type[Placed]", *of: Vector | Direction) -> Any:
    """Return `law`, wrapped in a `kind` of `Placed` if any of its directions are formulas."""
    if not any_formula(of):
        return law
    if isinstance(law, Thermoelastic):
        return law._replace(elastic=placed(law.elastic, kind, *of))
    return kind(law, Place(of))


def nominal(*of: Vector | Direction) -> Vector:
    return sum(((1.0, 0.0, 0.0) if any_formula(of) else one for one in of), ())


def any_formula(of: Sequence[Vector | Direction]) -> bool:
    return any(isinstance(one, Direction) for one in of)


def directions_in(law: "Placed", scene: Any) -> np.ndarray:
    """Return the directions (n, k) of some points of a scene with this law."""
    rows = [law.place.rows(scene.hub.values, x0) for x0 in some_places(law, scene)]
    return np.vstack(rows) if rows else np.empty((0, 0))


def some_places(law: "Placed | Oriented", scene: Any) -> Iterator[np.ndarray]:
    """Yield positions (n, d) of each solid with this law."""
    for solid in scene.hub.solids.values():
        if place_of(solid.material.law) is law.place:
            yield solid.places[: min(solid.count, SOME)]


def place_of(law: Any) -> Place | None:
    return next(
        (one.place for one in laws.law_parts(law) if isinstance(one, Placed | Oriented)), None
    )


def with_directions(state: tuple, column: np.ndarray, values: Values, solid: Any) -> np.ndarray:
    """Return a solid's state at rest (k, 1), or (k, n) if directions differ between points."""
    place = place_of(solid.material.law)
    if place is None:
        return column
    at_rest = directions_at_rest(state)
    rows = place.rows(values, solid.x0, at_rest).T
    first, columns = index_in(state, at_rest), np.repeat(column, solid.count, axis=1)
    columns[first : first + len(rows)] = rows
    return columns


def directions_at_rest(state: tuple) -> Any:
    """Return the numbers of a state that depend on position: directions, or F of `Oriented`."""
    if isinstance(state, State):
        return state.here or state.elastic.F
    inside = (directions_at_rest(item) for item in state if isinstance(item, tuple))
    return next((one for one in inside if one is not None), None)


def index_in(state: tuple, numbers: Any) -> int:
    """Return the index of the first of `numbers` in a flat state, or -1."""
    before = 0
    for item in state:
        if item is numbers:
            return before
        inside = index_in(item, numbers) if isinstance(item, tuple) else -1
        if inside >= 0:
            return before + inside
        before += count_in(item) if isinstance(item, tuple) else 1
    return -1


class Placed(NamedTuple):
    """A law whose ``directions`` differ from point to point."""

    in_lanes = True
    traits = laws.LawTraits(rebounds=True)

    elastic: Any
    place: Place


class Oriented(NamedTuple):
    """A law of F alone, with an F that starts as the rotation to the point's axes."""

    in_lanes = True

    elastic: Any
    place: Any


class State(NamedTuple):
    elastic: Any
    here: Any  # directions of the point


@laws.initial_state.on(Placed)
def _initial_state_placed(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template), law.elastic.directions)


@laws.law_here.on(Placed)
def _law_here_placed(law, within, state):
    return within._replace(directions=state.here)


ELASTIC = (
    laws.advance, laws.jacobian, laws.by_rates, laws.specific_volume, laws.kirchhoff_stress,
    laws.cauchy_stress, laws.wave_speed_squared, laws.wave_speed_bound, laws.shear_part,
    laws.energy_density, laws.elastic_strain, laws.dissipated_energy, laws.damage,
    laws.damage_initiation, laws.plastic_strain,
)  # fmt: skip
laws.wraps(Placed, "elastic", "elastic", (*ELASTIC, laws.deformation))


class DirectionShown(NamedTuple):
    """Output column: a component of the point's directions."""

    index: int


@laws.shown.on(DirectionShown)
def _shown_direction(tag, law, kin, state):
    return state.here[tag.index]


laws.answers(Placed, {laws.is_round: False})


@warmed_elastic.on(Placed)
def _warmed_elastic_placed(law, T):
    return law._replace(elastic=warmed_elastic(law.elastic, T))
