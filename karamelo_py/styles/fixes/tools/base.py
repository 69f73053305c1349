"""Bases of walls and rigid tools that push points."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.tools import (
    Ball,
    ByModulus,
    FlatSide,
    Press,
    PushedPoint,
    Stiff,
    find_depths,
    press_hook,
    press_kind,
    push_points,
)
from karamelo_py.language.rules import known_failure
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.laws import elastic_law, parameter
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import per_direction
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import PointForces

OF_SHAPE = 2e-8  # core seconds per point and step


class ToolFix(PointForces):
    """Base of fixes that push points; points are small cubes (in 2D squares)."""

    follows_points = presses = True
    needs_stiffness = False  # True: the force is proportional to the shear modulus of the point

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        soft = (s for s in hub.solids.values() if not _shear_modulus(s) and group.touches(s))
        if self.needs_stiffness and (solid := next(soft, None)):
            raise ScriptError(
                f"material '{solid.material.id}' of solid '{solid.id}' has no shear modulus, to "
                "which the force is proportional",
                argument="group",
                expected="a group of points of elastic materials",
            )

    def behind(self, points: PointTable) -> tuple[int, float]:
        depth = self.depth_of(points)
        return int(np.sum(depth > self.hub.domain.tolerance)), float(depth.max(initial=0.0))

    def now(self, *formulas: Expression) -> np.ndarray:
        return np.array([formula.evaluate(self.hub.values) for formula in formulas])

    def of_time(self, name: str, formulas: Sequence[Expression]) -> tuple[Expression, ...]:
        components = per_direction(self.hub, name, formulas, all_given=True)
        self.now(*components)
        return components

    def side(self, points: PointsView) -> np.ndarray:
        domain = self.hub.domain
        return (points.column("volume") / domain.depth(points.position)) ** (1 / domain.dimension)

    def face(self, points: PointsView) -> np.ndarray:
        """Return areas (n,) of a face of each point, per radian in axisymmetry."""
        domain = self.hub.domain
        return self.side(points) ** (domain.dimension - 1) * domain.depth(points.position)

    def stiffness(self, points: PointsView) -> np.ndarray:
        """Return shear moduli (n,), reduced by damage."""
        moduli = np.array([_shear_modulus(solid) for solid in self.hub.solids.values()])
        return moduli[points.column("type").astype(int) - 1] * (1 - points.column("damage"))


def _shear_modulus(solid: Solid) -> float:
    law: Any = elastic_law(solid.material.whole)
    return float(parameter(law, "G") or parameter(parameter(law, "strength"), "G"))


def begin_behind(plane: Any, scene: Any) -> Any:
    if scene.simulation.step > 0:
        return False
    counts, depths = zip(*scene.hub.fields.each(plane, "behind"), strict=True)
    count = sum(counts)
    which = "all" if count == len(plane.group) else f"{count} of {len(plane.group)}"
    return {"which": which, "depth": max(depths)} if count else False


class ShapedTool(ToolFix):
    """Base of tools with a `shape`, whose values are the last of `values_of_time`."""

    kind_of_press: type[Press] = Press
    grip: type | None = None
    shape: Any
    law: Any
    first = 0  # index of the first value of the shape

    def push(self, law: Any, *numbers: Expression) -> None:
        """Set the law of the force, and the values of the law, if any, and of the shape."""
        self.law, self.values_of_time, self.first = law, numbers, 0 if isinstance(law, Stiff) else 1
        self.now(*numbers)  # raises ScriptError for formulas of position
        self.initial_integrate = press_hook(self._press)

    def _press(self, row: int, values: tuple) -> Press:
        law = self.law
        if isinstance(law, ByModulus):  # solids and their moduli may change between runs
            solids = list(self.hub.solids.values())
            moduli = np.array([_shear_modulus(solid) for solid in solids])
            law = law._replace(moduli=moduli, firsts=np.array([s.first_id for s in solids]))
        return press_kind(self.kind_of_press, self.grip)(row, values, self.shape, law)

    def refuse_undefined(self) -> None:
        # in a rehearsal, some values are unknown
        if not self.hub.rehearsing and (wrong := self.undefined()):
            raise ScriptError(wrong[0], expected=wrong[1])

    def seconds(self) -> float:
        return super().seconds() + OF_SHAPE * len(self.group)

    def depth_of(self, points: PointTable) -> np.ndarray:
        x, kin = points.position.astype(float), self.hub.domain.kin
        depths = np.empty(len(x))
        values = tuple(self.now(*self.values_of_time[self.first :]).tolist())
        find_depths(kin, self.shape, values, x, depths)
        return depths

    def forces(self, points: PointsView) -> np.ndarray:
        """Return the forces (n, d) in load steps."""
        self.refuse_undefined()
        x, force = points.position.astype(float), np.empty(points.position.shape)
        modulus = self.stiffness(points) if isinstance(self.law, ByModulus) else np.zeros(len(x))
        seen = PushedPoint(x, points.mass.astype(float), self.side(points), modulus)
        tag, values = self._press(0, ()), tuple(self.now(*self.values_of_time).tolist())
        push_points(self.hub.domain.kin, tag, values, seen, force)
        return force


class PlaneTool(ShapedTool):
    """Base of tools with a plane. Points belong on the side to which the normal points."""

    shape = FlatSide()

    def lay(self, origin: Sequence[Expression], normal: Sequence[Expression]) -> tuple:
        """Return the formulas of the shape."""
        origin = self.of_time("", origin)
        self.towards = self.of_time("n", normal)
        self.refuse_undefined()
        return *origin, *self.towards

    def undefined(self) -> tuple[str, str] | None:
        size = np.linalg.norm(self.now(*self.towards))
        defined = np.isfinite(size) and size > 0
        return None if defined else ("the normal has no direction", "a vector that is not 0")

    def is_endless(self, axis: int) -> bool:
        normal = self.towards[axis]
        return normal.is_constant and normal.constant == 0


known_failure(
    PlaneTool,
    "points behind the plane of fix '{part.id}'",
    when=begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="the opposite normal, which points to the side of the points, or another position of "
    "the plane or the body",
)


class BallTool(ShapedTool):
    """Base of balls (in 2D disks) with a `centre` and a radius `R`.

    Parameters
    ----------
    kind
        The word ``sphere``.
    R
        Radius, as a function of time.
    x, y, z
        Position of the centre, as functions of time; z is 0 in 2D.
    """

    published = ("x", "y", "z", "s")
    shape = Ball()


known_failure(
    BallTool,
    "points in the ball of fix '{part.id}'",
    when=begin_behind,
    reason="{which} points of its group begin there, up to {depth:.3g} deep, and are thrown out",
    cure="another position of the ball or the body",
)
