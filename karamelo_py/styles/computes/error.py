"""compute error: how far a field of points is from a formula."""

from __future__ import annotations

from math import inf
from typing import Any, Literal

import numpy as np

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.output.point_table import AXES, COMPONENTS, PointTable
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.expressions import Expression

VECTORS = {"displacement": "u", "velocity": "v"}
TENSORS = {"stress": "s", "strain": "e"}
DISPLACEMENTS = ("ux", "uy", "uz")


def column(points: PointTable, name: str) -> np.ndarray:
    """A column of points, (n,), displacements too."""
    if name in DISPLACEMENTS:
        return points.particle(name[1]) - points.particle(name[1] + "0")
    return points.particle(name)


class PointField:
    """A field of points: its name in the script, and its columns, one for a scalar.

    `weights` say how often a component counts in the square of the size: shear components twice.
    """

    script_kind = "a column of points, or displacement, velocity, stress or strain"

    def __init__(self, name: str, columns: tuple[str, ...]):
        self.name = name
        self.columns = columns
        shear = name in TENSORS
        self.weights = [2.0 if shear and k >= 3 else 1.0 for k in range(len(columns))]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> PointField:
        known = [*hub.fields.particle_names(), *DISPLACEMENTS, *VECTORS, *TENSORS]
        name = argument.words(known)
        if name not in known:
            raise unknown(f"unknown field '{name}'", name, known, place=argument.place)
        if name in VECTORS:
            d = require_domain(hub).dimension
            return cls(name, tuple(VECTORS[name] + axis for axis in AXES[:d]))
        if name in TENSORS:
            return cls(name, tuple(TENSORS[name] + component for component in COMPONENTS))
        return cls(name, (name,))


