"""Quasi-static scheme: load steps that end in equilibrium, found by Newton's method."""

from typing import Annotated, Literal, NamedTuple

from karamelo_py.kernels import arrays, table
from karamelo_py.kernels.equations.strain import StrainOfLoadStep
from karamelo_py.language.signature import ByName, Constraint, Keyword, NonNegative, Positive
from karamelo_py.schemes.traits import IMPLICIT, SchemeTraits

# Stages: nodal loads and forces of the present stress, constraints, motion of the points.
BEGIN = (
    table.AtPoints(arrays.INITIAL_INTEGRATE, 0),
    table.SUMS,
    table.AVERAGED,
    table.AtNodes(arrays.POST_PARTICLES_TO_GRID, arrays.ON_SUMS),
    table.AXIS,
)
HOLD = (table.AtNodes(arrays.POST_UPDATE_GRID_STATE, arrays.ON_UPDATE), table.AXIS)
CLOSE = (
    table.WORK_OF_LOADS,
    *table.MOVE,
    table.Gather(StrainOfLoadStep()),
    table.AtPoints(arrays.FINAL_INTEGRATE, 1),
)
# Values of the last step: number of corrections, residual / forces, number of substeps.
PUBLISHED = "iterations", "residual", "parts"


# A larger tolerance could accept a first correction without equilibrium; a smaller is round-off.
Tolerance = Constraint("from 1e-14 to 0.01", lambda value: 1e-14 <= value <= 0.01)


class QuasiStatic(NamedTuple):
    """Load steps without inertia: each ends in equilibrium, found by Newton's method.

    Loads are formulas of `time`, which is only a load parameter. The tangent is exact for every law
    and basis, so convergence is quadratic. A step that does not converge is subdivided.

    Parameters
    ----------
    tolerance
        Residual / nodal forces at which a step has converged, from 1e-14 to 0.01.
    iterations
        Number of corrections after which a step that has not converged is halved.
    solver
        Linear solver: ``direct``, ``amg`` (conjugate gradients with algebraic multigrid), or
        ``auto``: amg from 2000 unknowns in 3D, and from 5000 in 2D if the matrix is symmetric.
    stabilisation
        Ghost stabilisation (Coombs 2023) for nodes that overlap only a sliver of the body: jumps of
        gradients at the border are penalised with this fraction of Young's modulus. 0: none.
    limit
        What to do if even 1/1024 of a step has no equilibrium: ``error``, or ``stop``, which ends
        the run. After ``stop``, the script continues with the `time` of the last equilibrium, which
        gives the limit load.

    Example
    -------
    scheme(quasi-static)
    scheme(quasi-static, tolerance=1e-8, iterations=30, solver=direct)
    scheme(quasi-static, limit=stop)

    Notes
    -----
    Velocities and kinetic energies are zero after a step. Scripts can use `iterations`
    (corrections), `residual` (fraction of the forces) and `parts` (substeps) of the last step.

    A step is also subdivided if points would move more than half a cell towards nodes that move
    differently, or towards held nodes without points.
    """

    traits = SchemeTraits(implicit=True, restrictions=IMPLICIT, inertia=False)
    begin = BEGIN
    hold = HOLD
    close = CLOSE
    rows = (*BEGIN, *HOLD, *CLOSE)

    tolerance: Annotated[float, Tolerance, Keyword()] = 1e-10
    iterations: Annotated[int, Positive, Keyword()] = 20
    solver: ByName[Literal["auto", "direct", "amg"]] = "auto"
    stabilisation: Annotated[float, NonNegative, Keyword()] = 1 / 30
    limit: ByName[Literal["error", "stop"]] = "error"
