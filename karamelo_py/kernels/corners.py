"""Gather from and scatter to the corners of domains, each in the place of a node.

The functions of CPDI are sums over corners, N_I = sum_c w_c N_I^lin(x_c). What takes the weight or
the gradient of a node once, as a factor, is therefore done with the few corners: a corner shows
what the nodes around it have, and shares out among them what it is given.
"""

from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import g2p, p2g
from karamelo_py.kernels.loss import EnergyLoss
from karamelo_py.points.basis import carried, support
from karamelo_py.points.basis.cpdi import AtCorners
from karamelo_py.points.basis.cpdi.block import InBlock
from karamelo_py.points.transfers import add_moment, gradient_weight, nodal_momentum


@shared
def by_corners(part, w):
    """Tell whether a task or quantity takes the weight or gradient of a node once, as a factor.

    Those that do say so by `not_at_corners`: with what in the visit they do not. Moments are of the
    velocities and places of nodes.
    """
    unless = getattr(type(part), "not_at_corners", None)
    if unless is None:
        return False
    asked = add_moment, nodal_momentum, gradient_weight
    moments = any(function.defined(type(w.transfer)) for function in asked)
    loss = field(w.nodes.fields, EnergyLoss) is not None
    return not ("moments" in unless and moments) and not ("loss" in unless and loss)


@shared
def all_by_corners(parts, w):
    """Return True if all tasks or quantities of a visit go by corners."""
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
    """Return True if the visit needs the velocities of the corners themselves."""
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
