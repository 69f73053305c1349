"""PolyPIC: points store the velocity field of their cell, a polynomial with the modes of the basis.

With a linear basis it is v + L (X - x) + sum_m c_m prod_(i in m) (X - x)_i over sets m of two or
more directions. Coefficients at a point are derivatives of the nodal velocities, so mapping to the
points and back loses no nodal velocity (Fu, Guo, Gast, Jiang & Teran 2017, "A polynomial
particle-in-cell method", section 5.1).
"""

from typing import Any, NamedTuple

from karamelo_py.language.rules import Restrictions
from karamelo_py.points import transfers
from karamelo_py.points.basis.product import item, places_of, weights_of
from karamelo_py.points.kinematics import outer, planar, product, vector, zero
from karamelo_py.points.transfers import Moment, TransferTraits

# Sets of directions whose mixed derivatives are stored, by dimension.
MIXED = (), (), ((0, 1),), ((0, 1), (0, 2), (1, 2), (0, 1, 2))


class Coefficients(NamedTuple):
    gradient: Any
    mixed: tuple


def of_modes(kin: Any) -> int:
    return kin.dimension * (kin.dimension + len(MIXED[kin.dimension]))


class Modes(Moment):
    """Velocity gradient of a point, then its mixed derivatives, a vector each."""

    shape = of_modes


class PolyPIC(NamedTuple):
    """PolyPIC: a point stores the multilinear velocity of its cell (4 modes in 2D, 8 in 3D).

    Use PolyPIC in the total frame with a linear basis. No mode is damped, so a step that follows
    the strain in each vibration would add energy. The step is therefore held: it increases only
    once 1.9 times the step is stable. A disk that vibrates for 20 periods loses 4 % of its energy
    with 4 cells in the radius and less than 0.1 % with 8 (APIC: 20 and 13 %).

    Example
    -------
    method(tlmpm, PolyPIC, linear)

    See Also
    --------
    transfer APIC, method tlmpm
    """

    point_fields = (Modes,)
    traits = TransferTraits(
        keeps_gradient=True,
        lossless=True,
        fraction_in_total=0.75,  # a vibrating block gains energy at 0.9 h/c, but not at 0.7
        restrictions=Restrictions(
            "transfer PolyPIC", "APIC",
            only={"method": ("tlmpm",), "basis": ("linear",)},
        ),
    )  # fmt: skip
    in_lanes = True


@transfers.updated_velocity.on(PolyPIC)
def _updated_velocity_polypic(transfer, v, v_pic, dv):
    return v_pic


@transfers.zero_moment.on(PolyPIC)
def _zero_moment_polypic(transfer, kin, template):
    none = vector(kin, [template - template] * kin.dimension)
    return Coefficients(zero(planar(kin), template), (none,) * len(MIXED[kin.dimension]))


@transfers.add_moment.on(PolyPIC)
def _add_moment_polypic(transfer, node, v, moment):
    pairs = zip(moment.mixed, mixed_rates(node), strict=True)
    further = tuple([c + rate * v for c, rate in pairs])
    return Coefficients(moment.gradient + outer(v, node.grad_N.planar()), further)


def mixed_rates(node):
    d, at, lines = node.kin.dimension, places_of(node.stencil, node.k), node.stencil.lines
    weights = weights_of(node.stencil, at)
    slopes = [item(line.gradients, n) for line, n in zip(lines, at, strict=True)]
    return [product([slopes[j] if j in m else weights[j] for j in range(d)]) for m in MIXED[d]]


@transfers.nodal_momentum.on(PolyPIC)
def _nodal_momentum_polypic(transfer, pt, node):
    arm, coefficients = node.arm, pt.moment
    v = pt.v + coefficients.gradient @ arm
    for c, m in zip(coefficients.mixed, MIXED[node.kin.dimension], strict=True):
        v = v + product([arm[j] for j in m]) * c
    return node.N * pt.mass * v
