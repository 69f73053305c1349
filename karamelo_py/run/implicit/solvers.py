"""Linear solvers of implicit steps."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import MatrixRankWarning, SuperLU, splu

AMG_FROM = 5000  # unknowns above which multigrid is faster than the direct solver
AMG_FROM_IN_3D = 2000
MANY_ITERATIONS = 25  # iterations above which the hierarchy is built again


class Singular(Exception):
    """There is no solution, because a body is not held or a limit load is reached."""


class Unconverged(Exception):
    """Multigrid has reduced the residual by less than a factor of 100."""


def hold(A: sp.bsr_matrix, fixed: np.ndarray, more: np.ndarray) -> None:
    """Decouple `fixed` components (m, d) of a matrix; add `more` (m,) to the other diagonals."""
    rows = np.repeat(np.arange(len(fixed)), np.diff(A.indptr))
    some = np.any(fixed, axis=1)
    at = np.flatnonzero(some[rows] | some[A.indices])
    A.data[at] *= ~(fixed[rows[at]][:, :, None] | fixed[A.indices[at]][:, None, :])
    diagonal, i = np.flatnonzero(rows == A.indices), np.arange(fixed.shape[1])
    A.data[diagonal[:, None], i, i] += np.where(fixed, 1.0, more[:, None])[rows[diagonal]]


def scaled(A: sp.spmatrix, s: np.ndarray | None = None) -> tuple[sp.csr_matrix, np.ndarray]:
    if A.format == "bsr":
        A = A.tocsr()
        A.eliminate_zeros()
    if s is None:
        diagonal = np.abs(A.diagonal())
        if not np.all(diagonal > 0):
            raise Singular
        s = 1 / np.sqrt(diagonal)
    data = A.data * s[A.indices]
    data *= np.repeat(s, np.diff(A.indptr))
    return sp.csr_matrix((data, A.indices, A.indptr), A.shape), s


def direct(A: sp.spmatrix, b: np.ndarray, kept: dict | None = None) -> np.ndarray:
    B, s = scaled(A)
    kept = {} if kept is None else kept
    release(kept)  # factorisation takes most of the memory
    with warnings.catch_warnings():
        warnings.simplefilter("error", MatrixRankWarning)
        try:
            # The transpose in column format has the same arrays as B in row format.
            factors = splu(B.T, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        except (RuntimeError, MatrixRankWarning):
            raise Singular from None
    kept["factors"] = factors
    return s * factors.solve(s * b, trans="T")


def release(kept: dict) -> None:
    for level in kept["multigrid"].levels if "multigrid" in kept else ():
        vars(level).clear()  # levels are in reference cycles
    kept.clear()


def changed_sign(factors: SuperLU) -> bool:
    moved = np.empty_like(factors.perm_r)
    moved[factors.perm_c] = factors.perm_r
    n = len(moved)
    cycles = sp.csr_matrix((np.ones(n, bool), (np.arange(n), moved)), (n, n))
    swaps = n - connected_components(cycles, directed=False)[0]
    return bool((swaps + np.count_nonzero(factors.U.diagonal() < 0)) % 2)


def amg(
    A: sp.spmatrix, b: np.ndarray, rigid: np.ndarray, accuracy: float, kept: dict
) -> np.ndarray:
    """Solve by conjugate gradients (GMRES if A is not symmetric) with algebraic multigrid.

    `rigid` are the rigid motions (n, k) of the unknowns, 0 for decoupled ones. The rigid motions
    are the near null space for smoothed aggregation (Vanek, Mandel & Brezina 1996). `accuracy` is
    the tolerance for |residual| / |b|. Most of the time is spent building the hierarchy, so it is
    stored in `kept` and reused for similar matrices while few iterations are needed.
    """
    import pyamg

    grids = kept.get("multigrid")
    if grids is None:
        release(kept)
    else:
        grids.levels[0].A = None  # frees the last matrix first
    B, s = scaled(A, kept.get("scale"))
    symmetric = is_symmetric(B)
    left: list[float] = []
    # pyamg resets warning filters; failures are detected by residuals.
    with from_one_seed(), warnings.catch_warnings(record=True):
        if grids is None:
            symmetry = "symmetric" if symmetric else "nonsymmetric"
            grids = pyamg.smoothed_aggregation_solver(B, B=rigid / s[:, None], symmetry=symmetry)
            kept["scale"], kept["multigrid"] = s, grids
        else:
            grids.levels[0].A = B
        x = grids.solve(
            s * b,
            tol=accuracy,
            accel="cg" if symmetric else "gmres",
            maxiter=min(300, len(b)),
            residuals=left,
        )
    if len(left) > MANY_ITERATIONS:
        release(kept)
    if not np.all(np.isfinite(x)) or left[-1] > 1e-2 * max(left[0], 1e-300):
        raise Unconverged
    return s * x


def is_symmetric(A: sp.spmatrix) -> bool:
    x = np.random.default_rng(0).uniform(0.5, 1.5, A.shape[0])
    return bool(np.linalg.norm(A @ x - A.T @ x) <= 1e-9 * np.linalg.norm(abs(A) @ x))


@contextmanager
def from_one_seed() -> Iterator[None]:
    state = np.random.get_state()
    np.random.seed(0)
    try:
        yield
    except ValueError:  # a coarse matrix is not finite
        raise Unconverged from None
    finally:
        np.random.set_state(state)


def solve(
    name: str, A: sp.spmatrix, b: np.ndarray, rigid: np.ndarray, accuracy: float, kept: dict
) -> np.ndarray:
    in_space = rigid.shape[1] == 6
    large = np.count_nonzero(rigid.any(1)) >= (AMG_FROM_IN_3D if in_space else AMG_FROM)
    if name == "auto" and large and (in_space or is_symmetric(A)) and find_spec("pyamg"):
        try:
            return solve("amg", A, b, rigid, accuracy, kept)
        except (Singular, Unconverged):  # multigrid fails for some matrices
            release(kept)
    x = amg(A, b, rigid, accuracy, kept) if name == "amg" else direct(A, b, kept)
    if not np.all(np.isfinite(x)):
        raise Singular
    return x


def rigid_motions(positions: np.ndarray, free: int) -> np.ndarray:
    """Return rigid motions (m, d, k) of nodes; translations start at direction `free`."""
    m, d = positions.shape
    x = positions - positions.mean(0)
    motions = [np.broadcast_to(np.eye(d)[i], (m, d)) for i in range(free, d)]
    if d == 2 and not free:
        motions.append(np.stack([-x[:, 1], x[:, 0]], 1))
    elif d == 3:
        for i, j in ((0, 1), (0, 2), (1, 2)):
            turn = np.zeros((m, d))
            turn[:, i], turn[:, j] = -x[:, j], x[:, i]
            motions.append(turn)
    return np.stack(motions, 2) if motions else np.zeros((m, d, 0))
