"""Fix ground_motion."""

from math import isnan, nan

import numpy as np

from karamelo_py.kernels.equations.mass_momentum import Normal
from karamelo_py.language.rules import Restrictions
from karamelo_py.language.signature import Argument
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, per_direction, vector_hook
from karamelo_py.scene.tables import FileColumns
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression, applied
from karamelo_py.styles.fixes.absorbing import Absorbing, speeds
from karamelo_py.styles.fixes.edges import SIDES
from karamelo_py.styles.fixes.formulas import AXES
from karamelo_py.styles.fixes.velocity_nodes import Velocity, VelocityNodes

ENDINGS = (".csv", ".txt", ".dat", ".tsv")


def push_x(normal, force, values, dt):
    return pushed(0, normal, force, values)


def push_y(normal, force, values, dt):
    return pushed(1, normal, force, values)


def push_z(normal, force, values, dt):
    return pushed(2, normal, force, values)


def pushed(axis, normal, force, values):
    """Add the forces (rho A) c v on an edge normal to `axis`; `values` are the products c v."""
    added = type(force)(*[abs(normal[axis]) * values[k] for k in range(len(force))])
    return force + added, added


PUSHES = [
    vector_hook(f, reads=(Normal, "force"), writes=("force",), publishes=True, nodes=True)
    for f in (push_x, push_y, push_z)
]


class BaseAcceleration:
    script_kind = "a formula of time, or the name of a file with the columns time and acceleration"

    def __init__(self, hub: Hub, formula: Expression):
        self.hub, self.formula, self.text = hub, formula, formula.text
        self.is_constant = formula.is_constant
        self.constant = formula.constant if self.is_constant else nan

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "BaseAcceleration":
        text = argument.text.strip("\"'")
        if text.lower().endswith(ENDINGS) or text in hub.functions:
            return RecordedAcceleration(FileColumns.from_script(hub, argument), argument)
        formula = Expression.from_script(hub, argument)
        if others := formula.names - {"time"}:
            raise ScriptError(
                f"the acceleration depends on {min(others)}",
                mark=argument.mark,
                expected=cls.script_kind,
            )
        return BaseAcceleration(hub, formula)

    def take(self, axis: str) -> None:
        """Choose the column of the record for a direction."""

    def motion(self, time: float, step: float, before: tuple[float, float]) -> tuple:
        """Return velocity, acceleration, and the rate of the acceleration in `step`.

        `before` is an earlier time and the velocity at that time.
        """
        since, speed = before
        at = np.array([since, (since + time) / 2, time, time + step])
        a = self.formula.evaluate_columns(self.hub.values, {"time": at})
        speed += (time - since) * (a[0] + 4 * a[1] + a[2]) / 6  # Simpson's rule
        return float(speed), float(a[2]), float((a[3] - a[2]) / step if step > 0 else 0.0)


class RecordedAcceleration(BaseAcceleration):
    """A record in a file, interpolated linearly in time."""

    is_constant, constant = False, nan

    def __init__(self, table: FileColumns, argument: Argument):
        self.table, self.text = table, argument.text
        first, *others = (np.asarray(column, float) for column in table.columns.values())
        if not others or len(first) < 2 or (np.diff(first) <= 0).any():
            raise ScriptError(
                f"{table.name} is not a record: its columns are {', '.join(table.columns)}",
                mark=argument.mark,
                expected="rows of increasing time, and acceleration",
            )
        self.times = first

    def take(self, axis: str) -> None:
        names = [*self.table.columns]
        named = [name for name in names if name in (f"a{axis}", axis)]
        self.values = np.asarray(self.table.columns[[*named, names[1]][0]], float)
        pieces = np.diff(self.times) * (self.values[1:] + self.values[:-1]) / 2
        self.speeds = np.concatenate([[0.0], np.cumsum(pieces)])

    def motion(self, time: float, step: float, before: tuple[float, float]) -> tuple:
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        if k < 0:
            return 0.0, 0.0, 0.0
        if k >= len(self.times) - 1:
            return float(self.speeds[-1]), 0.0, 0.0
        rate = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
        gone = time - self.times[k]
        speed = self.speeds[k] + gone * (self.values[k] + rate * gone / 2)
        return float(speed), float(self.values[k] + rate * gone), float(rate)


