"""Two bodies at a place of the grid: normal, gap, approach and friction (see `kernels.contact`)."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.compiler.fields import field
from karamelo_py.compiler.loops import noinline
from karamelo_py.kernels.arrays import MASS
from karamelo_py.kernels.p2g import Centre, Normal
from karamelo_py.points.basis.surface import ENTRIES


class Where(NamedTuple):
    """A place where fields meet, and the length of the step."""

    x: tuple  # position of the node
    h: float
    dt: float


class NodePair(NamedTuple):
    """Two bodies at a place: a node of each, mass and share in the common normal."""

    n: int
    m: int
    per_a: float  # 1 / mass
    per_b: float
    share_a: float
    share_b: float


@noinline
def immovable(contact, n, k):
    """Return True if contact cannot move a node in direction k."""
    return contact.prescribed[n, k] != 0 or contact.rigid[n // contact.stride]


@noinline
def _shares(contact, d, nodes, n, m):
    """Weights of the two bodies' outward sums in their common normal.

    The sum of m grad N points out of a body. Where a body has little mass or ends in an edge it
    says little about the direction: the larger sum decides (after Lemiale, Nairn & Hurmane 2010),
    equal ones are averaged. A body with a prescribed velocity knows its surface best.
    """
    normal = field(nodes.fields, Normal)
    of_n = 0.0
    of_m = 0.0
    prescribed_n = False
    prescribed_m = False
    for k in range(d):
        of_n += normal[n, k] * normal[n, k]
        of_m += normal[m, k] * normal[m, k]
        prescribed_n = prescribed_n or immovable(contact, n, k)
        prescribed_m = prescribed_m or immovable(contact, m, k)
    if not of_n + of_m > 0:
        return 0.0, 0.0
    if prescribed_n != prescribed_m and (of_n if prescribed_n else of_m) > 0:
        return (1.0, 0.0) if prescribed_n else (0.0, 1.0)
    share = of_n / (of_n + of_m)
    return share**4, (1 - share) ** 4


@noinline
def pair_of(contact, d, nodes, n, m):
    per_a, per_b = 1.0 / nodes.sums[n, MASS], 1.0 / nodes.sums[m, MASS]
    share_a, share_b = _shares(contact, d, nodes, n, m)
    return NodePair(n, m, per_a, per_b, share_a, share_b)


@noinline
def yielding_of(contact, pair, k):
    """Change of the relative velocity with an impulse along direction k."""
    of_n = 0.0 if immovable(contact, pair.n, k) else pair.per_a
    of_m = 0.0 if immovable(contact, pair.m, k) else pair.per_b
    return of_n + of_m


@noinline
def outward_of(nodes, pair, k):
    """Component k of the common normal, not normalised, from the first body to the second."""
    normal = field(nodes.fields, Normal)
    return pair.share_a * normal[pair.n, k] - pair.share_b * normal[pair.m, k]


@noinline
def _left(contact, nodes, pair, k, push):
    """Component of the relative velocity once the impulse `push` m grad N has been given."""
    along = push * outward_of(nodes, pair, k)
    relative = nodes.update[pair.n, k] - nodes.update[pair.m, k]
    return relative - along * yielding_of(contact, pair, k)


@noinline
def approach_left(contact, d, nodes, pair, push, size):
    """Return the rest of the approach velocity after `push`, over the length of m grad N.

    Friction does not act on it: bodies that are still apart come together freely.
    """
    across = 0.0
    for k in range(d):
        across += outward_of(nodes, pair, k) * _left(contact, nodes, pair, k, push)
    return across / (size * size)


@noinline
def slide_of(contact, nodes, pair, k, push, across):
    """Component of the relative velocity along the surface, once `push` has been given."""
    return _left(contact, nodes, pair, k, push) - across * outward_of(nodes, pair, k)


@noinline
def length_of(d, nodes, pair):
    """Length of the common normal."""
    size = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k)
        size += normal * normal
    return sqrt(size)


@noinline
def _reach(contact, d, nodes, pair, n, where, side):
    """Return the distance from node `n` to the surface of its body, along the normal out of it.

    `side` is 1 for the first body of the pair and -1 for the second.
    """
    centre = field(nodes.fields, Centre)
    mean = 0.0
    for k in range(d):
        place = centre[n, k] / nodes.sums[n, MASS] - where.x[k]
        mean += side * outward_of(nodes, pair, k) * place
    table = contact.surface[n // contact.stride]
    row = (mean / (length_of(d, nodes, pair) * where.h) + 3) * ENTRIES
    low = min(max(int(row), 0), table.size - 2)
    share = min(max(row - low, 0.0), 1.0)
    return where.h * (table[low] + share * (table[low + 1] - table[low]))


@noinline
def excess_of(contact, d, nodes, pair, where):
    """Return the excess of the approach velocity over the one that closes the gap in a step."""
    size = length_of(d, nodes, pair)
    if not size > 0:
        return 0.0
    approach = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k)
        approach += normal * (nodes.update[pair.n, k] - nodes.update[pair.m, k])
    if not approach > 0:
        return 0.0
    gap = -_reach(contact, d, nodes, pair, pair.n, where, 1)
    gap -= _reach(contact, d, nodes, pair, pair.m, where, -1)
    return approach / size - max(gap, 0.0) / where.dt


@noinline
def compliance_of(contact, d, nodes, pair, size):
    """Change of the relative velocity along the normal, of length `size`, with an impulse."""
    compliance = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k) / size
        compliance += normal * normal * yielding_of(contact, pair, k)
    return compliance


@noinline
def friction_of(contact, d, nodes, pair, friction, push, size, across, share):
    """Impulse along the surface over the speed of sliding, and whether it stops all sliding."""
    compliance = 0.0
    slip = 0.0
    for k in range(d):
        slide = slide_of(contact, nodes, pair, k, push / size, across)
        slip += slide * slide
        compliance += slide * slide * yielding_of(contact, pair, k)
    if not compliance > 0:
        return 0.0, False
    slip = sqrt(slip)
    stop = share * slip * slip * slip / compliance
    return min(stop, friction * push) / slip, stop <= friction * push


@noinline
def work_of_friction(contact, d, nodes, pair, push, across, rub):
    """Return the energy that friction dissipates: impulse times mean of the sliding speeds."""
    work = 0.0
    for k in range(d):
        slide = slide_of(contact, nodes, pair, k, push, across)
        work += rub * slide * slide * (1.0 - 0.5 * rub * yielding_of(contact, pair, k))
    return work
