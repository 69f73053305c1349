"""Coulomb friction at walls: nodes held by a fix across a wall rub along it.

The normal force on a node is the force for the prescribed velocity. The tangential force is at most
mu times as large, and at most what stops the motion. The wall is at rest along itself.
"""

from math import sqrt

from karamelo_py.compiler import noinline
from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import MASS, of_change, of_force, of_momentum
from karamelo_py.kernels.equations.loss import FrictionalHeat, warm_node
from karamelo_py.kernels.totals import add_to, counts

FRICTION = 3  # the program of the coefficient, after the components' programs


@noinline
def _is_free(held, programs, n, c):
    return programs[c].begin < 0 and (held.size == 0 or held[n, c].slot == 0)


@noinline
def rub(what, call, n, mu):
    """Apply wall friction to node `n`: the holding hook's change of v* is the normal impulse."""
    kin, nodes, hooks, control, dt = what.kin, what.nodes, call.hooks, call.control, call.dt
    slot, programs, kept = hooks.table[call.h].slot, hooks.programs[call.h], what.kept
    d, held = kin.dimension, hooks.held
    mass = nodes.sums[n, MASS]
    across = 0.0
    along = 0.0
    for c in range(d):
        star = nodes.update[n, c]
        if _is_free(held, programs, n, c):
            along += star * star
        if programs[c].begin < 0 or (held.size > 0 and held[n, c].slot != 1 + slot + c):
            continue
        v = nodes.sums[n, of_momentum(kin) + c] / mass
        free = v + dt * nodes.sums[n, of_force(kin) + c] / mass
        now = star - nodes.update[n, of_change(kin) + c]
        impulse = star - free + kept * (v - now)
        across += impulse * impulse
    if not along > 0:
        return
    speed = sqrt(along)
    stop = min(max(mu, 0.0) * sqrt(across), speed)
    work = 0.0
    for c in range(d):
        if _is_free(held, programs, n, c):
            taken = nodes.update[n, c] * (stop / speed)
            first = nodes.sums[n, of_momentum(kin) + c] / mass
            work += taken * 0.5 * (first + nodes.update[n, c] - taken)
            nodes.update[n, c] -= taken
            nodes.update[n, of_change(kin) + c] -= taken
            hooks.loads[n, c] -= mass * taken / dt
            if counts(control.ranks, n):
                add_to(control.totals, slot + c, -mass * taken / dt)
    # With the mean speed of the step; a wall takes no heat.
    warm_node(field(nodes.fields, FrictionalHeat), n, work)


@noinline
def stick(kin, nodes, programs, n):
    """Also stop the deforming velocity of a stuck node: stress would do work on a spurious slip."""
    d = kin.dimension
    for c in range(d):
        if programs[c].begin < 0 and nodes.update[n, c] != 0:
            return
    for c in range(d):
        if programs[c].begin < 0:
            nodes.velocity[n, c] = 0
