"""Axes of a law by formulas of position: F of a point starts as a rotation R.

If F is replaced by F R, a law that depends on the deformation by F only is rotated by R, and its
axes then rotate with the body.
"""

from math import sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.points import laws
from karamelo_py.points.kinematics import KINEMATICS, total, unit
from karamelo_py.points.laws.leaning import LEANING
from karamelo_py.points.laws.placed import (
    ELASTIC,
    Oriented,
    State,
    formulas_of_place,
    refuse_absent,
    some_places,
    words_of,
)
from karamelo_py.points.laws.thin import has_short_trials
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.values import Values

LEANS = 1e-9
LEAST = 1e-6  # sine of the angle below which two vectors are parallel


class Axes:
    """Script argument: an angle about z in degrees, or two vectors; numbers or formulas."""

    script_kind: ClassVar[str] = "(angle), or two vectors (x1, y1, z1, x2, y2, z2)"

    def __init__(self, formulas: tuple[Expression, ...], mark: Mark | None):
        self.formulas = formulas
        self.mark = mark

    def __float__(self) -> float:
        return 0.0

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "Axes":
        formulas = formulas_of_place(hub, argument)
        if len(formulas) not in (1, 6):
            raise ScriptError(
                f"'{argument.text}' does not define axes",
                mark=argument.mark,
                expected=cls.script_kind,
            )
        made = cls(formulas, argument.mark)
        if not any(one.names for one in formulas):
            made.rotations(hub.values, np.zeros((1, 3)))
        return made

    def rotations(self, values: Values, x0: np.ndarray) -> np.ndarray:
        """Return rotations (n, 3, 3) at positions `x0` (n, d), with the axes as columns."""
        refuse_absent(self.formulas, x0.shape[1], self.mark)
        numbers = [one.evaluate_points(values, x0) for one in self.formulas]
        if len(numbers) == 1:
            (angle,) = np.radians(numbers)
            c, s, zero = np.cos(angle), np.sin(angle), np.zeros(len(x0))
            rows = (c, -s, zero), (s, c, zero), (zero, zero, zero + 1)
            return np.stack([np.stack(row, axis=1) for row in rows], axis=1)
        a, b = np.stack(numbers[:3], axis=1), np.stack(numbers[3:], axis=1)
        with np.errstate(all="ignore"):
            first = a / np.linalg.norm(a, axis=1, keepdims=True)
            size = np.linalg.norm(b, axis=1, keepdims=True)
            rest = b / size - np.sum(first * b / size, axis=1, keepdims=True) * first
            sine = np.linalg.norm(rest, axis=1, keepdims=True)
            second = rest / sine
        if (wrong := ~(np.isfinite(second).all(axis=1) & (sine[:, 0] > LEAST))).any():
            k = int(np.flatnonzero(wrong)[0])
            raise self.fault("two vectors are parallel or zero", x0[k])
        return np.stack([first, second, np.cross(first, second)], axis=2)

    def rows(self, values: Values, x0: np.ndarray, F: Any) -> np.ndarray:
        """Return the components (n, k) of the initial deformation gradient, a tensor such as F."""
        R = self.rotations(values, x0)
        if inclined(R, F):
            raise self.fault("the axes are inclined to the plane or line of the scene", x0[0])
        return np.stack([R[:, i, j] for i, j in F.places], axis=1)

    def fault(self, what: str, x0: np.ndarray) -> ScriptError:
        return ScriptError(
            f"axes: {what}, at the point {words_of(x0)}",
            mark=self.mark,
            expected=f"{self.script_kind}; in 2D without z",
        )


def inclined(R: np.ndarray, F: Any) -> bool:
    """Return True if rotations (n, 3, 3) have components that a tensor such as F lacks."""
    away = [R[:, i, j] for i in range(3) for j in range(3) if i != j and (i, j) not in F.places]
    return bool(np.abs(away).max(initial=0) > LEANS)


def _axes_lean(law: Any, scene: Any) -> bool:
    F, at = unit(KINEMATICS[scene.d]()), some_places(law, scene)
    return any(inclined(law.place.rotations(scene.hub.values, x0), F) for x0 in at)


LEANING[Oriented] = _axes_lean  # the run refuses such axes


def oriented(law: Any, axes: Axes | None) -> Any:
    return law if axes is None else Oriented(law, axes)


def without_axes(law: Any) -> Any:
    return law.elastic if isinstance(law, Oriented) else law


def with_axes_of(other: Any, law: Any) -> Any:
    return Oriented(law, other.place) if isinstance(other, Oriented) else law


@laws.initial_state.on(Oriented)
def _initial_state_oriented(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template), ())


# Functions are wrapped without laws.deformation, as F of the inner law is different.
laws.wraps(Oriented, "elastic", "elastic", (*ELASTIC, laws.with_stress))
laws.answers(Oriented, {has_short_trials: True, laws.is_round: False})


class AxisShown(NamedTuple):
    """Output column: a component of the present direction of axis 1, a line of the body."""

    index: int


@laws.shown.on(AxisShown)
def _shown_axis(tag, law, kin, state):
    a = state.elastic.F.at()
    line = [a[k, 0] for k in range(3) if (k, 0) in a]
    size = sqrt(total([x * x for x in line]))
    return (line[tag.index] if tag.index < len(line) else size - size) / size


for _i, _letter in enumerate("xyz"):
    laws.column(Oriented, f"axis_{_letter}", AxisShown(_i))
