"""Fixes of rigid tools: balls, a wedge, a turning cylinder."""

from typing import Annotated, Literal

import numpy as np

from karamelo_py.language.signature import Argument, NonNegative
from karamelo_py.language.unknown import words_of
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import judge_friction, per_direction
from karamelo_py.styles.fixes.tools import (
    ToolFix,
    apart,
    face_of,
    rubbed,
    side_of,
    stiffness_of,
)


class Radius(Expression):
    """For signatures: a radius above 0, which Karamelo had behind the centre in 2020."""

    script_kind = "a number or a formula above 0"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Expression:
        radius = super().from_script(hub, argument)
        if radius.is_constant and not radius.constant > 0:
            ID, style, group, kind, K, *centre, R = words_of(argument.statement)
            line = ", ".join([ID, style, group, kind, K, R, *centre])
            raise ScriptError(
                f"the radius is {radius.constant:g}",
                place=argument.place,
                expected="a number above 0",
                hint=f"with the radius in front of the centre: fix({line})",
            )
        return radius


class Indent(ToolFix):
    """Push points out of a ball (in the plane a disk) with a force that grows as depth squared.

    Parameters
    ----------
    kind
        The word ``sphere``.
    K
        Acceleration per depth squared: a number or a formula of time.
    R
        Radius of the ball: a number or a formula of time.
    x, y, z
        Its centre: numbers or formulas of time; z is 0 in the plane.

    Example
    -------
    fix(ball, indent, all, sphere, 1e4, 0.2, 0.5, 1.2 - 0.1*time, 0)

    Notes
    -----
    A point at the distance r < R from the centre gets the force m K (R - r)^2 away from it, as
    ``fix indent`` of LAMMPS has it, but per mass. Publishes the force on the points as ID_x, ID_y,
    ID_z and the number of those that it pushes as ID_s.

    See Also
    --------
    indent/minimize_penetration, impenetrablesurface
    """

    published = ("x", "y", "z", "s")

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        kind: Literal["sphere"],
        K: Annotated[Expression, NonNegative],
        R: Radius,
        x: Expression,
        y: Expression,
        z: Expression,
    ):
        super().__init__(hub, group)
        self.K, self.R = K, R
        self.centre = per_direction(hub, "", (x, y, z))

    def forces(self, points: PointsView) -> np.ndarray:
        K, R = self.now((self.K, self.R))
        away = points.position.astype(float) - self.now(self.centre)
        r = np.linalg.norm(away, axis=1)
        depth = np.maximum(R - r, 0)
        self.publish("s", points.total(depth > 0))
        push = points.mass.astype(float) * K * depth**2
        size = np.divide(push, r, out=np.zeros_like(r), where=r > 0)
        return size[:, None] * away


class IndentMinimizePenetration(ToolFix):
    """Press a rigid ball (in the plane a disk) into points, as stiffly as the step allows.

    Parameters
    ----------
    kind
        The word ``sphere``.
    R
        Radius of the ball: a number or a formula of time.
    x, y, z
        Its centre: numbers or formulas of time; z is 0 in the plane.
    vx, vy, vz
        Its velocity, which friction needs: the centre does not follow from it.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(ball, indent/minimize_penetration, all, sphere, 0.2, 0.5, 1.2 - time, 0, 0, -1, 0, 0.1)

    Notes
    -----
    Points are balls, too, with the radius rp of half the side of a cube of their present volume.
    Where one reaches p = R + rp - r into the ball, r from its centre, it gets the force m p / dt^2,
    which takes a free point out within one step. Friction is mu times that, along the slip, and at
    most what stops the slip (de Vaucorbeil & Nguyen 2021).

    Publishes the force on the points as ID_x, ID_y, ID_z and the area of contact, one face of the
    cube for each point that touches, as ID_s.

    See Also
    --------
    indent, contact/minimize_penetration/plane, contact/minimize_penetration
    """

    published = ("x", "y", "z", "s")

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        kind: Literal["sphere"],
        R: Annotated[Expression, NonNegative],
        x: Expression,
        y: Expression,
        z: Expression,
        vx: Expression,
        vy: Expression,
        vz: Expression,
        mu: Annotated[float, NonNegative],
    ):
        super().__init__(hub, group)
        self.R, self.mu = R, mu
        judge_friction(hub, mu)
        self.centre = per_direction(hub, "", (x, y, z))
        self.velocity = per_direction(hub, "v", (vx, vy, vz))

    def forces(self, points: PointsView) -> np.ndarray:
        (R,) = self.now((self.R,))
        away = points.position.astype(float) - self.now(self.centre)
        r = np.linalg.norm(away, axis=1, keepdims=True)
        normal = np.divide(away, r, out=np.zeros_like(away), where=r > 0)
        side = side_of(self.hub, points)
        depth = R + side / 2 - r[:, 0]
        self.publish("s", points.total(face_of(self.hub, points, side) * (depth > 0)))
        push = apart(points, depth, normal)
        return push + rubbed(points, push, normal, self.now(self.velocity), self.mu)


