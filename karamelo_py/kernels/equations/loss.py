"""Kinetic energy lost in a transfer, returned as heat to laws with internal energy.

A point p of mass m contributes to node i, with weight N_ip m, the velocity a_ip: v_p plus the part
of its moment. Nodes have the mean v_i. The mapping loses sum_p N_ip m |a_ip - v_i|^2 / 2 >= 0,
which is returned to points by the same weights. Back at the points, m sum_i N_ip |v_i - v_p|^2 / 2
minus the moment's energy is lost. FLIP, v -> alpha v + (1 - alpha) P v, where P maps to the nodes
and back, loses the fraction 1 - alpha^2 of the first part and (1 - alpha)^2 of the second; likewise
AFLIP and related transfers, with their moments.

XPIC removes Q^m v, Q = 1 - P, and loses <v, Q^m v> - |Q^m v|^2 / 2. With r_k = Q^k v and the terms
of its series w_k = S+ r_k, this is half of |r_q|^2 + sum_(k >= q) |S w_k|^2 + 2 sum_(k >= [m/2])
sum_i N_ip |w_ki - S w_k|^2, q = [(m+1)/2]: each term is local and >= 0.

The change dv by forces is not included. In musl, which strains by the re-mapped velocity, the part
of dv that points do not take does not strain them, and a hot isolated point would heat itself.
"""

from collections import namedtuple
from typing import NamedTuple

from karamelo_py.compiler import real, round_off, where
from karamelo_py.compiler.fields import StepField, SummedField, field, load, scalar, store, triple
from karamelo_py.kernels.arrays import MASS, of_momentum, vector_at
from karamelo_py.kernels.equations import whole
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.records import clear_first
from karamelo_py.points import laws, transfers
from karamelo_py.points.transfers.xpic import Reflected, Series

OnePoint = namedtuple("OnePoint", "mass v moment")  # for `transfers.nodal_momentum`
# A point with more than this fraction (per dimension) of the mass of its nodes loses its moment.
# With one point per cell, at a node, the fraction is 0.594 with quadratic splines, else less.
ALONE = 0.6


class EnergyLoss(SummedField):
    """Kinetic energy mapped to a node (fused: for the next step), loss per unit mass, and mass."""

    shape = triple


BROUGHT = whole(EnergyLoss, scalar)


class FrictionalHeat(StepField):
    """Frictional heat per unit mass at a node, from contact and walls."""


@node_task
class KeepLoss(NamedTuple):
    goes_through = ("sums", "energy loss", "energy loss")

    def at_node(task, kin, nodes, n, dt):
        lost, mass = field(nodes.fields, EnergyLoss), nodes.sums[n, MASS]
        if mass > 0:
            one = real(1, mass)
            factor = one / mass
            kinetic = mass - mass
            for k in range(kin.dimension):
                v = nodes.sums[n, of_momentum(kin) + k] * factor
                kinetic += real(0.5, mass) * v * v
            # In rigid motion, the difference is round-off of either sign.
            noise = real(8, mass) * round_off(mass) * kinetic
            lost[n, 1] = max(lost[n, 0] * factor - kinetic - noise, mass - mass)
            lost[n, 2] = mass


@node_task
class KeepMass(NamedTuple):
    goes_through = ("sums", "nodal mass")

    def at_node(task, kin, nodes, n, dt):
        field(nodes.fields, transfers.NodalMass)[n, 0] = nodes.sums[n, MASS]


@node_task
class ClearFrictionalHeat(NamedTuple):
    goes_through = ("frictional heat",)

    def at_node(task, kin, nodes, n, dt):
        clear_first(field(nodes.fields, FrictionalHeat), n)


def warm_node(rubbed, n, heat):
    if rubbed is not None:
        rubbed[n, 0] += heat


