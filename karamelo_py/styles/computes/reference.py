"""compute reference: how far a value or a field is from a curve in a file."""

import re
from math import isnan
from pathlib import Path
from typing import Literal

import numpy as np

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument, TableFile
from karamelo_py.output.point_table import PointTable
from karamelo_py.output.quantity import Quantity
from karamelo_py.scene.group import ALL, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError, nearest, unknown
from karamelo_py.script.terms import number_of
from karamelo_py.styles.computes.error import Compared, Norm, column, refuse_absent


def read_table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a file of numbers, by the names in its first row (or "1", "2", ...).

    Numbers are separated by commas, semicolons or blanks; a line that begins with # is a comment.
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
    table = []
    for number, cells in rows:
        values = [number_of(cell) for cell in cells]
        if len(values) != len(names) or None in values or any(map(isnan, values)):
            raise ScriptError(
                f"line {number} of {path}: {' '.join(cells)}",
                expected=f"{len(names)} numbers: {', '.join(names)}",
                argument="file",
            )
        table.append(values)
    columns = np.array(table, float).reshape(-1, len(names)).T
    return dict(zip(names, columns, strict=True))


class GroupOrValue:
    """For signatures: a group of points, or a number that changes in time."""

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
        A value (``v_x``, a variable, a formula of values) is compared over time; the points of a
        group, or ``all``, over a coordinate.
    file
        Columns of numbers, with commas, semicolons or blanks between them, and their names in the
        first row (or named 1, 2, ... where there is no such row); lines that begin with # are
        comments. The first column is the time or, for points, the coordinate, whose name it bears:
        x, y, z, x0, y0, z0 or any other column of points.
    column
        The column of the file to compare with; for points also the column of the points, such as
        s11 or vx.
    norm
        ``L1``, ``L2`` (without a word) or ``max``, and ``absolute`` (without a word) or
        ``relative``, in any order.

    Example
    -------
    compute(v, average_velocity, all)
    compute(tip, reference, v_x, measured.csv, velocity, max, relative)
    compute(profile, reference, all, exact.csv, s11)
    log_modify(custom, step, time, tip, tip_curve, profile)

    Notes
    -----
    The curve is linear between its rows. What lies beyond its ends is not compared.

    Of a value, ID is the norm of its difference over the time so far, each output with the time
    since the one before; ID_now is the difference now and ID_curve the curve now.
    Of points, ID is the norm over the points now, each with its volume at first, ID_now is the
    same, and ID_curve the mean of the curve at the points.

    See Also
    --------
    error
    """

    syntax = "group|value, file, column[, L1|L2|max][, absolute|relative]"
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
            raise unknown(f"{file} has no column '{name}'", name, columns, place=column.place)
        self.along, self.column = next(iter(columns)), name
        order = np.argsort(columns[self.along], kind="stable")
        self.curve = columns[self.along][order], columns[name][order]
        self.norm = Norm(norm)
        if self.points:
            self._check_columns(hub, file, column)

    def _check_columns(self, hub: Hub, file: TableFile, column: Argument) -> None:
        known = [*hub.fields.particle_names(), "ux", "uy", "uz"]
        for name in (self.along, self.column):
            if name not in known:
                close = nearest(name, known)
                raise ScriptError(
                    f"points have no column '{name}'",
                    place=column.place,
                    expected=f"in {file} the coordinate first, then columns named as those of a "
                    f"dump: {' '.join(known)}",
                    hint=f"name it '{close}' in the file" if close else None,
                )
        refuse_absent(hub, (self.column,))

    def refresh(self) -> None:
        if self.points:
            moment, (total, count) = self.measured()
            now = self.norm.scaled(*moment)
            self.publish("", now)
            self.publish("now", now)
            self.publish("curve", total / count if count else 0.0)
            return
        time = self.hub.update.time
        within, exact = self._exact(np.array([time]))
        if within.any():
            difference = float(self.subject.read()) - exact[0]
            sizes = np.abs([[difference], exact])
            self.norm.follow(
                time, self.norm.moment(self.norm.terms(sizes, np.ones(1))[:, 0], [sizes[:, 0]])
            )
            self.publish("", self.norm.history)
            self.publish("now", difference)
        self.publish("curve", exact[0] if within.any() else 0.0)

    def sizes(self, points: PointTable) -> tuple[np.ndarray, ...]:
        """Sizes (2, n) of differences and of the curve at points, weights; the curve, and one."""
        within, exact = self._exact(column(points, self.along))
        difference = column(points, self.column)[within] - exact
        sizes = np.abs([difference, exact])
        return sizes, points.reference_volume[within], exact, np.ones(len(exact))

    def _exact(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which places (n,) the curve covers, and its values there."""
        within = (at >= self.curve[0][0]) & (at <= self.curve[0][-1])
        return within, np.interp(at[within], *self.curve)
