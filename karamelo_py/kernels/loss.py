"""Kinetic energy that a transfer takes, given back as heat to laws that have an internal energy.

A point p of mass m gives a node i the velocity a_ip = v_p + what its moment adds there, with the
weight N_ip m. The nodes store the mean v_i, and lose sum_p N_ip m |a_ip - v_i|^2 / 2: never
negative. The node stores it per mass, and points take it back by their weights, conserving it.
On the way back points retain the mean and the moment of v_i, and m sum_i N_ip |v_i - v_p|^2 / 2,
less what the moment holds, is gone at the point. FLIP, v -> alpha v + (1 - alpha) P v with P to the
nodes and back, loses 1 - alpha^2 of the first sum and (1 - alpha)^2 of the second.

For AFLIP and its kin these are the sums with their moments, and what is left out, the energy of the
moments themselves, comes and goes: moments follow the velocity. XPIC leaves Q^m v of v, with Q =
1 - P, and loses <v, Q^m v> - |Q^m v|^2 / 2. With r_k = Q^k v and w_k = S+ r_k, the terms of its
series, this is half of |r_q|^2 + sum_(k >= q) |S w_k|^2 + 2 sum_(k >= [m/2]) sum_i N_ip
|w_ki - S w_k|^2, q = [(m+1)/2]: each part is local, and never negative.

The change dv by forces is no part of this. What forces give to velocities that points do not take
does not strain the points either, if the strain is from the points' velocity mapped again
(musl): there is nothing to give back, and a hot point alone in its cells would heat itself by that.
Apart from time integration, the remainder is that moments are mapped a little differently after a
move (not with splines), and that usl strains by dv, which may only cost.
"""

from karamelo_py.compiler import fields
from karamelo_py.compiler.compile import accumulate, real, where
from karamelo_py.kernels.arrays import of_change, vector_at
from karamelo_py.kernels.visit import law_and_state, nodes_of, straining_node
from karamelo_py.points import laws, transfers
from karamelo_py.points.basis import support
from karamelo_py.points.transfers.xpic import Reflected, Series

# Fraction of the mass at its nodes above which a point loses its moment, per dimension:
# for one point per cell, on nodes, it is 0.594 with quadratic splines, and less for other bases.
ALONE = 0.6


class EnergyLoss(fields.SummedField):
    """Kinetic energy brought to a node; the part that it dissipates, per mass; and its mass.

    A fused step brings the energy and mass of the next step while points take back the loss.
    """

    shape = fields.triple


class FrictionalHeat(fields.StepField):
    """Heat of friction at a node, per mass: of contact between solids and of walls."""


def warm_node(rubbed, n, heat):
    """Add `heat` per mass to a node, where the array is there for it."""
    if rubbed is not None:
        rubbed[n, 0] += heat


def warm_by_friction(rubbed, w, stencil, p, like):
    """Give point `p` the heat of friction at its nodes by its weights: none is lost."""
    if rubbed is not None:
        law, state = law_and_state(w, p)
        heat = like - like
        for i, weight, _ in nodes_of(w, stencil):
            heat += weight * rubbed[i, 0]
        capacity = laws.heat_capacity(law, like)
        warms = capacity > 0
        rise = where(warms, heat, like - like) / where(warms, capacity, real(1, like))
        T = laws.temperature(law, w.kin, state) + rise
        fields.store(w.points.state, p, laws.with_temperature(law, w.kin, state, T))


def energy_of(mass, momentum):
    """|momentum|^2 / (2 mass); 0 without mass."""
    least = real(1e-36, mass)
    return where(mass > least, 0.5 * momentum.squared() / max(mass, least), mass - mass)


def bring_energy(lost, i, mass, momentum):
    """Give node `i` the energy of what a point gives it, where the array `lost` is there for it."""
    if lost is not None:
        accumulate(lost, i, 0, (energy_of(mass, momentum),))


