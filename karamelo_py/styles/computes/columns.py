"""Base of computes that compare fields of points: fields by name, curves in files."""

from __future__ import annotations

import re
from math import inf, isnan
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.output.point_table import AXES, COMPONENTS, PointTable
from karamelo_py.scene.domain import require_domain
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.terms import number_of

VECTORS = {"displacement": "u", "velocity": "v"}
TENSORS = {"stress": "s", "strain": "e"}
DISPLACEMENTS = ("ux", "uy", "uz")


def column(points: PointTable, name: str) -> np.ndarray:
    """A column of points, (n,), displacements too."""
    if name in DISPLACEMENTS:
        return points.particle(name[1]) - points.particle(name[1] + "0")
    return points.particle(name)


class PointField:
    """A field of points, by the columns it has.

    Attributes
    ----------
    name
        As the script says it.
    columns
        Names of its columns, one for a scalar.
    weights
        How often a component counts in the square of the size: shear components count twice.
    """

    script_kind = "a column of points, or displacement, velocity, stress or strain"

    def __init__(self, name: str, columns: tuple[str, ...]):
        self.name = name
        self.columns = columns
        shear = name in TENSORS
        self.weights = [2.0 if shear and k >= 3 else 1.0 for k in range(len(columns))]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> PointField:
        """The field that `argument` names."""
        known = [*hub.fields.particle_names(), *DISPLACEMENTS, *VECTORS, *TENSORS]
        name = argument.words(known)
        if name not in known:
            raise unknown(f"unknown field '{name}'", name, known, place=argument.place)
        return cls(name, columns_of(hub, name))


def columns_of(hub: Scene, name: str) -> tuple[str, ...]:
    """The columns of a field: components of vectors and tensors, a column as it is."""
    if name in VECTORS:
        d = require_domain(hub).dimension
        return tuple(VECTORS[name] + axis for axis in AXES[:d])
    if name in TENSORS:
        return tuple(TENSORS[name] + component for component in COMPONENTS)
    return (name,)


class Norm:
    """The size of a difference: L1, L2 or max, as it is or relative to what is right.

    Parameters
    ----------
    kind
        ``L1``, ``L2`` or ``max``.
    relative
        Whether it is divided by the same norm of the exact values.

    Notes
    -----
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

    def now(self, moment: np.ndarray) -> float:
        """The norm of differences as it is asked for, from both norms (2,)."""
        return self._scaled(*moment)

    def follow(self, time: float, moment: np.ndarray) -> float:
        """As `now`; `history` and `largest` take the moment in, once."""
        now = self.now(moment)
        if self._time is None or time > self._time:
            # The first state stands for itself until there is a second one.
            span = time - self._time if self._time is not None else 0.0
            power = {"L1": 1, "L2": 2, "max": inf}[self.kind]
            if power == inf:
                self._sums = np.maximum(self._sums, moment)
                self.history = self._scaled(*self._sums)
            else:
                self._duration += span
                self._sums += span * moment**power
                duration = self._duration or 1.0
                sums = self._sums if self._duration else moment**power
                self.history = self._scaled(*(sums / duration) ** (1 / power))
            self.largest = max(self.largest, now)
            self._time = time
        return now

    def _scaled(self, difference: float, exact: float) -> float:
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
        """Return the terms of the points for sums."""
        sizes, weight, *rest = self.sizes(points)
        return np.vstack([self.norm.terms(sizes, weight), *rest])

    def largest(self, points: PointTable) -> np.ndarray | None:
        """The largest difference and exact value of points."""
        sizes = self.sizes(points)[0]
        return sizes.max(axis=1) if sizes.size else None


def table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a file of numbers, by the names in its first row (or "1", "2", ...).

    Numbers are separated by commas, semicolons or blanks; a line that begins with # is a comment.

    Raises
    ------
    ScriptError
        If a row has too few numbers, or something is not a number.
    """
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            cells = re.split(r"\s*[,;\t]\s*" if re.search("[,;\t]", line) else r"\s+", line.strip())
            rows.append((number, [cell.strip('" ') for cell in cells]))
    if not rows:
        raise ScriptError(f"{path} has no rows", expected="columns of numbers", argument="file")
    names = rows[0][1]
    if any(number_of(cell) is not None for cell in names):
        names = [str(k + 1) for k in range(len(names))]
    else:
        rows = rows[1:]
    columns: list[list[float]] = [[] for _ in names]
    for number, cells in rows:
        values = [number_of(cell) for cell in cells]
        if len(values) != len(names) or None in values or any(map(isnan, values)):
            raise ScriptError(
                f"line {number} of {path}: {' '.join(cells)}",
                expected=f"{len(names)} numbers: {', '.join(names)}",
                argument="file",
            )
        for column, value in zip(columns, values, strict=True):
            column.append(value)
    return {name: np.array(column) for name, column in zip(names, columns, strict=True)}


def refuse_absent(hub: Any, columns: tuple[str, ...]) -> None:
    """A column that no material has cannot be wrong: comparing it is a mistake."""
    absent = [name for name in columns if name in hub.fields.absent_at_points()]
    if absent and hub.materials:
        raise ScriptError(
            f"'{absent[0]}' is 0 because no material of the scene has it",
            argument="field",
            expected="a column that the points have",
        )