class GroundMotion(VelocityNodes):
    """Shake the base of the ground by a record of acceleration, as in an earthquake.

    Parameters
    ----------
    acceleration
        ax, ay, az, one per dimension: a formula of time, or a file with the columns time and
        acceleration (if it has several, the columns named ax, ay, az). NULL: free direction.
    through
        ID of a fix absorbing of the same nodes, for a compliant base. By default the base is rigid
        and its nodes have the velocity of the record.

    Example
    -------
    fix(quake, ground_motion, base, 3*sin(20*time), NULL)

    Notes
    -----
    Accelerations from a file are interpolated linearly in time and 0 after the last row.
    Accelerations are integrated from rest; if the final velocity of the record is not 0, the base
    remains in motion. A rigid base reflects all waves that reach it.

    With `through`, waves enter and leave through the edge. The record is then the outcrop motion of
    rock, twice the incoming wave (Joyner & Chen 1975): its velocity v is applied as the traction
    rho c v, with the material of fix absorbing, which is exact at normal incidence.

    Publishes the force on the nodes as ID_x, ID_y, ID_z, and velocity and acceleration of the
    record as ID_vx, ID_ax and so on.

    See Also
    --------
    absorbing, velocity_nodes
    """

    syntax = "group, ax[, ay[, az]][, through=fixID]"
    published = ("x", "y", "z", "since", *(f"{of}{axis}" for of in "vaj" for axis in AXES))
    reads_itself = True
    every = 1
    remembers = ("before",)
    restrictions = Restrictions(
        "ground_motion", "no ground_motion", without=("gpu", "implicit", "semi-implicit")
    )

    def __init__(
        self,
        hub: Hub,
        group: NodeGroup,
        *acceleration: BaseAcceleration | None,
        through: str | None = None,
    ):
        self.records = per_direction(hub, "a", acceleration)
        # `defined` makes the formulas, when the fix has its ID.
        unknown = [record and Velocity(Expression.seed("time")) for record in self.records]
        if through is None:
            super().__init__(hub, group, *unknown)
        else:
            Fix.__init__(self, hub, group)
            self._let_in(hub, through)
        self.before = [(hub.update.time, 0.0)] * len(self.records)
        for axis, record in zip(AXES, self.records, strict=False):
            if record is not None:
                record.take(axis)

    def _let_in(self, hub: Hub, through: str) -> None:
        edge = hub.fixes[through]
        if not isinstance(edge, Absorbing):
            message = f"fix '{through}' is a fix {edge.style}"
            raise ScriptError(message, argument="through", expected="a fix absorbing")
        axis = SIDES.index(edge.side) // 2
        self.edge, self.node_fields = edge, (Normal,)
        self.prescribes_velocity, self.bound = False, "through"
        fast, slow = speeds(edge.material)
        self.factors = [fast if k == axis else slow for k in range(hub.domain.dimension)]
        self.post_particles_to_grid = PUSHES[axis]

    def defined(self) -> None:
        self.formulas = tuple(
            None if record is None else self._velocity(axis)
            for axis, record in zip(AXES, self.records, strict=False)
        )
        if self.prescribes_velocity:
            super().defined()
        else:
            self.formulas = tuple(
                Expression(0.0) if v is None else applied("*", Expression(c), v)
                for c, v in zip(self.factors, self.formulas, strict=True)
            )
        self.between_steps()

    def _velocity(self, axis: str) -> Expression:
        """Return the velocity v + s (a + s j/2) with s = time - since."""
        v, a, j, since = (Expression.seed(f"{self.id}_{x}") for x in
                          (f"v{axis}", f"a{axis}", f"j{axis}", "since"))  # fmt: skip
        gone = Expression.seed("time").minus(since)
        rate = applied("*", applied("*", Expression(0.5), j), gone)
        return applied("+", v, applied("*", gone, applied("+", a, rate)))

    def between_steps(self) -> bool:
        time, step = self.hub.update.time, self.hub.update.dt
        step = 0.0 if isnan(step) else step
        self.publish("since", time)
        for k, record in enumerate(self.records):
            if record is not None:
                motion = record.motion(time, step, self.before[k])
                self.before[k] = time, motion[0]
                for of, value in zip("vaj", motion, strict=True):
                    self.publish(f"{of}{AXES[k]}", value)
        return False
