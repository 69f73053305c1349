"""Kinetic energy that a transfer takes, given back as heat to laws that have an internal energy.

A point p of mass m gives a node i the velocity a_ip = v_p + what its moment adds there, with the
weight N_ip m. The nodes keep the mean v_i, and sum_p N_ip m |a_ip - v_i|^2 / 2 is gone there: never
negative. The node keeps it per mass, and points take it back by their weights, which conserves it.
On the way back points keep of v_i its mean and its moment, and m sum_i N_ip |v_i - v_p|^2 / 2, less
what the moment holds, is gone at the point. FLIP, v -> alpha v + (1 - alpha) P v with P to the
nodes and back, loses 1 - alpha^2 of the first sum and (1 - alpha)^2 of the second.

For AFLIP and its kin these are the sums with their moments, and what is left out, the energy of the
moments themselves, comes and goes: moments follow the velocity. XPIC leaves Q^m v of v, with Q =
1 - P, and loses <v, Q^m v> - |Q^m v|^2 / 2. With r_k = Q^k v and w_k = S+ r_k, the terms of its
series, this is half of |r_q|^2 + sum_(k >= q) |S w_k|^2 + 2 sum_(k >= [m/2]) sum_i N_ip
|w_ki - S w_k|^2, q = [(m+1)/2]: each part is local, and never negative.

The change dv by forces is no part of this. What forces give to velocities that points do not take
does not strain the points either, where the strain is that of the points' velocity mapped again
(musl): there is nothing to give back, and a hot point alone in its cells would heat itself by that.
Beside the time integration, what is left is that moments are mapped a little differently after a
move (not with splines), and that usl strains by dv, which may only cost.
"""

from karamelo_py.compiler import fields
from karamelo_py.compiler.compile import accumulate, choose, looping, real, round_off, shared
from karamelo_py.compiler.tuples import add_scaled, row, scale, subtract
from karamelo_py.kernels.arrays import MASS, of_change, of_momentum
from karamelo_py.kernels.visit import law_of, state_of
from karamelo_py.points.basis import entry, support
from karamelo_py.points.kinematics import dimension
from karamelo_py.points.laws import (
    heat_capacity,
    specific_volume,
    temperature,
    warmed,
    with_temperature,
)
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    gradient_weight,
    lost_shares,
    zero_moment,
)
from karamelo_py.points.transfers.xpic import Reflected, Series

# Share of the mass at its nodes from where on a point loses its moment, to the power of dimensions:
# of points one a cell that stand on nodes it is 0.594 with quadratic splines, and less of others.
ALONE = 0.6


class EnergyLoss(fields.SummedField):
    """Kinetic energy brought to a node; the part that it dissipates, per mass; and its mass.

    A fused step brings the energy and mass of the next step while points take back the loss.
    """

    shape = fields.triple


class FrictionalHeat(fields.StepField):
    """Heat of friction at a node, per mass: of contact between solids and of walls."""


@shared
def warm_node(rubbed, n, heat):
    """Add `heat` per mass to a node, where the array is there for it."""
    if rubbed is not None:
        rubbed[n, 0] += heat


@shared
def warm_by_friction(rubbed, w, stencil, p, like):
    """Point `p` takes the heat of friction at its nodes by its weights: none is lost."""
    if rubbed is not None:
        law = law_of(w, p)
        state = state_of(w, law, p, like)
        heat = _heat_of_nodes(rubbed, w, stencil, like)
        capacity = heat_capacity(law, like)
        warms = capacity > 0
        rise = choose(warms, heat, like - like) / choose(warms, capacity, real(1, like))
        T = temperature(law, w.kin, state) + rise
        fields.store(w.points.state, p, with_temperature(law, w.kin, state, T))


@looping
def _heat_of_nodes(rubbed, w, stencil, like):
    heat = like - like
    for k in range(support(w.basis, w.kin)):
        i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
        heat += weight * rubbed[i, 0]
    return heat


@shared
def squared(v):
    """|v|^2."""
    return sum([component * component for component in v])


@shared
def energy_of(mass, momentum):
    """|momentum|^2 / (2 mass); 0 without mass."""
    least = real(1e-36, mass)
    return choose(mass > least, real(0.5, mass) * squared(momentum) / max(mass, least), mass - mass)


@shared
def bring_energy(lost, i, mass, momentum):
    """Give node `i` the energy of what a point gives it, where the array `lost` is there for it."""
    if lost is not None:
        accumulate(lost, i, 0, (energy_of(mass, momentum),))


@shared
def keep_loss(lost, kin, sums, n):
    """In `lost` at node `n`, what it does not keep of the energy it was brought, per mass."""
    mass = sums[n, MASS]
    if mass > 0:
        one = real(1, mass)
        factor = one / mass
        kinetic = mass - mass
        for k in range(dimension(kin)):
            v = sums[n, of_momentum(kin) + k] * factor
            kinetic += real(0.5, mass) * v * v
        # Of bodies that fly as one, the difference is round-off of either sign, and no heat.
        noise = real(8, mass) * round_off(mass) * kinetic
        lost[n, 1] = max(lost[n, 0] * factor - kinetic - noise, mass - mass)
        lost[n, 2] = mass


