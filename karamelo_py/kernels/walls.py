"""Coulomb friction at walls, on nodes that a fix holds in the normal direction.

The normal force is the reaction of the fix. The tangential force is at most mu times the normal
force, and never more than stops the motion. The wall does not move in tangential directions.
"""

from math import sqrt

from karamelo_py.compiler import noinline
from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import MASS, of_change, of_force, of_momentum
from karamelo_py.kernels.equations.loss import FrictionalHeat, warm_node
from karamelo_py.kernels.totals import add_to, add_torque, counts

FRICTION = 3  # index of the coefficient's program, after the components


@noinline
def _is_free(holders, programs, n, c):
    return programs[c].begin < 0 and (holders.size == 0 or holders[n, c].slot == 0)


@noinline
def rub(members, call, q, mu):
    """Apply wall friction to the chosen node `q`; the fix has given the normal impulse."""
    kin, nodes, hooks, control, dt = members.kin, members.nodes, call.hooks, call.control, call.dt
    slot, programs, kept = hooks.table[call.h].slot, hooks.programs[call.h], members.kept
    d, holders, n = kin.dimension, hooks.holders, hooks.chosen[q]
    torque, positions = hooks.torques[slot], hooks.scratch
    mass = nodes.sums[n, MASS]
    across = 0.0
    along = 0.0
    for c in range(d):
        star = nodes.update[n, c]
        if _is_free(holders, programs, n, c):
            along += star * star
        if programs[c].begin < 0 or (holders.size > 0 and holders[n, c].slot != 1 + slot + c):
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
        if _is_free(holders, programs, n, c):
            taken = nodes.update[n, c] * (stop / speed)
            first = nodes.sums[n, of_momentum(kin) + c] / mass
            work += taken * 0.5 * (first + nodes.update[n, c] - taken)
            nodes.update[n, c] -= taken
            nodes.update[n, of_change(kin) + c] -= taken
            hooks.loads[n, c] -= mass * taken / dt
            if counts(control.ranks, n):
                add_to(control.totals, slot + c, -mass * taken / dt)
                if torque > 0:
                    x = (positions[0, q], positions[1, q], positions[2, q])
                    add_torque(control.totals, torque, x, c, -mass * taken / dt)
    # heat goes to the node, as the wall takes none
    warm_node(field(nodes.fields, FrictionalHeat), n, work)


@noinline
def stick(kin, nodes, programs, n):
    """Stop a sticking node also in the straining velocity: stress would do spurious work."""
    d = kin.dimension
    for c in range(d):
        if programs[c].begin < 0 and nodes.update[n, c] != 0:
            return
    for c in range(d):
        if programs[c].begin < 0:
            nodes.velocity[n, c] = 0
