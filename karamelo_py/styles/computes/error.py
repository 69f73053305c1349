"""compute error: how far a field of points is from a formula."""

from typing import Literal

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.computes.columns import Compared, Norm, PointField, column, refuse_absent


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
        """Measure and publish."""
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
