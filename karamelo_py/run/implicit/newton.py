"""Newton's method for the displacements of the nodes in an implicit step."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import perf_counter
from typing import Any

import numpy as np
import scipy.sparse as sp

from karamelo_py.run.implicit.contact import Contact
from karamelo_py.run.implicit.equations import Equations, Moduli
from karamelo_py.run.implicit.solvers import Singular, Unconverged, changed_sign, direct, solve
from karamelo_py.run.implicit.tools import Tool

ASTRAY = 1e4  # times as far as points may go: nothing holds them
FAR = 0.5  # cells that points may go at once, where weights follow them; else less than one


@contextmanager
def counted(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Add the time of what is done within to that of its stage."""
    begun = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - begun


class Failed(Exception):
    """Newton's method finds no equilibrium, for a reason."""


class TooFar(Failed):
    """Points would go so many times as far as they may at once."""

    def __init__(self, reason: str, times: float):
        super().__init__(reason)
        self.times = times


class Loose(Failed):
    """The equations are singular: hardly anything holds a node."""

    def __init__(self, node: int):
        super().__init__("the equations are singular")
        self.node = node


class Wrong(Failed):
    """A point has no finite stress."""

    def __init__(self, reason: str, point: int):
        super().__init__(reason)
        self.point = point


class Broken(Failed):
    """The user does not want to wait for the step."""


