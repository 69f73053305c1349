"""Semi-implicit scheme: explicit soil, pore pressure at the end of the step."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.node_updates import UpdateToVelocity
from karamelo_py.kernels.equations.pore_cells import CellGrowth, CellSums
from karamelo_py.kernels.equations.pore_pressure import CellPressures, NodeResponse
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.table import NodeTask, any_node
from karamelo_py.language.rules import Restrictions
from karamelo_py.schemes.traits import SchemeTraits
from karamelo_py.schemes.usl import USL


class SemiImplicit(NamedTuple):
    """Solve for the pore pressure at the end of each step, so that only the dry soil limits it.

    The soil is explicit, as in usl; drag and pressure of the water are implicit (Kularathna et al.
    2021). The pressure, one value per cell, is found by conjugate gradients. The stable step is 0.9
    h/c with the wave speed c of the dry soil, or 0.55 h/c with one point per cell: 20 times the
    step of musl in water-saturated soil of 10 MPa. The limit of usl applies if a solid has no
    water, or water with a K/n below the modulus of the soil.

    Waves in the water are damped. Results are the same as with musl for consolidation, seepage, and
    loads that take longer than a wave in the dry soil takes to cross the ground. For consolidation
    over days or years, use quasi-static.

    Volumes change with the cells, not point by point, so undrained soil does not lock. Use ulmpm
    with quadratic-spline for soil that fails and spreads.

    Example
    -------
    scheme(semi-implicit)

    Notes
    -----
    The scheme needs a material with pore_water; scenes are in 1D, plane strain or 3D, with linear
    also axisymmetric or cylindrical. Nodes of fix seepage_face remain open or closed for a step, by
    the pressure at its beginning. Not supported: bounds and friction in velocity_nodes; fixes
    local_damping, absorbing and ground_motion; velocity_particles on soil; ``--ranks`` and
    ``--gpu``.

    See Also
    --------
    pore_water, musl, quasi-static
    """

    traits = SchemeTraits(
        courant=(0.9, 0.55),
        courant_of_dry=USL.traits.courant,
        damps=True,
        damping=lambda scheme: "the pore pressure of the end of the step",
        solves_pressure=True,
        restrictions=Restrictions(
            "semi-implicit", "scheme(musl)",
            without=("single", "ranks", "gpu", "periodic", "yielding walls", "rigid"),
            but={"tools": "scheme(musl), or the scene without this fix"},
        ),
    )  # fmt: skip
    node_fields = (CellSums, CellPressures, CellGrowth, NodeResponse)
    rows = (
        table.BEGIN,
        table.SUMS,
        *table.ACCELERATE,
        NodeTask(UpdateToVelocity, make=any_node),
        *table.MOVE,
        table.Gather(Strain()),
        table.END,
    )