def warm(w, stencil, p, v):
    """Give point `p` as heat what it has lost on the way to the nodes and back.

    `v` is the velocity of the nodes at the point, before the update.
    """
    lost = fields.field(w.nodes.fields, EnergyLoss)
    reflected = fields.field(w.points.fields, Reflected)
    if lost is not None:
        moment = _moment_before(w, stencil, v, transfers.zero_moment(w.transfer, w.kin, v[0]))
        moment = in_company(w, stencil, p, moment)
        _heat(w, p, _gone(lost, w, stencil, v, moment))
    if reflected is not None:
        last = gathered_term(w, stencil, v - v)
        reflect(reflected, w, stencil, p, last, w.transfer.order - 1)
        _heat(w, p, reflected[0, p])


def in_company(w, stencil, p, moment):
    """Return the part of `moment` that point `p` of a gas retains: none if it is alone.

    Nodes of no other point return what it gave them: its moment would persist, driven by
    its own pressure, and its volume grow without bounds, whatever the room around it. The energy of
    the rest heats it.
    """
    lost = fields.field(w.nodes.fields, EnergyLoss)
    if lost is None or len(moment) == 0:
        return moment
    mass = w.points.mass[p]
    one = real(1, mass)
    kept = (one - _own_share(lost, w, stencil, mass)) / real(1 - ALONE**w.kin.dimension, mass)
    return max(min(kept, one), mass - mass) * moment


def _own_share(lost, w, stencil, mass):
    """Return the weighted fraction of the mass at its nodes that a point of this mass has."""
    share = mass - mass
    for i, weight, _ in nodes_of(w, stencil):
        share += weight * weight * mass / max(lost[i, 2], real(1e-36, mass))
    return share


def _heat(w, p, gone):
    """Give point `p` the energy per mass that is gone."""
    law, state = law_and_state(w, p)
    fields.store(
        w.points.state, p, laws.warmed(law, w.kin, state, gone / laws.specific_volume(law))
    )


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
        rest = v._make(where(k == 0, (*v,), before[1:])) - term
        gone = where(k == 0, none, before[0])
        gone += where(2 * k >= order - 1, one, none) * _spread(w, stencil, term)
        gone += where(2 * k >= order, half, none) * term.squared()
        gone += where((order + 1) // 2 == k + 1, half, none) * rest.squared()
        fields.store(reflected, p, (gone, *rest))


def gathered_term(w, stencil, term):
    """Gather the present term of XPIC's series at a point."""
    for i, weight, _ in nodes_of(w, stencil):
        term = term + weight * term_at(w, i, term)
    return term


def _spread(w, stencil, term):
    """Sum N_i |w_i - term|^2 of the present term w of XPIC's series."""
    spread = term[0] - term[0]
    for i, weight, _ in nodes_of(w, stencil):
        spread += weight * (term_at(w, i, term) - term).squared()
    return spread


def term_at(w, i, like):
    """Return the present term of XPIC's series at a node."""
    return vector_at(w.kin, fields.field(w.nodes.fields, Series), i, 0, like)


def _before(w, i, like):
    """Return the velocity of a node before the update."""
    v = vector_at(w.kin, w.nodes.update, i, 0, like)
    return v - vector_at(w.kin, w.nodes.update, i, of_change(w.kin), like)


def _moment_before(w, stencil, v, moment):
    """Gather the moment of the velocity that the nodes had before the update."""
    nodes = [straining_node(w, stencil, k) for k in range(support(w.basis, w.kin))]
    for k, (i, N, grad_N) in enumerate(nodes):
        u = _before(w, i, v)
        moment = transfers.add_moment(
            w.transfer, w.kin, w.basis, w.grid, stencil, k, N, grad_N, u, moment
        )
    return moment


def _gone(lost, w, stencil, v, moment):
    """Find the kinetic energy per mass that a point lost at the nodes and on the way back."""
    gone = v[0] - v[0]
    there, here = transfers.lost_shares(w.transfer, gone)
    one = real(1, gone)
    for k, (i, N, _) in enumerate(nodes_of(w, stencil)):
        mine = transfers.nodal_momentum(
            w.transfer, w.kin, w.basis, w.grid, stencil, k, N, one, v - v, moment
        )
        apart = 0.5 * N * (_before(w, i, v) - v).squared()
        gone += there * N * lost[i, 1] + here * (apart - energy_of(N, mine))
    return gone