def warm_by_friction(pt):
    rubbed = field(pt.w.nodes.fields, FrictionalHeat)
    if rubbed is not None:
        (law, state), template = pt.law_and_state, pt.v[0]
        heat = template - template
        for node in pt.nodes:
            heat += node.N * rubbed[node.i, 0]
        capacity = laws.heat_capacity(law, template)
        warms = capacity > 0
        rise = where(warms, heat, template - template) / where(warms, capacity, real(1, template))
        T = laws.temperature(law, pt.kin, state) + rise
        store(pt.w.points.state, pt.p, laws.with_temperature(law, pt.kin, state, T))


def energy_of(mass, momentum):
    least = real(1e-36, mass)
    return where(mass > least, 0.5 * momentum.squared() / max(mass, least), mass - mass)


def warm(pt, v):
    """Heat a point by the energy lost on the way to the nodes and back; `v` is its old velocity."""
    if field(pt.w.nodes.fields, EnergyLoss) is not None:
        moment = transfers.zero_moment(pt.w.transfer, pt.kin, v[0])
        for node in pt.nodes:
            moment = transfers.add_moment(pt.w.transfer, node, _before(node, v), moment)
        _heat(pt, _gone(pt, v, retained_moment(pt, moment)))
    if pt.of(Reflected) is not None:
        last = v - v
        for node in pt.nodes:
            last = last + node.N * term_at(node, last)
        reflect(pt, last, pt.w.transfer.order - 1)
        _heat(pt, pt.of(Reflected)[0, pt.p])


def retained_moment(pt, moment):
    """Return the part of the `moment` that a point of gas retains: none if the point is isolated.

    Nodes without other points would return the whole moment, and the pressure would expand the
    point without bound. The energy of the discarded part becomes heat.
    """
    lost = field(pt.w.nodes.fields, EnergyLoss)
    if lost is None or len(moment) == 0:
        return moment
    mass = pt.w.points.mass[pt.p]
    one, mass_fraction = real(1, mass), mass - mass
    for node in pt.nodes:  # mass fraction of the point at its nodes
        mass_fraction += node.N * node.N * mass / max(lost[node.i, 2], real(1e-36, mass))
    kept = (one - mass_fraction) / real(1 - ALONE**pt.kin.dimension, mass)
    return transfers.fraction(pt.w.transfer, moment, max(min(kept, one), mass - mass))


def _heat(pt, gone):
    law, state = pt.law_and_state
    warmed = laws.warmed(law, pt.kin, state, gone / laws.specific_volume(law))
    store(pt.w.points.state, pt.p, warmed)


def reflect(pt, term, k):
    """Subtract the k-th `term` of XPIC's series from the remainder, and sum the energy lost."""
    reflected = pt.of(Reflected)
    if reflected is not None:
        v = pt.v
        template = v[0]
        none, half, one = real(0, template), real(0.5, template), real(1, template)
        before = load(reflected, pt.p, (template, *v))
        order = pt.w.transfer.order
        rest = v._make(where(k == 0, (*v,), before[1:])) - term
        gone = where(k == 0, none, before[0])
        gone += where(2 * k >= order - 1, one, none) * _spread(pt, term)
        gone += where(2 * k >= order, half, none) * term.squared()
        gone += where((order + 1) // 2 == k + 1, half, none) * rest.squared()
        store(reflected, pt.p, (gone, *rest))


def _spread(pt, term):
    spread = term[0] - term[0]
    for node in pt.nodes:
        spread += node.N * (term_at(node, term) - term).squared()
    return spread


def term_at(node, template):
    return vector_at(node.kin, node.of(Series), node.i, 0, template)


def _before(node, template):
    v, dv = node.v_star(template)
    return v - dv


def _gone(pt, v, moment):
    """Return the kinetic energy per unit mass that a point lost to the nodes and back."""
    gone, lost = v[0] - v[0], field(pt.w.nodes.fields, EnergyLoss)
    outward, back = transfers.lost_fractions(pt.w.transfer, gone)
    unit = OnePoint(real(1, gone), v - v, moment)
    for node in pt.nodes:
        mine = transfers.nodal_momentum(pt.w.transfer, unit, node)
        apart = 0.5 * node.N * (_before(node, v) - v).squared()
        gone += outward * node.N * lost[node.i, 1] + back * (apart - energy_of(node.N, mine))
    return gone
