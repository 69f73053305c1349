"""PolyPIC/quadratic: points store a quadratic velocity field, with cubic splines.

Around a point the velocity is v + C r + sum_m c_m q_m(r), r = X - x, with the modes q = r_i r_j
and, in each direction, r^2 - (m3/m2) r - m2, where m_n = sum_I N_I (X_I - x)^n along a line of
nodes. These are orthogonal under the weights N_I, so only v and C have momentum and angular
momentum (Fu, Guo, Gast, Jiang & Teran 2017, "A polynomial particle-in-cell method", section 4;
modes up to degree 2).
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import where
from karamelo_py.language.rules import Restrictions
from karamelo_py.points import transfers
from karamelo_py.points.basis.product import places_of
from karamelo_py.points.grid import turned
from karamelo_py.points.kinematics import outer, planar, vector, zero
from karamelo_py.points.transfers import Moment, NodalMass, TransferTraits
from karamelo_py.points.transfers.flip import take_nodal_velocity

# Smallest square of a mode under the weights, in cells; points at walls lose modes below it. Away
# from walls it is 0.16 to 0.22 along a line and 1/9 of mixed modes.
LEAST = 0.002


class Quadratic(NamedTuple):
    affine: Any  # (d, d) B = sum N v r^T
    curved: tuple  # (d,) sum N v q of each mode, with r in cells


# Directions of each mode, by dimension.
PAIRS = tuple(tuple((i, j) for i in range(d) for j in range(i, d)) for d in range(4))


class QuadraticModes(Moment):
    """Moment B of a point, then its moments of the second degree, a vector each."""

    shape = staticmethod(lambda kin: kin.dimension * (kin.dimension + len(PAIRS[kin.dimension])))


class PolyPICQuadratic(NamedTuple):
    """PolyPIC with a quadratic velocity field around each point (6 modes in 2D, 10 in 3D).

    Use PolyPIC/quadratic with cubic splines. PolyPIC/quadratic damps vortices and vibrations less
    than APIC: with 20 cells, the velocities of `inputs/defaults/in.taylor_green` err by 2 %, with
    APIC by 7 %. Liquids take shorter steps, as splashes gain energy otherwise.

    Example
    -------
    method(ulmpm, PolyPIC/quadratic, cubic-spline)

    See Also
    --------
    transfer APIC, transfer PolyPIC
    """

    point_fields = (QuadraticModes,)
    node_fields = (NodalMass,)
    traits = TransferTraits(
        inverts_spread=True,
        # A dam break with three points per cell gained energy at 0.6 and 0.4 of the stable step of
        # isolated points, and ran to its end with 0.4 and 0.25.
        lone_fractions=(0.4, 0.25),
        by_neighbours=True,
        restrictions=Restrictions(
            "transfer PolyPIC/quadratic", "APIC",
            only={"method": ("ulmpm", "ulmpm/contacts"), "basis": ("cubic-spline",)},
        ),
    )  # fmt: skip
    in_lanes = True


class Moments(NamedTuple):
    second: Any
    skew: Any  # m3 / m2
    curved: Any  # sum N (r^2 - skew r - second)^2


def moments_of(line):
    arms = [k - line.r for k in range(len(line.weights))]
    second, third, fourth = [
        sum([w * a**n for w, a in zip(line.weights, arms, strict=True)]) for n in (2, 3, 4)
    ]
    skew = where(second > LEAST, third / max(second, LEAST), 0)
    return Moments(second, skew, fourth - second * second - skew * third)


def modes(node):
    """Return each mode at a node, and its square under the weights."""
    lines, at = node.stencil.lines, places_of(node.stencil, node.k)
    of = [moments_of(line) for line in lines]
    arms = [n - line.r for line, n in zip(lines, at, strict=True)]
    pairs = []
    for i, j in PAIRS[node.kin.dimension]:
        if i == j:
            q = arms[i] * (arms[i] - of[i].skew) - of[i].second
            pairs.append((q, of[i].curved))
        else:
            pairs.append((arms[i] * arms[j], of[i].second * of[j].second))
    return pairs


def inverse(square):
    """Return 1 / square, or a smaller number if the square is below the least one."""
    return where(square > LEAST, 1 / max(square, LEAST), square * square / LEAST**3)


@transfers.zero_moment.on(PolyPICQuadratic)
def _zero_moment_quadratic(transfer, kin, template):
    none = vector(kin, [template - template] * kin.dimension)
    return Quadratic(zero(planar(kin), template), (none,) * len(PAIRS[kin.dimension]))


@transfers.add_moment.on(PolyPICQuadratic)
def _add_moment_quadratic(transfer, node, v, moment):
    term = node.N * v
    of = zip(moment.curved, modes(node), strict=True)
    curved = tuple([total + q * term for total, (q, _) in of])
    return Quadratic(moment.affine + outer(term, node.arm), curved)


@transfers.nodal_momentum.on(PolyPICQuadratic)
def _nodal_momentum_quadratic(transfer, pt, node):
    v = pt.v
    for total, (q, square) in zip(pt.moment.curved, modes(node), strict=True):
        v = v + q * inverse(square) * total
    return node.N * pt.mass * v + pt.mass * (pt.moment.affine @ node.affine_N)


@transfers.narrowed.on(PolyPICQuadratic)
def _narrowed_quadratic(transfer, moment, kept):
    return moment._replace(affine=transfers.narrowed_tensor(moment.affine, kept))


@transfers.fraction.on(PolyPICQuadratic)
def _fraction_quadratic(transfer, moment, kept):
    return Quadratic(kept * moment.affine, tuple([kept * one for one in moment.curved]))


@transfers.affine_part.on(PolyPICQuadratic)
def _affine_part_quadratic(transfer, moment):
    return moment.affine


@transfers.with_affine_part.on(PolyPICQuadratic)
def _with_affine_part_quadratic(transfer, kin, affine):
    return transfers.zero_moment(transfer, kin, affine[0])._replace(affine=affine)


@turned.on(Quadratic)
def _turned_quadratic(moment, signs):
    mirrored = []
    for one, (i, j) in zip(moment.curved, PAIRS[len(signs)], strict=True):
        of = [signs[i] * signs[j] * sign * a for sign, a in zip(signs, one, strict=True)]
        mirrored.append(one._make(of))
    return Quadratic(turned(moment.affine, signs), tuple(mirrored))


take_nodal_velocity(PolyPICQuadratic)
