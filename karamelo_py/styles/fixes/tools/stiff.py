"""Tools as stiff as a step allows, with friction."""

from typing import Any

import numpy as np

from karamelo_py.kernels.equations.internal_force import ContactLoss
from karamelo_py.kernels.rubbing import Rubbing, rub_points
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.views import PointsView
from karamelo_py.styles.fixes.grip import GripOfTool, Gripping
from karamelo_py.styles.fixes.tools.base import ToolFix

CLOSE = 0.5  # distance in radii within which a bouncing point retains its friction spring


class StiffTool(Gripping, ToolFix):
    by_sizes = True
    impulsive = True
    kind_of_grip = GripOfTool
    point_fields = (*ToolFix.point_fields, ContactLoss)

    def press(
        self,
        points: PointsView,
        push: np.ndarray,
        touching: np.ndarray,
        normal: np.ndarray,
        *,
        velocity: Any,
        seen: np.ndarray,
        led: Any = 0.0,
    ) -> np.ndarray:
        """Return forces m push / dt^2 (n, d), which move points by `push` (n,) along `normal`.

        Friction, at most mu times this force (de Vaucorbeil & Nguyen 2021), stops and reverses the
        slip of positions `seen` (n, d) on a tool with this `velocity` and the displacement `led`.
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
            pull = one * way
            # Velocities are from displacements, as velocities of points contain null-space noise.
            slip = way / (2 * points.kick - points.dt)
            slip = np.where(touched, slip, velocity - points.velocity[near].astype(float))
            stop = points.contact_dt * one * slip
            hold, rubbed = before[:, : d + 2].copy(), force[near]
            rubbing = Rubbing(normal[near], load[near], pull, stop)
            rub_points(KINEMATICS[d](), self.mu, rubbing, hold, rubbed)
            lost = ((rubbed - force[near]) * slip).sum(axis=1)
            points[ContactLoss][near, 0] += points.kick * lost
            force[near] = rubbed
            grip[:] = 0
            grip[near, : d + 2], grip[near, d + 2 :] = hold, seen[near]
        return force