class Newton:
    """The balance of forces after displacements, and its solution.

    Parameters
    ----------
    scheme
        A tag with ``tolerance``, ``iterations`` and ``solver``.
    equations
        Forces and stiffness, with numbered unknowns.
    inertia
        What moving bodies add.
    pushing
        What pushes by where bodies are: contact, tools.
    external
        (m, d) forces that are not those of stress.
    dt
        The step.
    seconds
        Takes the time of stages: of stress and tangent, assembly, and solution.

    Attributes
    ----------
    floor
        A force that is next to nothing: residuals are relative to it at least.
    """

    def __init__(
        self,
        scheme: Any,
        equations: Equations,
        inertia: Any,
        pushing: list[Contact | Tool],
        external: np.ndarray,
        dt: float,
        seconds: dict[str, float],
    ):
        self.scheme, self.equations, self.inertia = scheme, equations, inertia
        self.pushing, self.external = pushing, external
        self.dt, self.seconds = dt, seconds
        self.free = equations.free
        self.spacing = float(np.min(equations.s.grids.spacing))
        self.ghost: sp.csr_matrix | None = None
        self.ghost_of_free: sp.csr_matrix | None = None
        self.floor = 0.0
        self.kept: dict = {}  # what a solver keeps from one correction to the next
        with counted(seconds, "stress"):
            self.inner = equations.respond(np.zeros_like(external), dt)
        for one in pushing:
            one.respond(np.zeros_like(external))

    def scale(self, moduli: Moduli, stabilisation: float) -> None:
        """Tell the stiffness of the bodies; a share of it penalises jumps at their border."""
        self.floor = 1e-9 * moduli.least() * self.spacing ** (self.equations.d - 1)
        if stabilisation * moduli.mean:
            self.ghost = stabilisation * moduli.mean * self.equations.ghost(moduli)
            free = self.free.ravel()
            self.ghost_of_free = self.equations.for_all_components(self.ghost)[free][:, free]

    def solve(
        self, jump: np.ndarray, interrupted: Callable[[], bool]
    ) -> tuple[np.ndarray, int, float]:
        """Find displacements (m, d); `jump` (m, d) are those of the components that are given.

        Returns the number of corrections, too, and the residual that is left.

        Raises
        ------
        Failed
            If there are none within the iterations allowed; `Broken` if the user has `interrupted`
            them.
        """
        scheme, free = self.scheme, self.free
        u = np.zeros_like(jump)
        settled = False
        for iteration in range(scheme.iterations + 1):
            balance = self.balance(u)
            residual = float(np.linalg.norm(balance[free]) / self._size(u))
            done = residual <= scheme.tolerance or (settled and residual <= 1e-6)
            if done and not (iteration == 0 and np.any(jump)):
                return u, iteration, residual
            if interrupted():
                raise Broken
            if iteration < scheme.iterations:
                change = self._correction(balance, jump, residual)
                u += change
                jump = np.zeros_like(jump)
                self._respond(u)
                # Where forces are small beside what they are rounded to, displacements tell.
                settled = np.linalg.norm(change) <= scheme.tolerance * np.linalg.norm(u)
        raise Failed(f"after {scheme.iterations} corrections {residual:.1e} of the forces are left")

    def balance(self, u: np.ndarray) -> np.ndarray:
        """Find what the forces leave (m, d)."""
        forces = self.external - self.inner
        for one in self.pushing:
            forces += one.forces()
        if self.ghost is not None:
            forces -= self.ghost @ u
        return self.inertia.balance(u, forces)

    def reaction(self, u: np.ndarray) -> np.ndarray:
        """Find the forces (m, d) that hold given components."""
        return -self.balance(u)

    @property
    def unstable(self) -> bool:
        """Tell whether the last stiffness is not positive definite, as far as a solver knows."""
        return "factors" in self.kept and changed_sign(self.kept["factors"])

    def _size(self, u: np.ndarray) -> float:
        norms = np.linalg.norm(self.external), np.linalg.norm(self.inner), self.inertia.size(u)
        return max(*norms, self.floor, 1e-300)

    def _correction(self, balance: np.ndarray, jump: np.ndarray, residual: float) -> np.ndarray:
        """Solve the linear equations for the change of all displacements (m, d).

        As accurate as keeps Newton's method quadratic (Eisenstat & Walker 1996).
        """
        equations, inertia, free = self.equations, self.inertia, self.free
        change = jump.copy()
        with counted(self.seconds, "assembly"):
            equations.linearise()
        A = equations.matrix
        b = balance[free] - equations.of_prescribed(jump)
        if self.ghost is not None:
            A = A + self.ghost_of_free
            b -= (self.ghost @ jump)[free]
        for one in self.pushing:
            every = one.matrix()
            A = A + every[free.ravel()][:, free.ravel()]
            b -= (every @ jump.ravel())[free.ravel()]
        if inertia.diagonal:
            mass = np.broadcast_to(equations.mass[:, None], free.shape)[free]
            A = A + sp.diags(inertia.diagonal * mass)
        if len(b):
            try:
                accuracy = max(1e-10, min(1e-4, 0.1 * residual))
                rigid = equations.rigid_motions[free]
                with counted(self.seconds, "solution"):
                    change[free] = solve(self.scheme.solver, A, b, rigid, accuracy, self.kept)
            except Singular:
                raise Loose(self._loosest(A)) from None
            except Unconverged:
                raise Failed("multigrid did not converge: take solver=direct") from None
        return change

    def _wrong(self, u: np.ndarray) -> Failed:
        """Tell why forces of stress after displacements (m, d) are no numbers."""
        if not np.all(np.isfinite(u)):
            return Failed("displacements are no finite numbers")
        places = self.equations.s.kin.Tensor.places
        for block, (_, response) in zip(self.equations.blocks, self.equations.parts, strict=True):
            bad = np.flatnonzero(~np.isfinite(response.stress).all(0))
            if len(bad):
                A = np.eye(3)
                for (i, j), h in zip(places, response.increment[:, bad[0]], strict=True):
                    A[i, j] += h
                point = int(block.points.id[bad[0]])
                if np.linalg.det(A) > 0:
                    return Wrong(f"the law gives no finite stress at point {point}", point)
                return Wrong(f"point {point} turns inside out", point)
        return Failed("forces of stress are no finite numbers")

    def _loosest(self, A: sp.csr_matrix) -> int:
        """Find the node that moves most in the softest motion, by inverse iteration."""
        size = np.abs(A.diagonal()) + 1e-12 * np.abs(A.data).max(initial=1e-300)
        B = A + sp.diags(1e-9 * size)
        x = np.random.default_rng(0).standard_normal(A.shape[0])
        with suppress(Singular):
            for _ in range(2):
                x = direct(B.tocsr(), x * size)
                x /= np.abs(x).max()
        return int(np.argwhere(self.free)[np.abs(x).argmax(), 0])

    def _respond(self, u: np.ndarray) -> None:
        """Find the forces of stress after displacements (m, d), if points can follow."""
        equations = self.equations
        with counted(self.seconds, "stress"):
            self.inner = equations.respond(u, self.dt)
        for one in self.pushing:
            one.respond(u)
        if not np.all(np.isfinite(self.inner)):
            raise self._wrong(u)
        far = equations.furthest() / self.spacing
        most = FAR if equations.s.frame.moves else 0.95
        if far > ASTRAY * most:
            raise Loose(int(np.abs(u).max(1).argmax()))
        far = max(far, equations.fastest_tool * self.dt / self.spacing)
        if not far <= most:
            raise TooFar(f"points would go {far:.3g} cells at once", far / most)
