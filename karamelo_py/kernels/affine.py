"""What points give to nodes as N_I times an affine field: mass, momentum, and the force of MLS.

In lanes such a quantity is brought into the order of the nodes' records once a point, not once a
node: half of the work of a scatter, in space two thirds.
"""

from karamelo_py.compiler.compile import point_function, real, shared
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.lanes import EightLanes, FourLanes
from karamelo_py.compiler.lanes.records import accumulate_affine
from karamelo_py.compiler.tuples import add, add_scaled, nested_as, scale
from karamelo_py.kernels import p2g
from karamelo_py.kernels.arrays import MASS, of_force
from karamelo_py.kernels.averaging import NodalStress
from karamelo_py.kernels.g2p import Move, update_at, zero_vector
from karamelo_py.kernels.loss import EnergyLoss
from karamelo_py.kernels.visit import for_tags
from karamelo_py.points.basis import entry, reach, support
from karamelo_py.points.basis.product import inverse_spread, spacing
from karamelo_py.points.frames import force_columns
from karamelo_py.points.kinematics import columns, dimension, from_columns, planar
from karamelo_py.points.transfers import add_momentum, affine_velocity, by_arms, forces_by_arms


@point_function(otherwise=True)
def affine_part(quantity, w, stencil, load):
    """(array, first component, value at the first node, growths from node to node) of a quantity.

    One growth for each direction, or none where all nodes see the same. () for what is not affine.
    """
    return ()


@shared
def _lacks(w, kinds):
    """Whether the nodes have none of these fields."""
    return not any(field(w.nodes.fields, kind) is not None for kind in kinds)


@shared
def _affine(w, stencil, value, growths):
    """Value at the first node, and growth a node, of `value` at the point and growths a length."""
    arm = reach(w.basis, w.kin, w.grid, stencil, 0)
    for growth, way in zip(growths, arm, strict=True):
        value = add_scaled(value, way, growth)
    step = w.grid.h * spacing(w.basis, value[0])
    return value, tuple([scale(step, growth) for growth in growths])


@shared
def _momentum(w, stencil, mass, v, moment):
    """The momentum at the first node, and its growth; () where nobody knows."""
    momentum = scale(mass, v)
    if not len(moment):
        return () if add_momentum.defined(type(w.transfer)) else (momentum, ())
    c = affine_velocity(w.transfer, moment, inverse_spread(w.basis, w.grid))
    if not len(c):
        return ()
    return _affine(w, stencil, momentum, columns(planar(w.kin), scale(mass, c)))


@affine_part.on(p2g.MassMomentum)
def _affine_part_mass_momentum(quantity, w, stencil, load):
    mass, v, moment, _, _ = load
    given = _momentum(w, stencil, mass, v, moment)
    if not (
        len(given)
        and _lacks(w, (EnergyLoss, p2g.RigidSums, p2g.Centre, p2g.Normal, p2g.SquaredMass))
    ):
        return ()
    momentum, growths = given
    return w.nodes.sums, MASS, (mass, *momentum), tuple([(mass - mass, *g) for g in growths])


@affine_part.on(p2g.MomentumAgain)
def _affine_part_momentum_again(quantity, w, stencil, load):
    given = _momentum(w, stencil, *load)
    return (w.nodes.velocity, 0, *given) if len(given) else ()


@affine_part.on(p2g.InternalForce)
def _affine_part_internal_force(quantity, w, stencil, load):
    inverse_d = inverse_spread(w.basis, w.grid)
    if not (len(inverse_d) and forces_by_arms(w.transfer, w.kin) and _lacks(w, (NodalStress,))):
        return ()
    stress, outer, _ = load
    own = outer if len(outer) else zero_vector(w.kin, stress[0])
    growths = [scale(inverse_d[0], c) for c in force_columns(w.frame, w.kin, stress)]
    return w.nodes.sums, of_force(w.kin), *_affine(w, stencil, own, tuple(growths))


@shared
def _beside(a, b):
    """`b` behind `a` and zeros, from the fifth component on."""
    return (*a, *((a[0] - a[0],) * (4 - len(a))), *b)


