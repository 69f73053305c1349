"""USL: update stress last (Sulsky et al. 1994; Sinaie et al. 2017)."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.node_updates import SquaredMass, UpdateToVelocity
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.equations.transfer_loss import LossOfStrain
from karamelo_py.kernels.table import NodeTask, any_node, light_node
from karamelo_py.language.rules import known_failure
from karamelo_py.points.transfers import gradient_weight
from karamelo_py.schemes.musl import MUSL
from karamelo_py.schemes.traits import SchemeTraits

LIMITED = NodeTask(UpdateToVelocity, make=light_node)


class USL(NamedTuple):
    """Update the stress after the forces, with the gradient of the updated nodal velocity.

    This is the fastest scheme, with one pass over the points per step. USL is slightly dissipative.

    The stable step is 0.65 h/c, or 0.4 h/c with one point per cell; with bernstein-quadratic it is
    30 % shorter. Points do not retain the velocity of some nodal modes; the strain of these modes
    is multiplied by 1 - (w dt)^2 in each step, so they are stable for w dt < sqrt(2) instead of 2.
    With PolyPIC in tlmpm, points retain all modes, and the stable step is h/c.

    A node with almost no mass may get a large velocity. If its mass is below a limit, the mean mass
    of the points around it times d (c dt / h)^2 (at most 1), its velocity change is multiplied by
    mass / limit in the velocity gradient. Momentum is conserved.

    With fix velocity_particles on deformable points, musl is used instead of usl.

    Example
    -------
    scheme(usl)
    """

    traits = SchemeTraits(courant=(0.65, 0.4), damps=True, leading=MUSL(), loss=LossOfStrain)
    node_fields = (SquaredMass,)
    rows = (
        table.BEGIN,
        table.SUMS,
        *table.ACCELERATE,
        LIMITED,
        table.SERIES,
        *table.MOVE,
        table.Gather(Strain()),
        table.END,
    )


def _thin_edges(scheme, scene):
    boxes = scene.basis.traits.steep_edge and scene.basis.traits.cells > 1
    return scene.moments and boxes and not gradient_weight.defined(type(scene.transfer))


known_failure(
    USL,
    "affine noise",
    when=_thin_edges,
    reason="{scene.transfer_name} with the basis {scene.basis_name} and usl: at some positions "
    "the moments of points at an edge act on nodes with almost no mass, and a body breaks "
    "within two periods",
    cure="scheme(musl), or a spline basis",
)

known_failure(
    USL,
    "light next to heavy",
    when=lambda scheme, scene: scene.uneven.courant > 0,
    reason="solid '{scene.uneven.heavy}' is {scene.uneven.ratio:.3g} times as dense as solid "
    "'{scene.uneven.light}' next to it. At nodes of little mass that both reach, usl needs a "
    "shorter step: bodies gain energy and break within some thousand steps",
    cure="dt_factor({scene.fraction_of_uneven:.2g}), cpgimp or quadratic-spline",
)


class USLUnlimited(NamedTuple):
    """Scheme usl as first published, without a limit for nodes of small mass.

    A point that has just entered a cell gives the far node almost no mass m but a finite force f.
    The velocity change f dt / m of that node, and the strain increment that the point gets from it,
    are then huge. Use this scheme only for comparison with usl.

    Example
    -------
    scheme(usl/unlimited)
    """

    traits = SchemeTraits(courant=USL.traits.courant, leading=MUSL(), loss=LossOfStrain)
    rows = tuple(
        NodeTask(UpdateToVelocity, make=any_node) if row == LIMITED else row for row in USL.rows
    )