class Norm:
    """The size of a difference: L1, L2 or max, as it is or relative to the same norm of the exact.

    Over a history the time since the last output weighs a difference, so that a history does not
    depend on how often it is looked at.
    """

    remembers = ("_sums", "_duration", "_time", "history", "largest")

    def __init__(self, words: tuple[str, ...] = ()):
        kinds = [word for word in words if word in ("L1", "L2", "max")]
        scales = [word for word in words if word in ("absolute", "relative")]
        if len(kinds) > 1 or len(scales) > 1:
            one, other = kinds[:2] if len(kinds) > 1 else scales[:2]
            raise ScriptError(
                f"both {one} and {other}",
                expected="one norm (L1, L2, max) and one scale (absolute, relative)",
            )
        self.kind = kinds[0] if kinds else "L2"
        self.relative = scales == ["relative"]
        self._sums = np.zeros(2)
        self._duration = 0.0
        self._time: float | None = None
        self.history = 0.0
        self.largest = 0.0

    def terms(self, sizes: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return the terms of a norm from the sizes (2, n) of differences and exact values."""
        return np.vstack([weight * sizes ** (2 if self.kind == "L2" else 1), weight])

    def moment(self, sums: np.ndarray, largest: list[np.ndarray]) -> np.ndarray:
        """The norms (2,) of differences and exact values from sums, and the largest of some."""
        if self.kind == "max":
            return np.max([np.zeros(2), *largest], axis=0)
        mean = sums[:2] / sums[2] if sums[2] else np.zeros(2)
        return mean if self.kind == "L1" else np.sqrt(mean)

    def follow(self, time: float, moment: np.ndarray) -> float:
        """As `scaled`; `history` and `largest` take the moment in, once."""
        now = self.scaled(*moment)
        if self._time is not None and time <= self._time:
            return now
        if self.kind == "max":
            self._sums = np.maximum(self._sums, moment)
            self.history = self.scaled(*self._sums)
        else:
            power = 1 if self.kind == "L1" else 2
            # The first state stands for itself until there is a second one.
            span = time - self._time if self._time is not None else 0.0
            self._duration += span
            self._sums += span * moment**power
            sums = self._sums / self._duration if self._duration else moment**power
            self.history = self.scaled(*sums ** (1 / power))
        self.largest = max(self.largest, now)
        self._time = time
        return now

    def scaled(self, difference: float, exact: float) -> float:
        """The norm as it is asked for, from that of differences and that of exact values."""
        if not self.relative or difference == 0:
            return float(difference)
        return float(difference / exact) if exact else inf


class Compared:
    """Mixed into computes that compare points: says `sizes(points)`, and has a `norm`."""

    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Norms (2,) of differences and exact values now, and other sums."""
        sums = self.hub.fields.added_up(self)
        largest = self.hub.fields.each(self, "largest") if self.norm.kind == "max" else []
        return self.norm.moment(sums, largest), sums[3:]

    def terms(self, points: PointTable) -> np.ndarray:
        sizes, weight, *rest = self.sizes(points)
        return np.vstack([self.norm.terms(sizes, weight), *rest])

    def largest(self, points: PointTable) -> np.ndarray | None:
        sizes = self.sizes(points)[0]
        return sizes.max(axis=1) if sizes.size else None


def refuse_absent(hub: Any, columns: tuple[str, ...]) -> None:
    """A column that no material has cannot be wrong: comparing it is a mistake."""
    absent = [name for name in columns if name in hub.fields.absent_at_points()]
    if absent and hub.materials:
        raise ScriptError(
            f"'{absent[0]}' is 0 because no material of the scene has it",
            argument="field",
            expected="a column that the points have",
        )


class Error(Compared, Compute):
    """Measure the difference between a field of points and an exact solution.

    Parameters
    ----------
    field
        A column of a dump (x, vy, s11, T, ...), ux, uy, uz (displacement by component), or a whole
        field: ``displacement``, ``velocity``, ``stress``, ``strain``.
    expression
        The exact value: a formula of x, y, z (present position), x0, y0, z0 (first position), time,
        and published values. For a whole field one for each component, as many as are known, in the
        order x, y, z or 11, 22, 33, 12, 13, 23; NULL leaves a component out. Then, in any order,
        the norm, ``L1``, ``L2`` (without a word) or ``max``, and ``absolute`` (without a word) or
        ``relative``.

    Example
    -------
    compute(err, error, all, ux, 0.01*sin(PI*x0/2)*cos(3*time), L2)
    compute(far, error, all, velocity, 0.1*x0, NULL, max, relative)
    log_modify(custom, step, time, err, err_history, far)

    Notes
    -----
    With e the length of the difference at a point (of a tensor: sqrt(e_ij e_ij)) and V0 the volume
    of the point at first: L1 = sum V0 e / sum V0, L2 = sqrt(sum V0 e^2 / sum V0), max = max e.
    ``relative`` divides by the same norm of the exact values; where they vanish, the result is inf.

    Publishes ID, the error now; ID_max, the largest of the outputs so far; and ID_history, the same
    norm over points and over all time so far (relative: of the whole history, so that moments at
    which the exact values vanish do no harm). An output counts with the time since the one before.

    See Also
    --------
    reference, fix check_solution
    """

    syntax = "group, field, expression[, expression ...][, L1|L2|max][, absolute|relative]"
    published = ("", "max", "history")
    remembers = ("norm",)

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        field: PointField,
        *expression: Literal["L1", "L2", "max", "absolute", "relative"] | Expression | None,
    ):
        super().__init__(hub, group)
        refuse_absent(hub, field.columns)
        words = tuple(item for item in expression if isinstance(item, str))
        formulas = [item for item in expression if not isinstance(item, str)]
        if not any(formulas) or len(formulas) > len(field.columns):
            wanted = ", ".join(field.columns)
            raise ScriptError(
                f"{len(formulas)} formula{'s' * (len(formulas) != 1)} for {field.name}",
                expected=f"an expression for {'each of ' * (len(field.columns) > 1)}{wanted}",
            )
        pairs = zip(field.columns, field.weights, formulas, strict=False)
        self.parts = [part for part in pairs if part[2] is not None]
        self.norm = Norm(words)

    def refresh(self) -> None:
        now = self.norm.follow(self.hub.update.time, self.measured()[0])
        self.publish("", now)
        self.publish("max", self.norm.largest)
        self.publish("history", self.norm.history)

    def sizes(self, points: PointTable) -> tuple[np.ndarray, np.ndarray]:
        """Sizes (2, n) of the differences and of the exact values at points, and their weights."""
        x, x0 = points.position, points.reference_position
        squares = np.zeros((2, points.count))
        for name, weight, formula in self.parts:
            exact = formula.evaluate_points(self.hub.values, x, x0)
            squares += weight * np.stack([column(points, name) - exact, exact]) ** 2
        return np.sqrt(squares), points.reference_volume
