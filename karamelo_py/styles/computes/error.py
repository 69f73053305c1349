"""Computes error and reference: compare values or fields with formulas or curves."""

from math import inf
from typing import Any, Literal

import numpy as np

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument, TableFile
from karamelo_py.output.point_table import AXES, COMPONENTS, PointTable
from karamelo_py.output.quantity import Quantity
from karamelo_py.scene.group import ALL, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.expressions import Expression

VECTORS = {"displacement": "u", "velocity": "v"}
TENSORS = {"stress": "s", "strain": "e"}
DISPLACEMENTS = ("ux", "uy", "uz")
VANISHED = 1e-9  # norms below this fraction of the largest exact norm so far are round-off


def column(points: PointTable, name: str) -> np.ndarray:
    if name in DISPLACEMENTS:
        return points.particle(name[1]) - points.particle(name[1] + "0")
    return points.particle(name)


class PointField:
    script_kind = "a column of points, or displacement, velocity, stress or strain"

    def __init__(self, name: str, columns: tuple[str, ...]):
        self.name = name
        self.columns = columns
        self.weights = [2.0 if name in TENSORS and k >= 3 else 1.0 for k in range(len(columns))]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "PointField":
        fields = [*hub.fields.particle_names(), *DISPLACEMENTS, *VECTORS, *TENSORS]
        name = argument.words(fields)
        if name not in fields:
            raise unknown(f"unknown field '{name}'", name, fields, mark=argument.mark)
        ends = AXES[: hub.require_domain().dimension] if name in VECTORS else COMPONENTS
        letter = (VECTORS | TENSORS).get(name)
        return cls(name, tuple(letter + end for end in ends) if letter else (name,))


class Norm:
    """Norm L1, L2 or max, absolute or relative to the norm of the exact values.

    In histories, differences are weighted by the time since the previous output, so the frequency
    of outputs has no effect.
    """

    remembers = ("_sums", "_duration", "_time", "history", "largest", "_exact")

    def __init__(self, words: tuple[str, ...] = ()):
        scales = [word for word in words if word in ("absolute", "relative")]
        kinds = [word for word in words if word not in scales]
        for some in (kinds, scales):
            if len(some) > 1:
                raise ScriptError(
                    f"both {some[0]} and {some[1]}",
                    expected="one norm (L1, L2, max) and one scale (absolute, relative)",
                )
        self.kind = kinds[0] if kinds else "L2"
        self.power = 2 if self.kind == "L2" else 1
        self.relative = scales == ["relative"]
        self._sums = np.zeros(2)
        self._duration = 0.0
        self._time: float | None = None
        self.history = 0.0
        self.largest = 0.0
        self._exact = 0.0

    def terms(self, sizes: np.ndarray, weight: np.ndarray) -> np.ndarray:
        return np.vstack([weight * sizes**self.power, weight])

    def moment(self, sums: np.ndarray, largest: list[np.ndarray]) -> np.ndarray:
        if self.kind == "max":
            return np.max([np.zeros(2), *largest], axis=0)
        mean = sums[:2] / sums[2] if sums[2] else np.zeros(2)
        return mean if self.kind == "L1" else np.sqrt(mean)

    def follow(self, time: float, moment: np.ndarray) -> float:
        """Return the present norm (see `scaled`); at a new output, update history and maximum."""
        difference, exact = moment
        self._exact = max(self._exact, exact)
        now = self.scaled(difference, exact if exact > VANISHED * self._exact else self._exact)
        if self._time is not None and time <= self._time:
            return now
        if self.kind == "max":
            self._sums = mean = np.maximum(self._sums, moment)
        else:
            # The first output has no preceding interval; its norm is used until the second output.
            span = time - self._time if self._time is not None else 0.0
            self._duration += span
            self._sums += span * moment**self.power
            mean = self._sums / self._duration if self._duration else moment**self.power
        self.history = self.scaled(*mean ** (1 / self.power))
        self.largest = max(self.largest, now)
        self._time = time
        return now

    def scaled(self, difference: float, exact: float) -> float:
        if not self.relative or difference == 0:
            return float(difference)
        return float(difference / exact) if exact else inf


class Compared:
    """Mix-in of computes with `sizes(points)` and a `norm`."""

    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Return norms (2,) of differences and exact values, and the other sums of `sizes`."""
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
    absent = [name for name in columns if name in hub.fields.absent_at_points()]
    if absent and hub.materials:
        message = f"'{absent[0]}' is 0 because no material of the scene has it"
        raise ScriptError(message, argument="field", expected="a column that the points have")


class Error(Compared, Compute):
    """Measure the difference between a field of points and an exact solution.

    Parameters
    ----------
    field
        A column of a dump (x, vy, s11, T, ...), a displacement ux, uy or uz, or a whole field:
        ``displacement``, ``velocity``, ``stress``, ``strain``.
    expression
        The exact value, a function of x, y, z (present position), x0, y0, z0 (initial position),
        time, and published values. For a whole field, one function per component, in the order x,
        y, z or 11, 22, 33, 12, 13, 23; NULL omits a component. After these, in any order, the norm
        (``L1``, ``L2`` (default) or ``max``), and ``absolute`` (default) or ``relative``.

    Example
    -------
    compute(err, error, all, ux, 0.01*sin(PI*x0/2)*cos(3*time), L2)
    compute(far, error, all, velocity, 0.1*x0, NULL, max, relative)
    log_modify(custom, step, time, err, err_history, far)

    Notes
    -----
    Let e be the magnitude of the difference at a point (for a tensor sqrt(e_ij e_ij)) and V0 the
    initial volume of the point: L1 = sum V0 e / sum V0, L2 = sqrt(sum V0 e^2 / sum V0), max = max
    e. ``relative`` divides by the same norm of the exact values. While all exact values are 0, it
    divides by the largest norm so far; if that is 0, too, the result is inf.

    Publishes ID, the present error; ID_max, the largest error so far; and ID_history, the norm over
    all points and outputs so far, with each output weighted by the time since the previous output.
    With ``relative``, ID_history is the norm of all differences / norm of all exact values,
    so exact values may be 0 at times.

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
        self.parts = [(name, weight, f) for name, weight, f in pairs if f is not None]
        self.norm = Norm(words)

    def refresh(self) -> None:
        now = self.norm.follow(self.hub.update.time, self.measured()[0])
        self.publish_all(now, self.norm.largest, self.norm.history)

    def sizes(self, points: PointTable) -> tuple[np.ndarray, np.ndarray]:
        x, x0 = points.position, points.reference_position
        squares = np.zeros((2, points.count))
        for name, weight, formula in self.parts:
            exact = formula.evaluate_points(self.hub.values, x, x0)
            squares += weight * np.stack([column(points, name) - exact, exact]) ** 2
        return np.sqrt(squares), points.reference_volume


