"""Inertia of an implicit step."""

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import Tag
from karamelo_py.kernels.equations.twist import VelocityAround
from karamelo_py.kernels.implicit import gather
from karamelo_py.points.transfers import flip_coefficient
from karamelo_py.run.implicit.contact import Contact
from karamelo_py.run.implicit.equations import Equations, summed
from karamelo_py.schemes.newmark import Surplus


class Rest:
    diagonal = 0.0  # term added to the stiffness, per nodal mass

    def __init__(self, equations: Equations):
        self.blocks = equations.blocks

    def balance(self, u: np.ndarray, forces: np.ndarray) -> np.ndarray:
        return forces

    def size(self, u: np.ndarray) -> float:
        return 0.0

    def work(self, u: np.ndarray, reaction: np.ndarray) -> float:
        return 0.0

    def end(self, u: np.ndarray) -> None:
        for block in self.blocks:
            block.points.v[:] = 0
            around = field(block.points.fields, VelocityAround)
            if around is not None:
                around[:] = 0


class Motion:
    """Inertia by Newmark's rules and generalized-alpha.

    Generalized-alpha balances (1 - alpha_m) a' + alpha_m a, times mass, with (1 - alpha_f) f' +
    alpha_f f (primes: end of the step). Points store the difference between a and the acceleration
    due to the forces, initially 0, because storing a would be unstable with the losses of the
    transfer. `before` (m, d) are the residual forces at the beginning; `fixed` and `prescribed`
    (m, d) mask held components and give their velocities.
    """

    def __init__(
        self,
        equations: Equations,
        scheme: Tag,
        dt: float,
        before: np.ndarray,
        fixed: np.ndarray,
        prescribed: np.ndarray,
        contact: Contact | None,
    ):
        self.equations, self.scheme, self.dt = equations, scheme, dt
        self.before, self.fixed, self.prescribed = before, fixed, prescribed
        self.mass = equations.mass[:, None]
        self.inverse = np.divide(1, self.mass, out=np.zeros_like(self.mass), where=self.mass > 0)
        self.v = self._means([block.points.v for block in equations.blocks])
        self.a = self.of_forces = before * self.inverse
        self.contact, self.movable = contact, np.where(fixed, 0.0, self.inverse)
        if contact is not None:
            self.a = contact.accelerated(self.a, self.v, self.movable)
        if scheme.rule == "euler":
            self.beta, self.gamma, self.rest = 1.0, 1.0, 0.0
        else:
            self.beta, self.gamma, self.rest = scheme.beta, scheme.gamma, 0.5 / scheme.beta - 1
        self.am, self.af = scheme.alphas
        self.diagonal = (1 - self.am) / (1 - self.af) / (self.beta * dt * dt)
        fields = [field(block.points.fields, Surplus) for block in equations.blocks]
        self.surplus = [] if any(one is None for one in fields) else fields
        if self.surplus:
            self.a = self.of_forces + self._means(self.surplus)
        self.old = [block.points.v.copy() for block in equations.blocks]

    def _means(self, values: list[np.ndarray]) -> np.ndarray:
        equations = self.equations
        return summed(equations.weights, equations.blocks, values) * self.inverse

    def acceleration(self, u: np.ndarray) -> np.ndarray:
        free = (u - self.dt * self.v) / (self.beta * self.dt**2) - self.rest * self.a
        return np.where(self.fixed, (self.prescribed - self.v) / self.dt, free)

    def balance(self, u: np.ndarray, forces: np.ndarray) -> np.ndarray:
        a = self.acceleration(u)
        # Reactions at the end of the step use the acceleration there.
        return forces - self.mass * np.where(self.fixed, a, self._demand(a))

    def _demand(self, a: np.ndarray) -> np.ndarray:
        """Return the forces per mass (m, d) at the end of the step that balance `a` there."""
        weighted = (1 - self.am) * a + self.am * self.a
        return (weighted - self.af * self.of_forces) / (1 - self.af)

    def size(self, u: np.ndarray) -> float:
        return float(np.linalg.norm(self.mass * self.acceleration(u)))

    def work(self, u: np.ndarray, reaction: np.ndarray) -> float:
        """Return the work at held nodes in this step, by the mean of the initial and final forces.

        For a linear body under the trapezoidal rule, it equals the change of the energy. `reaction`
        (m, d) are the forces of the fixes at the end.
        """
        old, new, fixed = self.v, self.prescribed, self.fixed
        after = self.mass * self.acceleration(u) - reaction
        moving = 0.5 * self.mass * (new - old) * (new + old)
        return float(np.sum((moving - 0.5 * u * (self.before + after))[fixed]))

    def end(self, u: np.ndarray) -> None:
        dt, gamma = self.dt, self.gamma
        a = self.acceleration(u)
        free = self.v + dt * ((1 - gamma) * self.a + gamma * a)
        new = np.where(self.fixed, self.prescribed, free)
        if self.contact is not None:
            new = self.contact.stopped(new, self.movable)
        kept = flip_coefficient(self.equations.s.transfer)
        parts = zip(self.equations.blocks, self.equations.parts, self.old, strict=True)
        for block, (seen, _), old in parts:
            block.points.v[:] = kept * old
            gather(seen, new - kept * self.v, block.points.v)
        more = np.where(self.fixed, 0.0, a - self._demand(a))
        for (seen, _), surplus in zip(self.equations.parts, self.surplus, strict=False):
            surplus[:] = 0
            gather(seen, more, surplus)