@shared
def warm(w, stencil, p, v):
    """Give point `p` as heat what it has lost on the way to the nodes and back.

    `v` is the velocity of the nodes at the point, before the update.
    """
    lost = fields.field(w.nodes.fields, EnergyLoss)
    reflected = fields.field(w.points.fields, Reflected)
    if lost is not None:
        moment = _moment_before(w, stencil, v, zero_moment(w.transfer, w.kin, v[0]))
        moment = in_company(w, stencil, p, moment)
        _heat(w, p, _gone(lost, w, stencil, v, moment))
    if reflected is not None:
        last = gathered_term(w, stencil, subtract(v, v))
        reflect(reflected, w, stencil, p, last, w.transfer.order - 1)
        _heat(w, p, reflected[0, p])


@shared
def in_company(w, stencil, p, moment):
    """What point `p` of a gas keeps of the `moment` of its nodes' velocity: none of it alone.

    Nodes that nobody else sees show it what it gave them: its moment would stay for ever, driven by
    its own pressure, and its volume grow without bounds, whatever the room around it. The energy of
    what it does not keep heats it.
    """
    lost = fields.field(w.nodes.fields, EnergyLoss)
    if lost is None or len(moment) == 0:
        return moment
    mass = w.points.mass[p]
    one = real(1, mass)
    kept = (one - _own_share(lost, w, stencil, mass)) / real(1 - ALONE ** dimension(w.kin), mass)
    return scale(max(min(kept, one), mass - mass), moment)


@looping
def _own_share(lost, w, stencil, mass):
    """The share of a point of this mass in what its nodes have, by its weights."""
    share = mass - mass
    for k in range(support(w.basis, w.kin)):
        i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
        share += weight * weight * mass / max(lost[i, 2], real(1e-36, mass))
    return share


@shared
def _heat(w, p, gone):
    """Give point `p` the energy per mass that is gone."""
    law = law_of(w, p)
    state = state_of(w, law, p, gone)
    fields.store(w.points.state, p, warmed(law, w.kin, state, gone / specific_volume(law)))


@shared
def reflect(reflected, w, stencil, p, term, k):
    """Take `term`, the k-th of XPIC's series at point `p`, from what is not in the series yet.

    And add up the energy that this loses (see the head of the module).
    """
    if reflected is not None:
        v = fields.load_vector(w.kin, w.points.v, p)
        like = v[0]
        none, half, one = real(0, like), real(0.5, like), real(1, like)
        before = fields.load(reflected, p, (like, *v))
        order = w.transfer.order
        rest = subtract(choose(k == 0, v, before[1:]), term)
        gone = choose(k == 0, none, before[0])
        gone += choose(2 * k >= order - 1, one, none) * _spread(w, stencil, term)
        gone += choose(2 * k >= order, half, none) * squared(term)
        gone += choose((order + 1) // 2 == k + 1, half, none) * squared(rest)
        fields.store(reflected, p, (gone, *rest))


@looping
def gathered_term(w, stencil, term):
    """The present term of XPIC's series at a point."""
    for k in range(support(w.basis, w.kin)):
        i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
        term = add_scaled(term, weight, row(fields.field(w.nodes.fields, Series), i, 0, term))
    return term


@looping
def _spread(w, stencil, term):
    """sum_i N_i |w_i - term|^2 of the present term w of XPIC's series."""
    spread = term[0] - term[0]
    for k in range(support(w.basis, w.kin)):
        i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
        apart = subtract(row(fields.field(w.nodes.fields, Series), i, 0, term), term)
        spread += weight * squared(apart)
    return spread


@shared
def _before(w, i, like):
    """The velocity of a node before the update."""
    return subtract(row(w.nodes.update, i, 0, like), row(w.nodes.update, i, of_change(w.kin), like))


@looping
def _moment_before(w, stencil, v, moment):
    """What a point would keep beside its velocity of that of the nodes before the update."""
    for k in range(support(w.basis, w.kin)):
        i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
        g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
        u = _before(w, i, v)
        moment = add_moment(w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, g, u, moment)
    return moment


@looping
def _gone(lost, w, stencil, v, moment):
    """Kinetic energy per mass that a point has lost at the nodes and on the way back."""
    none = subtract(v, v)
    gone = none[0]
    there, here = lost_shares(w.transfer, gone)
    for k in range(support(w.basis, w.kin)):
        i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
        gone += _part_gone(lost, w, stencil, k, i, weight, v, moment, there, here)
    return gone


@shared
def _part_gone(lost, w, stencil, k, i, weight, v, moment, there, here):
    none = subtract(v, v)
    one = real(1, none[0])
    held = add_momentum(
        w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, one, none, moment, none
    )
    apart = real(0.5, none[0]) * weight * squared(subtract(_before(w, i, v), v))
    return there * weight * lost[i, 1] + here * (apart - energy_of(weight, held))
