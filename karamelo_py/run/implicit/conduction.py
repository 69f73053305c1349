"""Heat conduction by backward Euler."""

import numpy as np
import scipy.sparse as sp

from karamelo_py.kernels.arrays import MASS, Tag, of_force
from karamelo_py.kernels.heat import FLOW_TO_NODES, HOLD, WARM
from karamelo_py.kernels.step import take_rows
from karamelo_py.points.kinematics import Line
from karamelo_py.run.implicit.equations import Equations
from karamelo_py.run.implicit.solvers import direct
from karamelo_py.scene.modify import Fix


def conduct(equations: Equations, hooks: Tag, fixes: list[Fix], dt: float) -> None:
    """Conduct heat for `dt`, before the points are strained; raises `Singular`.

    The equation is C (T' - T) / dt = q - K T', with nodal capacities C and conductances K. The
    equation is linear, so it is solved once, without iterations. The split from an adiabatic step
    has an error of first order in dt (Armero & Simo 1992). Conduction precedes the stress update,
    so that load steps end in equilibrium.
    """
    s, mode = equations.s, equations.mode
    take_rows(FLOW_TO_NODES, s, mode, hooks)
    nodes = equations.nodes
    heated = s.heat.nodes
    sums, update = heated.sums, heated.update
    capacity = sums[nodes, MASS].astype(float)
    some = capacity > 0
    T = np.divide(sums[nodes, MASS + 1], capacity, out=np.zeros(len(nodes)), where=some)
    mapped = heated.velocity[nodes, 0].astype(float)
    flow = sums[nodes, of_force(Line())].astype(float)
    K = equations.conduction()
    holding = [fix for fix in fixes if "post_update_grid_heat" in fix.hooks()]
    fixed, temperatures = (of[:, 0] for of in equations.prescribed(holding, 1))
    free = some & ~fixed
    change = np.where(fixed, temperatures - mapped, 0.0)
    stored = capacity / dt
    balance = flow + stored * (T - mapped)
    A = (K + sp.diags(stored)).tocsr()
    if np.any(free):
        change[free] = direct(A[free][:, free], (balance - K @ change)[free])
    new = mapped + change
    # Fixes get the temperature that nodes would have without fixes, and publish the heat supplied.
    without = new - np.where(fixed, np.divide(
        A @ change - balance, stored, out=np.zeros(len(nodes)), where=some), 0.0)  # fmt: skip
    update[nodes, 0], update[nodes, 1] = without, without - T
    take_rows((HOLD,), s, mode, hooks)
    update[nodes, 0], update[nodes, 1] = new, new - T
    take_rows((WARM._replace(reported=None),), s, mode, hooks)
