"""Balls with a force of depth squared."""

from typing import Annotated, Literal, Self

import numpy as np

from karamelo_py.kernels.tools import BySquare, PressSquare
from karamelo_py.language.arguments import NUMBER
from karamelo_py.language.signature import Argument, NonNegative
from karamelo_py.language.unknown import words_of
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.tools.base import BallTool


class Radius(Expression):
    """Script argument: the radius; scripts of 2020 have it after the centre."""

    script_kind = "a number or a formula above 0"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Self:
        radius = super().from_script(hub, argument)
        if radius.is_constant and not radius.constant > 0:
            ID, style, group, kind, K, *centre, R = words_of(argument.statement)
            line = ", ".join([ID, style, group, kind, K, R, *centre])
            message = f"the radius is {radius.constant:g}"
            zero = NUMBER.fullmatch(R) and not float(R) > 0
            hint = None if zero else f"with the radius in front of the centre: fix({line})"
            raise ScriptError(message, mark=argument.mark, expected="a number above 0", hint=hint)
        return radius


class Indent(BallTool):
    """Push points out of a ball (in 2D a disk) with a force that grows as depth squared.

    Parameters
    ----------
    K
        Acceleration of a point per squared depth, as a function of time.

    Example
    -------
    fix(ball, indent, all, sphere, 1e4, 0.2, 0.5, 1.2 - 0.1*time, 0)

    Notes
    -----
    A point at a distance r < R from the centre is pushed away from it with the force m K (R - r)^2
    (K (R - r)^2 in LAMMPS). Publishes the force on the points as ID_x, ID_y, ID_z and the number of
    pushed points as ID_s.

    See Also
    --------
    indent/minimize_penetration, impenetrablesurface
    """

    kind_of_press = PressSquare

    def __init__(
        self, hub: Hub, group: ParticleGroup, kind: Literal["sphere"],
        K: Annotated[Expression, NonNegative], R: Radius,
        x: Expression, y: Expression, z: Expression,
    ):  # fmt: skip
        super().__init__(hub, group)
        centre = self.of_time("", (x, y, z))
        self.push(BySquare(), K, R, *centre)
        c, domain = self.now(*centre), hub.domain
        past = np.maximum(domain.lo[: len(c)] - c, c - domain.hi[: len(c)]).max()
        if all(f.is_constant for f in (R, *centre)) and past > R.constant:
            hub.warn("the ball is outside the domain", hint="K and R come before x, y, z")

    def publish_load(self, points: PointsView, force: np.ndarray) -> None:
        super().publish_load(points, force)
        self.publish("s", points.total(force.any(axis=1)))
