"""What is gathered and given at the corners of domains, each in the place of a node.

The functions of CPDI are sums over corners, N_I = sum_c w_c N_I^lin(x_c). What takes the weight or
the gradient of a node once, as a factor, is therefore done with the few corners: a corner shows
what the nodes around it have, and shares out among them what it is given.
"""

from karamelo_py.compiler.compile import point_function, shared
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import g2p, p2g
from karamelo_py.kernels.loss import EnergyLoss
from karamelo_py.points.basis import carried, support
from karamelo_py.points.basis.cpdi.block import InBlock
from karamelo_py.points.basis.cpdi.corners import AtCorners
from karamelo_py.points.transfers import add_moment, add_momentum, gradient_weight


@point_function(otherwise=True)
def by_corners(part, w):
    """Whether a task or quantity takes the weight or the gradient of a node once, as a factor."""
    return False


def _always(part, w):
    return True


def _without_moments(part, w):
    """Moments are of the velocities and places of nodes."""
    asked = add_moment, add_momentum, gradient_weight
    return not any(function.defined(type(w.transfer)) for function in asked)


for _part in (g2p.SetMeanStress, g2p.SeriesTerm, p2g.Volumes, p2g.SeriesBack):
    by_corners.on(_part)(_always)
for _part in (
    g2p.Move, g2p.Strain, g2p.StrainOfLastStep, g2p.SecondStrain, g2p.StrainInMove, g2p.TrialStrain,
    g2p.TrialStrainOfLastStep, p2g.InternalForce, p2g.AveragedForce, p2g.MomentumAgain,
):  # fmt: skip
    by_corners.on(_part)(_without_moments)


@by_corners.on(p2g.MassMomentum)
def _by_corners_mass_momentum(part, w):
    return _without_moments(part, w) and field(w.nodes.fields, EnergyLoss) is None


@shared
def all_by_corners(parts, w):
    """Whether all tasks or quantities of a visit do."""
    return all(by_corners(part, w) for part in parts)


@shared
def _seeing(basis, w):
    """The work with something in the place of the basis."""
    items = zip(w._fields, w, strict=True)
    return type(w)(*[basis if name == "basis" else item for name, item in items])


@shared
def in_block(w):
    """The work of points that see blocks of nodes."""
    return _seeing(InBlock(w.basis), w)


@shared
def shows_corners(tasks, w):
    """Whether the velocities of the corners themselves are asked for."""
    return carried(w.basis, w.kin) > 0 and any(isinstance(task, g2p.Move) for task in tasks)


@shared
def gather_corners(tasks, w, stencil, totals):
    """The totals of the tasks over all corners."""
    at = _seeing(AtCorners(w.basis), w)
    for c in range(support(at.basis, w.kin)):
        totals = g2p.gathered_all(tasks, at, stencil, c, totals)
    return totals


@shared
def scatter_corners(quantities, w, stencil, loads):
    """Give all corners their parts."""
    at = _seeing(AtCorners(w.basis), w)
    for c in range(support(at.basis, w.kin)):
        p2g.scattered_all(quantities, at, stencil, c, loads)