@point_function(otherwise=True)
def joined(width, kin, parts):
    """Momentum and force as one part, where both grow and a register takes both."""
    return parts


@joined.on(FourLanes)
@joined.on(EightLanes)
def _joined_eights(width, kin, parts):
    if len(parts) != 2 or of_force(kin) != 4:
        return parts
    array, first, a, to_a = parts[0]
    _, _, b, to_b = parts[1]
    of_sums = len(a) == 1 + dimension(kin) and len(b) == dimension(kin)
    if not (of_sums and len(to_a) and len(to_b)):
        return parts
    growths = [_beside(x, y) for x, y in zip(to_a, to_b, strict=True)]
    return ((array, first, _beside(a, b), tuple(growths)),)


@shared
def give_affine(width, w, stencil, parts):
    """Give the nodes of a stencil what is affine."""
    seen = [entry(w.basis, w.kin, w.grid, stencil, k)[:2] for k in range(support(w.basis, w.kin))]
    nodes, weights = tuple([node for node, _ in seen]), tuple([weight for _, weight in seen])
    for array, first, value, growths in joined(width, w.kin, parts):
        accumulate_affine(array, nodes, first, weights, value, growths)


@shared
def gathered_by_arms(w):
    """(a,), where what a point keeps is a sum_I N_I v*_I (X_I - x)^T away from walls; else ()."""
    return by_arms(w.transfer, inverse_spread(w.basis, w.grid))


@point_function(otherwise=True)
def gathered_at_once(task, w, stencil, total):
    """What a gather sums up over all nodes of a stencil; () where that goes node by node."""
    return ()


@gathered_at_once.on(Move)
def _gathered_at_once_move(task, w, stencil, total):
    factor = gathered_by_arms(w)
    if not len(factor):
        return ()
    nodes = [entry(w.basis, w.kin, w.grid, stencil, k)[0] for k in range(support(w.basis, w.kin))]
    found = [update_at(w.kin, w.nodes, i, total[0]) for i in nodes]
    # sum N v (X - x)^T from sum N v and sum N v k, X being k nodes from the first: of rows, then of
    # planes, as the weights are products.
    sums = tuple([(v,) for v, _ in found])
    changes = tuple([dv for _, dv in found])
    for line in reversed(stencil.lines):
        rows = range(0, len(sums), len(line.weights))
        sums = tuple([_with_moment(line.weights, sums[k:]) for k in rows])
        changes = tuple([_tails(line.weights, changes[k:])[-1] for k in rows])
    v, *moments = sums[0]
    arm = reach(w.basis, w.kin, w.grid, stencil, 0)
    step = w.grid.h * spacing(w.basis, arm[0])
    pairs = zip(moments, arm, strict=True)
    moment = from_columns(
        planar(w.kin), tuple([add_scaled(scale(step, m), way, v) for m, way in pairs])
    )
    moment = scale(real(factor[0], step), moment)
    return v, add(total[1], changes[0]), nested_as(total[2], moment)


@shared
def _tails(weights, vectors):
    """Sums of weights times vectors: of the last one, of the last two, ... of all."""
    last = len(weights) - 1
    sums = (scale(weights[last], vectors[last]),)
    for k in range(last - 1, -1, -1):
        sums = (*sums, add_scaled(sums[-1], weights[k], vectors[k]))
    return sums


@shared
def _with_moment(weights, row):
    """Of the sums of the nodes of a row: the sum of the first, and k times that; all the others."""
    first, *others = zip(*row[: len(weights)], strict=True)
    *tails, total = _tails(weights, first)
    return total, _sum(tuple(tails)), *[_tails(weights, other)[-1] for other in others]


@shared
def _sum(vectors):
    total = vectors[0]
    for vector in vectors[1:]:
        total = add(total, vector)
    return total


gathered_at_once_all = for_tags(gathered_at_once, "w, stencil, totals", each="totals")
affine_parts = for_tags(affine_part, "w, stencil, loads", each="loads")
