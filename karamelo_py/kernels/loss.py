"""Kinetic energy that a transfer takes, given back as heat to laws that have an internal energy.

A point p of mass m gives a node i the velocity a_ip = v_p + what its moment adds there, with the
weight N_ip m. The nodes keep the mean v_i, and sum_p N_ip m |a_ip - v_i|^2 / 2 is gone there: never
negative. The node keeps it per mass, and points take it back by their weights, which conserves it.
On the way back points keep of v_i its mean and its moment, and m sum_i N_ip |v_i - v_p|^2 / 2, less
what the moment holds, is gone at the point. FLIP, v -> alpha v + (1 - alpha) P v with P to the
nodes and back, loses 1 - alpha^2 of the first sum and (1 - alpha)^2 of the second.

The change dv by forces is no part of this. What forces give to velocities that points do not take
does not strain the points either, where the strain is that of the points' velocity mapped again
(musl): there is nothing to give back, and a hot point alone in its cells would heat itself by that.
Beside the time integration, what is left is that moments are mapped a little differently after a
move (not with splines), and that usl strains by dv, which may only cost.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from karamelo_py.compiler.compile import (
    accumulate,
    choose,
    looping,
    real,
    round_off,
    shared,
)
from karamelo_py.compiler.fields import pair, scalar, store
from karamelo_py.compiler.tuples import row, subtract
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


class Lost(NamedTuple):
    """Kinetic energy that points bring to a node; what of the last it did not keep, per mass.

    Two numbers: a fused step brings the energy of the next step while points take back the loss.
    """

    array: Any

    shape = pair
    kept = False
    summed = True


class Rubbed(NamedTuple):
    """Heat of friction at a node, per mass: of contact between solids and of walls."""

    array: Any

    shape = scalar
    kept = False


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
        store(w.points.state, p, with_temperature(law, w.kin, state, T))


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


@shared
def warm(lost, w, stencil, p, v):
    """Give point `p` as heat what it has lost on the way to the nodes and back.

    `v` is the velocity of the nodes at the point, before the update.
    """
    if lost is not None:
        law = law_of(w, p)
        moment = _moment_before(w, stencil, v, zero_moment(w.transfer, w.kin, v[0]))
        heat = _gone(lost, w, stencil, v, moment) / specific_volume(law)
        state = state_of(w, law, p, v[0])
        store(w.points.state, p, warmed(law, w.kin, state, heat))


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
