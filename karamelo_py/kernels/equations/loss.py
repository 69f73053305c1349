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

from collections import namedtuple
from typing import NamedTuple

from karamelo_py.compiler.compile import real, round_off, where
from karamelo_py.compiler.fields import StepField, SummedField, field, load, scalar, store, triple
from karamelo_py.compiler.tuples import clear_first
from karamelo_py.kernels.arrays import MASS, of_momentum, vector_at
from karamelo_py.kernels.equations import whole
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.points import laws, transfers
from karamelo_py.points.transfers.xpic import Reflected, Series

OnePoint = namedtuple("OnePoint", "mass v moment")  # for `transfers.nodal_momentum`
# Fraction of the mass at its nodes above which a point loses its moment, per dimension:
# for one point per cell, on nodes, it is 0.594 with quadratic splines, and less for other bases.
ALONE = 0.6


class EnergyLoss(SummedField):
    """Kinetic energy brought to a node; the part that it dissipates, per mass; and its mass.

    A fused step brings the energy and mass of the next step while points take back the loss.
    """

    shape = triple


BROUGHT = whole(EnergyLoss, scalar)


class FrictionalHeat(StepField):
    """Heat of friction at a node, per mass: of contact between solids and of walls."""


@node_task
class KeepLoss(NamedTuple):
    """Energy loss of a node: kinetic energy from points minus its own kinetic energy."""

    goes_through = ("sums", "energy loss", "energy loss")

    def at_node(task, kin, nodes, n, dt):
        """Store, per mass, the energy from points that the node does not have."""
        lost, mass = field(nodes.fields, EnergyLoss), nodes.sums[n, MASS]
        if mass > 0:
            one = real(1, mass)
            factor = one / mass
            kinetic = mass - mass
            for k in range(kin.dimension):
                v = nodes.sums[n, of_momentum(kin) + k] * factor
                kinetic += real(0.5, mass) * v * v
            # Of bodies that fly as one, the difference is round-off of either sign, and no heat.
            noise = real(8, mass) * round_off(mass) * kinetic
            lost[n, 1] = max(lost[n, 0] * factor - kinetic - noise, mass - mass)
            lost[n, 2] = mass


@node_task
class ClearFrictionalHeat(NamedTuple):
    """Heat of friction starts from zero."""

    goes_through = ("frictional heat",)

    def at_node(task, kin, nodes, n, dt):
        clear_first(field(nodes.fields, FrictionalHeat), n)


def warm_node(rubbed, n, heat):
    """Add `heat` per mass to a node, where the array is there for it."""
    if rubbed is not None:
        rubbed[n, 0] += heat


def warm_by_friction(pt):
    """Give a point the heat of friction at its nodes by its weights: none is lost."""
    rubbed = field(pt.w.nodes.fields, FrictionalHeat)
    if rubbed is not None:
        (law, state), like = pt.law_and_state, pt.v[0]
        heat = like - like
        for node in pt.nodes:
            heat += node.N * rubbed[node.i, 0]
        capacity = laws.heat_capacity(law, like)
        warms = capacity > 0
        rise = where(warms, heat, like - like) / where(warms, capacity, real(1, like))
        T = laws.temperature(law, pt.kin, state) + rise
        store(pt.w.points.state, pt.p, laws.with_temperature(law, pt.kin, state, T))


def energy_of(mass, momentum):
    """|momentum|^2 / (2 mass); 0 without mass."""
    least = real(1e-36, mass)
    return where(mass > least, 0.5 * momentum.squared() / max(mass, least), mass - mass)


def warm(pt, v):
    """Give a point as heat what it has lost on the way to the nodes and back.

    `v` is the velocity of the nodes at the point, before the update.
    """
    if field(pt.w.nodes.fields, EnergyLoss) is not None:
        moment = transfers.zero_moment(pt.w.transfer, pt.kin, v[0])
        for node in pt.nodes:
            moment = transfers.add_moment(pt.w.transfer, node, _before(node, v), moment)
        _heat(pt, _gone(pt, v, in_company(pt, moment)))
    if pt.of(Reflected) is not None:
        last = v - v
        for node in pt.nodes:
            last = last + node.N * term_at(node, last)
        reflect(pt, last, pt.w.transfer.order - 1)
        _heat(pt, pt.of(Reflected)[0, pt.p])


def in_company(pt, moment):
    """Return the part of `moment` that a point of a gas retains: none if it is alone.

    Nodes of no other point return what it gave them: its moment would persist, driven by
    its own pressure, and its volume grow without bounds, whatever the room around it. The energy of
    the rest heats it.
    """
    lost = field(pt.w.nodes.fields, EnergyLoss)
    if lost is None or len(moment) == 0:
        return moment
    mass = pt.w.points.mass[pt.p]
    one, share = real(1, mass), mass - mass
    for node in pt.nodes:  # the point's fraction of the mass of its nodes
        share += node.N * node.N * mass / max(lost[node.i, 2], real(1e-36, mass))
    kept = (one - share) / real(1 - ALONE**pt.kin.dimension, mass)
    return max(min(kept, one), mass - mass) * moment


def _heat(pt, gone):
    """Give a point the energy per mass that is gone."""
    law, state = pt.law_and_state
    warmed = laws.warmed(law, pt.kin, state, gone / laws.specific_volume(law))
    store(pt.w.points.state, pt.p, warmed)


def reflect(pt, term, k):
    """Take `term`, the k-th of XPIC's series at a point, from what is not in the series yet.

    And add up the energy that this loses (see the head of the module).
    """
    reflected = pt.of(Reflected)
    if reflected is not None:
        v = pt.v
        like = v[0]
        none, half, one = real(0, like), real(0.5, like), real(1, like)
        before = load(reflected, pt.p, (like, *v))
        order = pt.w.transfer.order
        rest = v._make(where(k == 0, (*v,), before[1:])) - term
        gone = where(k == 0, none, before[0])
        gone += where(2 * k >= order - 1, one, none) * _spread(pt, term)
        gone += where(2 * k >= order, half, none) * term.squared()
        gone += where((order + 1) // 2 == k + 1, half, none) * rest.squared()
        store(reflected, pt.p, (gone, *rest))


def _spread(pt, term):
    """Sum N_i |w_i - term|^2 of the present term w of XPIC's series."""
    spread = term[0] - term[0]
    for node in pt.nodes:
        spread += node.N * (term_at(node, term) - term).squared()
    return spread


def term_at(node, like):
    """Return the present term of XPIC's series at a node."""
    return vector_at(node.kin, node.of(Series), node.i, 0, like)


def _before(node, like):
    """Return the velocity of a node before the update."""
    v, dv = node.v_star(like)
    return v - dv


def _gone(pt, v, moment):
    """Find the kinetic energy per mass that a point lost at the nodes and on the way back."""
    gone, lost = v[0] - v[0], field(pt.w.nodes.fields, EnergyLoss)
    there, here = transfers.lost_shares(pt.w.transfer, gone)
    unit = OnePoint(real(1, gone), v - v, moment)
    for node in pt.nodes:
        mine = transfers.nodal_momentum(pt.w.transfer, unit, node)
        apart = 0.5 * node.N * (_before(node, v) - v).squared()
        gone += there * node.N * lost[node.i, 1] + here * (apart - energy_of(node.N, mine))
    return gone
