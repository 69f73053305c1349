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
    """Solve for the pore pressure at the end of each step, so that only the dry soil limits it.

    Soil with `pore_water` is explicit, as in usl. The pressure of the water at the end of the step
    is solved for on the grid, by conjugate gradients, and the drag is implicit (fractional step;
    Kularathna et al. 2021). The stable step is 0.65 h/c with the wave speed c of the dry soil (0.4
    h/c with one point per cell), about 15 times the step of musl in water-saturated soil of 10 MPa.

    Fast waves of the water are damped. Compared with musl, consolidation, seepage and loads that
    take longer than a wave through the ground have the same results. Slower processes than those
    of this scheme need quasi-static.

    Water may enter and leave through nodes of fix pore_pressure; nodes of seepage_face, too, are
    open for a whole step if they are open at its beginning.

    Example
    -------
    scheme(semi-implicit)

    Notes
    -----
    Method tlmpm with FLIP or PIC and linear. Not supported: processes (``--ranks``), GPUs, bounds
    and friction of velocity_nodes, fixes that change velocities after forces (local_damping), and
    velocity_particles on soil.

    See Also
    --------
    pore_water, musl, quasi-static
    """

    traits = SchemeTraits(
        courant=(0.65, 0.4),
        damps=True,
        damping=lambda scheme: "the pore pressure of the end of the step",
        solves_pressure=True,
        restrictions=Restrictions(
            "semi-implicit", "scheme(musl)",
            only={"method": ("tlmpm",), "basis": ("linear",)},
            without=("single", "ranks", "gpu", "periodic", "yielding walls", "tools", "rigid"),
        ),
    )  # fmt: skip
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