class CuttingTool(ToolFix):
    """Push points out of the tip of a rigid tool, in the plane.

    Parameters
    ----------
    K
        Stiffness of the tool in shear moduli of the point: a number or a formula of time.
    x_tip, y_tip, z_tip
        The tip: numbers or formulas of time; z is 0.
    vx, vy, vz
        Its velocity, which scripts of Karamelo give; there is no friction that would need it.
    xA, yA, xB, yB
        A point on each of the two faces that meet in the tip: numbers or formulas of time.

    Example
    -------
    fix(tool, cuttingtool, all, 1, 1 - time, 0.5, 0, -1, 0, 0, 1.1 - time, 0.9, 1.4 - time, 0.55)

    Notes
    -----
    The tool is what lies between the two faces. A point in it, at the depth p from the nearer face,
    gets the force K G (1 - D) p out of that face, with the shear modulus G and the damage D of its
    material (de Vaucorbeil & Nguyen 2021). Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    impenetrablesurface, meldtool
    """

    needs_stiffness = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        K: Annotated[Expression, NonNegative],
        x_tip: Expression,
        y_tip: Expression,
        z_tip: Expression,
        vx: Expression,
        vy: Expression,
        vz: Expression,
        xA: Expression,
        yA: Expression,
        xB: Expression,
        yB: Expression,
    ):
        super().__init__(hub, group)
        if hub.domain.dimension != 2:
            raise ScriptError("the tool is one in the plane", expected="a domain in 2D")
        self.K = K
        self.tip = per_direction(hub, "", (x_tip, y_tip, z_tip))
        self.ends = (xA, yA), (xB, yB)
        if not hub.rehearsing:  # which does not know all numbers
            self._faces()

    def _faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (2, 2) out of the tool, of the faces to A and to B, and the tip."""
        tip = self.now(self.tip)
        a, b = (self.now(end) - tip for end in self.ends)
        turn = a[0] * b[1] - a[1] * b[0]
        if not abs(turn) > 0:
            raise ScriptError("tip, A and B lie in one line", expected="two faces with an angle")
        # Turned away from the other face.
        normals = np.array([[a[1], -a[0]], [-b[1], b[0]]]) * np.sign(turn)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True), tip

    def forces(self, points: PointsView) -> np.ndarray:
        (K,) = self.now((self.K,))
        normals, tip = self._faces()
        depths = (tip - points.position.astype(float)) @ normals.T
        nearer = depths.argmin(axis=1)
        depth = np.maximum(depths.min(axis=1), 0)
        return (K * stiffness_of(self.hub, points) * depth)[:, None] * normals[nearer]


class MeldTool(ToolFix):
    """Push points out of the tool of additive friction stir deposition, in space.

    Parameters
    ----------
    K
        Stiffness of the tool in shear moduli of the point, times a length: a number or a formula of
        time, as are all that follow.
    axis
        The word x, y or z: the direction of the axis.
    half_width
        Half the width of the square channel along the axis.
    c1, c2
        The axis in the other two directions, in the order x, y, z.
    theta
        Angle by which the tool has turned, from the first of these directions to the second.
    lo, hi
        Ends of the tool along the axis; points are pushed out at the lower one.
    Rmax
        Radius of the tool.

    Example
    -------
    fix(tool, meldtool, all, 1, y, 0.1, 0.5, 0.5, 10*time, 0.6, 1, 0.3)

    Notes
    -----
    The tool is a cylinder without its channel. A point in it gets the force K G (1 - D) times the
    shortest way out: into the channel, out of the cylinder, or below its end; G is the shear
    modulus and D the damage. Publishes the force on the points as ID_x, ID_y, ID_z.

    See Also
    --------
    cuttingtool, impenetrablesurface
    """

    needs_stiffness = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        K: Annotated[Expression, NonNegative],
        axis: Literal["x", "y", "z"],
        half_width: Annotated[Expression, NonNegative],
        c1: Expression,
        c2: Expression,
        theta: Expression,
        lo: Expression,
        hi: Expression,
        Rmax: Annotated[Expression, NonNegative],
    ):
        super().__init__(hub, group)
        if hub.domain.dimension != 3:
            raise ScriptError("the tool is one in space", expected="a domain in 3D")
        self.numbers = (K, half_width, c1, c2, theta, lo, hi, Rmax)
        self.along = "xyz".index(axis)
        self.across = [k for k in range(3) if k != self.along]

    def forces(self, points: PointsView) -> np.ndarray:
        K, w, c1, c2, theta, lo, hi, Rmax = self.now(self.numbers)
        x = points.position.astype(float)
        height, q = x[:, self.along] - lo, x[:, self.across] - np.array([c1, c2])
        r = np.linalg.norm(q, axis=1)
        turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
        own = q @ turn.T
        inward = (np.clip(own, -w, w) - own) @ turn
        outward = q * np.divide(Rmax - r, r, out=np.zeros_like(r), where=r > 0)[:, None]
        # The ways out (n, 3): into the channel, radially, below; and how long they are.
        ways = np.zeros((3, len(r), 3))
        ways[0][:, self.across] = inward
        ways[1][:, self.across] = outward
        ways[2][:, self.along] = -height
        shortest = np.linalg.norm(ways, axis=2).argmin(axis=0)
        inside = (height >= 0) & (height <= hi - lo) & (r <= Rmax)
        way = ways[shortest, np.arange(len(r))] * inside[:, None]
        return (K * stiffness_of(self.hub, points))[:, None] * way