class GroupOrValue:
    script_kind = "a group of points, or a value"

    @staticmethod
    def from_script(hub: Scene, argument: Argument) -> ParticleGroup | Quantity:
        name = argument.text.strip().strip('"')
        if name == ALL or name in hub.groups:
            return ParticleGroup.from_script(hub, argument)
        return Quantity.from_script(hub, argument)


class Reference(Compared, Compute):
    """Measure the difference between a value or a field of points and a curve in a file.

    Parameters
    ----------
    subject
        A value (``v_x``, a variable, a formula), compared as a function of time, or a group of
        points, compared as a function of a coordinate.
    file
        Columns separated by commas, semicolons or blanks, with names in the first row (else 1, 2,
        ...); # begins a comment line. The first column is the time, or for points a
        coordinate or another column of points, such as x, y0 or T.
    column
        The column of the file to compare with. For points, the name must also be a column of
        points, such as s11 or vx.
    norm
        At most one of ``L1``, ``L2`` (default) and ``max``, and one of ``absolute`` (default) and
        ``relative``, in any order.

    Example
    -------
    compute(v, average_velocity, all)
    compute(tip, reference, v_x, measured.csv, velocity, max, relative)
    compute(profile, reference, all, exact.csv, s11)
    log_modify(custom, step, time, tip, tip_curve, profile)

    Notes
    -----
    The curve is linear between its rows. Values beyond its ends are not compared.

    For a value, ID is the norm of the difference over all outputs so far, each weighted by the time
    since the previous output; ID_now is the present difference and ID_curve the present value of
    the curve. For points, ID and ID_now are the present norm, weighted by initial volumes, and
    ID_curve is the mean of the curve at the points.

    See Also
    --------
    error
    """

    syntax = "subject, file, column[, L1|L2|max][, absolute|relative]"
    published = ("", "now", "curve")
    remembers = ("norm",)

    def __init__(
        self,
        hub: Hub,
        subject: GroupOrValue,
        file: TableFile,
        column: Argument,
        *norm: Literal["L1", "L2", "max", "absolute", "relative"],
    ):
        self.points = isinstance(subject, ParticleGroup)
        super().__init__(hub, subject if self.points else None)
        self.subject = subject
        columns = read_table(file)
        name = column.text.strip('"')
        if name not in columns:
            raise unknown(f"{file} has no column '{name}'", name, columns, mark=column.mark)
        self.along, self.column = next(iter(columns)), name
        order = np.argsort(columns[self.along], kind="stable")
        self.curve = columns[self.along][order], columns[name][order]
        self.norm = Norm(norm)
        if self.points:
            self._check_columns(hub, file, column)

    def _check_columns(self, hub: Hub, file: TableFile, column: Argument) -> None:
        columns = [*hub.fields.particle_names(), "ux", "uy", "uz"]
        for name in (self.along, self.column):
            if name not in columns:
                hint = f"in {file} the coordinate first, then columns named as in dumps"
                message = f"points have no column '{name}'"
                raise unknown(message, name, columns, hint, mark=column.mark)
        refuse_absent(hub, (self.column,))

    def refresh(self) -> None:
        if self.points:
            moment, (total, count) = self.measured()
            norm = now = self.norm.scaled(*moment)
            curve = total / count if count else 0.0
        else:
            time = self.hub.update.time
            within, exact = self._exact(np.array([time]))
            if not within.any():
                self.publish("curve", 0.0)
                return
            curve = exact[0]
            now = float(self.subject.read()) - curve
            self.norm.follow(time, np.abs([now, curve]))
            norm = self.norm.history
        self.publish_all(norm, now, curve)

    def sizes(self, points: PointTable) -> tuple[np.ndarray, ...]:
        """Return magnitudes (2, n) of differences and curve; weights, curve, and ones (n,)."""
        within, exact = self._exact(column(points, self.along))
        difference = column(points, self.column)[within] - exact
        sizes = np.abs([difference, exact])
        return sizes, points.reference_volume[within], exact, np.ones(len(exact))

    def _exact(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        within = (at >= self.curve[0][0]) & (at <= self.curve[0][-1])
        return within, np.interp(at[within], *self.curve)
