"""Newton's method for nodal displacements."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import perf_counter

import numpy as np
import scipy.sparse as sp

from karamelo_py.kernels.arrays import Tag
from karamelo_py.run.implicit import solvers
from karamelo_py.run.implicit.contact import Contact
from karamelo_py.run.implicit.equations import MOST_MOVED, Equations, Moduli
from karamelo_py.run.implicit.inertia import Motion, Rest
from karamelo_py.run.implicit.pore_water import Seepage
from karamelo_py.run.implicit.rigid_bodies import MovingBodies
from karamelo_py.run.implicit.tools import PushingTool
from karamelo_py.script.errors import plural

ROUNDING = 50 * float(np.finfo(float).eps)  # round-off of sums of some dozens of terms, relative
SINGULAR = "the equations are singular"
ASTRAY = 1e4  # displacement / largest allowed displacement above which the solution has diverged


@contextmanager
def counted(seconds: dict[str, float], stage: str) -> Iterator[None]:
    begun = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - begun


class Failed(Exception):
    """No equilibrium was found; `at` is a node, a point or a distance."""

    def __init__(self, reason: str = "", at: float = 0):
        super().__init__(reason)
        self.at = at


class TooFar(Failed):
    """Points would move `at` times as far as a step allows."""


class Loose(Failed):
    """The equations are singular, because node `at` is not or hardly held."""


class Wrong(Failed):
    """Point `at` has no finite stress."""


class Broken(Failed):
    """Ctrl-C or a signal interrupted the step."""


class Newton:
    """The balance of forces as a function of displacements, and its solution.

    `free` (m, d) masks the unknown components, `external` (m, d) are all forces except internal
    ones, `pushing` lists contact and tools.
    """

    def __init__(
        self,
        scheme: Tag,
        equations: Equations,
        free: np.ndarray,
        inertia: Rest | Motion,
        pushing: list[Contact | PushingTool],
        external: np.ndarray,
        dt: float,
        seconds: dict[str, float],
        fixed: Callable[[], np.ndarray],
    ):
        self.scheme, self.equations, self.inertia = scheme, equations, inertia
        self.pushing, self.external = pushing, external
        self.dt, self.seconds, self.fixed = dt, seconds, fixed
        self.free = free
        self.lever = equations.levers.max(0)
        self.spacing = float(np.min(equations.s.grids.spacing))
        self.ghost: sp.csr_matrix | None = None
        self.stiff = np.zeros_like(external)  # diagonal of the last matrix
        self.kept: dict = {}  # data of the solver that can be reused in the next correction
        self.seepage: Seepage | None = None
        self.bodies: MovingBodies | None = None
        with counted(seconds, "stress"):
            self.inner = equations.respond(np.zeros_like(external), dt)

    def scale(self, moduli: Moduli, stabilisation: float) -> None:
        if stabilisation * moduli.mean:
            self.ghost = stabilisation * moduli.mean * self.equations.ghost(moduli)

    def solve(
        self, jump: np.ndarray, interrupted: Callable[[int, float], bool]
    ) -> tuple[np.ndarray, int, float]:
        """Return displacements (m, d), the number of corrections and the residual.

        `jump` (m, d) contains the prescribed components. Raises `Failed` if the iterations do not
        converge, and `Broken` if ``interrupted(corrections, residual)`` returns True.
        """
        scheme, free = self.scheme, self.free
        u = np.zeros_like(jump)
        for iteration in range(scheme.iterations + 1):
            balance = self.balance(u)
            residual = self._norm(balance, free)
            if self.bodies is not None:
                residual = float(np.hypot(residual, self.bodies.norm(self.bodies.rest(balance))))
            residual /= self._size(u)
            if self.seepage is not None:
                residual = max(residual, self.seepage.residual(scheme.tolerance))
            if residual <= scheme.tolerance and not (iteration == 0 and np.any(jump)):
                return u, iteration, residual
            if interrupted(iteration, residual):
                raise Broken
            if iteration < scheme.iterations:
                u += self._correction(balance, jump, residual)
                jump = np.zeros_like(jump)
                self._respond(u)
        raise Failed(
            f"after {plural(scheme.iterations, 'correction')} {residual:.1e} of the forces are left"
        )

    def balance(self, u: np.ndarray) -> np.ndarray:
        forces = self.external - self.inner
        for one in self.pushing:
            forces += one.forces()
        if self.seepage is not None:
            forces += self.seepage.forces()
        if self.ghost is not None:
            levers = self.equations.levers
            forces -= levers * (self.ghost @ (levers * u))
        return self.inertia.balance(u, forces)

    def reaction(self, u: np.ndarray) -> np.ndarray:
        return -self.balance(u)

    @property
    def unstable(self) -> bool:
        return "factors" in self.kept and solvers.changed_sign(self.kept["factors"])

    def _size(self, u: np.ndarray) -> float:
        norms = [self._norm(self.external), self._norm(self.inner), self.inertia.size(u)]
        if self.bodies is not None:
            norms.append(self.bodies.norm(self.bodies.load))
        return max(*norms, self._rounding(u) / self.scheme.tolerance, 1e-300)

    def _norm(self, forces: np.ndarray, free: np.ndarray | slice = slice(None)) -> float:
        """Return the norm of the forces; torques are divided by the largest radius."""
        return float(np.linalg.norm((forces / self.lever)[free]))

    def _rounding(self, u: np.ndarray) -> float:
        """Estimate the round-off of forces, from strains (relative to 1) and from `u`."""
        far = np.abs(u) + self.spacing / self.lever
        return ROUNDING * self._norm(self.stiff * far, self.free)

    def _correction(self, balance: np.ndarray, jump: np.ndarray, residual: float) -> np.ndarray:
        """Solve the linear equations for the change of all displacements (m, d).

        The accuracy is such that convergence remains quadratic (Eisenstat & Walker 1996).
        """
        equations, free = self.equations, self.free
        with counted(self.seconds, "assembly"):
            equations.linearise(self.dt, self.ghost)
            A, b = equations.whole, balance.ravel() - equations.whole @ jump.ravel()
            solvers.hold(A, ~free, self.inertia.diagonal * equations.mass)
            whole = self.bodies
            for one in self.pushing:
                more = one.matrix()
                b -= more @ jump.ravel()
                if whole is not None and isinstance(one, Contact):
                    whole.couple(more, free, balance - (more @ jump.ravel()).reshape(jump.shape))
                solvers.hold(more, ~free, np.zeros(len(free)))
                A = A + more
            b[~free.ravel()] = 0
            self.stiff = np.abs(A.diagonal()).reshape(free.shape)
        if not np.any(free) and self.seepage is None:
            return jump
        rigid = np.where(free[:, :, None], equations.rigid_motions, 0.0)
        accuracy = max(1e-10, min(1e-4, 0.1 * residual))
        try:
            with counted(self.seconds, "solution"):
                options = rigid.reshape(len(b), -1), accuracy, self.kept
                if self.seepage is not None:
                    x = self.seepage.solve(A, b, jump, free, self.kept).reshape(free.shape)
                elif whole is not None:
                    moved = whole.solve(A, b, self.kept)
                    return np.where(free, moved, jump + moved)
                else:
                    x = solvers.solve(self.scheme.solver, A, b, *options).reshape(free.shape)
        except solvers.Singular:
            raise Loose(SINGULAR, self._loosest(A)) from None
        except solvers.Unconverged:
            raise Failed("multigrid did not converge: use solver=direct") from None
        return np.where(free, x, jump)

    def _wrong(self, u: np.ndarray) -> Failed:
        if not np.all(np.isfinite(u)):
            return Failed("displacements are not finite")
        places = self.equations.s.kin.Tensor.places
        for block, (_, response) in zip(self.equations.blocks, self.equations.parts, strict=True):
            bad = np.flatnonzero(~np.isfinite(response.stress).all(0))
            if len(bad):
                A = np.eye(3)
                for (i, j), h in zip(places, response.increment[:, bad[0]], strict=True):
                    A[i, j] += h
                point = int(block.points.id[bad[0]])
                if np.linalg.det(A) > 0:
                    return Wrong(f"the law returns no finite stress at point {point}", point)
                return Wrong(f"point {point} turns inside out", point)
        return Failed("forces of stress are not finite")

    def _loosest(self, A: sp.bsr_matrix) -> int:
        size = np.abs(A.diagonal()) + 1e-12 * np.abs(A.data).max(initial=1e-300)
        B = A + sp.diags(1e-9 * size)
        x = np.where(self.free.ravel(), np.random.default_rng(0).standard_normal(A.shape[0]), 0)
        with suppress(solvers.Singular):
            for _ in range(2):
                x = solvers.direct(B.tocsr(), x * size)
                x /= np.abs(x).max()
        return int(np.abs(x).argmax() // self.free.shape[1])

    def _respond(self, u: np.ndarray) -> None:
        equations = self.equations
        with counted(self.seconds, "stress"):
            self.inner = equations.respond(u, self.dt)
        for one in self.pushing:
            one.respond(u)
        if self.seepage is not None:
            self.seepage.respond(u)
        if not np.all(np.isfinite(self.inner)):
            raise self._wrong(u)
        far = equations.furthest() / self.spacing
        if far > ASTRAY * MOST_MOVED:
            raise Loose(SINGULAR, int(np.abs(u).max(1).argmax()))
        far = max(far, np.abs(u[equations.led]).max(initial=0.0) / self.spacing)
        if far <= MOST_MOVED or not equations.s.frame.moves:
            return
        if not self.pushing:  # contact uses the present surfaces, so no motion is too far
            far = min(far, equations.furthest_into(u, self.fixed()))
        if far > MOST_MOVED:
            raise TooFar(f"points would move {far:.3g} cells at once", far / MOST_MOVED)
