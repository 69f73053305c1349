"""Tools that are as stiff as a step allows, with friction that remembers what it holds."""

from typing import Any

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.rubbing import rub_points
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.styles.fixes.formulas import judge_friction
from karamelo_py.styles.fixes.grip import GripOfTool, grip_for
from karamelo_py.styles.fixes.tools.base import ToolFix

CLOSE = 0.5  # radii off a surface at which points that bounce on it do not forget their hold


class StiffTool(ToolFix):
    """Base of tools that push a point by what stops it within a step, and rub it."""

    impulsive = True
    remembers = ("has_touched",)
    has_touched = False  # else what grips hold is that of a tool before
    grip: type[GripOfTool] | None = None
    mu = 0.0

    def rubs(self, hub: Hub, mu: float) -> None:
        """Let the tool have a coefficient of friction."""
        judge_friction(hub, mu)
        self.mu = mu
        if mu > 0:
            self.grip = grip_for(hub, GripOfTool)
            self.point_fields = (*self.point_fields, self.grip)

    def begin_to_touch(self) -> None:
        """Forget what grips hold of a tool before."""
        if self.grip is not None and not self.has_touched:
            for block in self.hub.simulation.setup.blocks:
                if (grip := field(block.points.fields, self.grip)) is not None:
                    grip[:] = 0
            self.has_touched = True

    def press(
        self,
        points: PointsView,
        push: np.ndarray,
        touching: np.ndarray,
        normal: np.ndarray,
        velocity: Any,
        seen: np.ndarray,
        led: Any = 0.0,
        share: float = 1.0,
    ) -> np.ndarray:
        """Forces (n, d) that take points by `push` (n,) along `normal` in a step: m push / dt^2.

        Friction is at most mu times that (de Vaucorbeil & Nguyen 2021). It stops the slip on a tool
        of this `velocity`, and undoes the `share` of the way that a point has slid: of the places
        (n, d) that are `seen`, less the way that the tool has `led` it.
        """
        stiffness = points.mass.astype(float) / (points.contact_dt * points.contact_kick)
        load = stiffness * np.maximum(push, 0)
        force = load[:, None] * normal
        if self.grip is not None:
            self.begin_to_touch()
            grip, d = points[self.grip], normal.shape[1]
            near = np.flatnonzero(touching)
            before, one = grip[near].astype(float), stiffness[near, None]
            touched = before[:, d, None] > 0
            way = np.where(touched, led - (seen[near] - before[:, d + 2 :]), 0.0)
            pull = share * one * way
            # Velocities of points have noise, by which they do not move.
            slip = way / (2 * points.kick - points.dt)
            slip = np.where(touched, slip, velocity - points.velocity[near].astype(float))
            stop = points.contact_dt * one * slip
            hold, rubbed = before[:, : d + 2].copy(), force[near]
            rub_points(KINEMATICS[d](), self.mu, normal[near], load[near], pull, stop, hold, rubbed)
            force[near] = rubbed
            grip[:] = 0
            grip[near, : d + 2], grip[near, d + 2 :] = hold, seen[near]
        return force
