"""Semi-implicit scheme: explicit soil, pore pressure at the end of the step."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.node_updates import UpdateToVelocity
from karamelo_py.kernels.equations.pore_pressure import CellPressures, CellSums, NodeResponse
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.table import NodeTask, any_node
from karamelo_py.language.rules import Restrictions
from karamelo_py.schemes.traits import SchemeTraits


class SemiImplicit(NamedTuple):
    """Solve for the pore pressure at the end of each step: nearly incompressible, slow water.

    Example
    -------
    scheme(semi-implicit)
    """

    traits = SchemeTraits(
        courant=(0.65, 0.4),
        damps=True,
        solves_pressure=True,
        restrictions=Restrictions(
            "semi-implicit", "scheme(musl)",
            only={"basis": ("linear",)},
            without=("single", "ranks", "gpu", "periodic", "yielding walls", "tools", "rigid"),
        ),  # fmt: skip
    )
    node_fields = (CellSums, CellPressures, NodeResponse)
    rows = (
        table.BEGIN,
        table.SUMS,
        *table.ACCELERATE,
        NodeTask(UpdateToVelocity, make=any_node),
        *table.MOVE,
        table.Gather(Strain()),
        table.END,
    )
