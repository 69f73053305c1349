"""Inertia in the balance of an implicit step, and the velocities that follow."""

from typing import Any

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import MASS
from karamelo_py.kernels.implicit import gather, scatter
from karamelo_py.run.implicit.equations import Equations
from karamelo_py.schemes.newmark import Acceleration


class Rest:
    """No inertia: load steps."""

    share = 1.0  # of the new forces in the balance
    diagonal = 0.0  # of the stiffness, in units of a nodal mass

    def __init__(self, equations: Equations):
        self.blocks = equations.s.blocks

    def balance(self, u: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Add inertia to what forces leave (m, d), after displacements (m, d)."""
        return forces

    def size(self, u: np.ndarray) -> float:
        """Give the size of the forces of inertia."""
        return 0.0

    def end(self, u: np.ndarray, given: np.ndarray, v: np.ndarray) -> None:
        """Give the points their velocities after the step."""
        for block in self.blocks:
            block.points.v[:] = 0


class Motion:
    """Inertia by the rules of Newmark.

    Parameters
    ----------
    equations
        The equations of the step.
    scheme
        A tag :class:`~karamelo_py.schemes.newmark.Newmark`.
    dt
        The step.
    before
        (m, d) what the forces of the beginning leave; with it the accelerations of a first step.
    first
        Whether this is a first step.
    """

    def __init__(
        self, equations: Equations, scheme: Any, dt: float, before: np.ndarray, first: bool
    ):
        self.equations, self.scheme, self.dt = equations, scheme, dt
        s = equations.s
        self.mass = s.nodes.sums[equations.nodes, MASS, None].astype(float)
        self.v = self._at_nodes(lambda points: points.v)
        self.a = self._at_nodes(lambda points: field(points.fields, Acceleration))
        self.before = before
        if first:
            self.a = before / self.mass
        if scheme.rule == "euler":
            self.beta, self.gamma, self.rest = 1.0, 1.0, 0.0
        else:
            self.beta, self.gamma, self.rest = scheme.beta, scheme.gamma, 0.5 / scheme.beta - 1
        self.share = 1 - scheme.alpha_f
        self.diagonal = (1 - scheme.alpha_m) / (self.beta * dt * dt)
        self.old = [block.points.v.copy() for block in s.blocks]

    def _at_nodes(self, of: Any) -> np.ndarray:
        """Average something of the points (d, n) at the nodes (m, d), by mass."""
        equations = self.equations
        total = np.zeros((len(equations.nodes), equations.d))
        for block, (seen, _) in zip(equations.s.blocks, equations.parts, strict=True):
            scatter(seen, block.points.mass, of(block.points), total)
        return total / self.mass

    def acceleration(self, u: np.ndarray) -> np.ndarray:
        """Find the accelerations (m, d) after displacements (m, d)."""
        return (u - self.dt * self.v) / (self.beta * self.dt**2) - self.rest * self.a

    def balance(self, u: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Add inertia to what forces leave (m, d), after displacements (m, d)."""
        scheme = self.scheme
        mean = (1 - scheme.alpha_m) * self.acceleration(u) + scheme.alpha_m * self.a
        return self.share * forces + scheme.alpha_f * self.before - self.mass * mean

    def size(self, u: np.ndarray) -> float:
        """Give the size of the forces of inertia."""
        return float(np.linalg.norm(self.mass * self.acceleration(u)))

    def end(self, u: np.ndarray, given: np.ndarray, v: np.ndarray) -> None:
        """Give the points their velocities and accelerations after the step.

        `given` components (m, d) of the nodes have the velocities `v`.
        """
        dt, gamma = self.dt, self.gamma
        a = np.where(given, (v - self.v) / dt, self.acceleration(u))
        new = np.where(given, v, self.v + dt * ((1 - gamma) * self.a + gamma * a))
        kept = getattr(self.equations.s.transfer, "alpha", 0.0)
        parts = zip(self.equations.s.blocks, self.equations.parts, self.old, strict=True)
        for block, (seen, _), old in parts:
            points = block.points
            points.v[:] = kept * old
            gather(seen, new - kept * self.v, points.v)
            accelerations = field(points.fields, Acceleration)
            accelerations[:] = 0
            gather(seen, a, accelerations)
