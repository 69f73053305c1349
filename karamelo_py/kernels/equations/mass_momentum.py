"""Nodal mass and momentum: m_i = sum_p N_ip m_p, (m v)_i = sum_p N_ip m_p v_p(X_i)."""

from karamelo_py.compiler.fields import StepField, SummedField, field, unknowns, vector
from karamelo_py.compiler.lanes import of_present
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.loss import BROUGHT, energy_of
from karamelo_py.kernels.equations.node_updates import SquaredMass
from karamelo_py.points.basis import mapped_again
from karamelo_py.points.basis.product import inverse_spread
from karamelo_py.points.transfers import affine_velocity, nodal_momentum


class Normal(SummedField):
    """Nodal sum of m grad N, which points out of a body (contact)."""

    shape = vector


class Centre(SummedField):
    """Nodal sum of mass times position, to find gaps between solids."""

    shape = vector


class ContactImpulse(StepField):
    """Impulse of contact on a node in this step; its moment, around an axis."""

    shape = unknowns


@eq.reads()
def rigid_mass(pt):
    return (of_present(pt.p, pt.w.points.mass[pt.p]),) if eq.is_apart(pt.w) else ()


@eq.reads()
def position(pt):
    """Return the position (d,) after the move if centres are needed, else ()."""
    return () if field(pt.w.nodes.fields, Centre) is None else pt.y


def momentum(pt, node):
    return nodal_momentum(node.transfer, pt, node)


def affine_momentum(pt, w):
    """Return the momentum at the point and its gradient, or () if the transfer is not affine."""
    at_point = pt.mass * pt.v
    if not len(pt.moment):
        return () if nodal_momentum.defined(type(w.transfer)) else (at_point, ())
    c = affine_velocity(w.transfer, pt.moment, inverse_spread(w.basis, w.grid))
    return (at_point, (pt.mass * c).columns()) if len(c) else ()


class MassMomentum(eq.ExtensiveQuantity):
    """Scatters mass and momentum; rigid points have separate sums."""

    not_at_corners = ("moments", "loss")
    records = "sums"
    says = "p2g mass and momentum"
    also_reads = ("x moved",)
    takes = eq.of_point(mass=eq.mass, v=eq.v, moment=eq.moment, rigid=rigid_mass, x=position)
    gives = (
        eq.Sum(eq.MASS, lambda pt, node: (node.N * pt.mass,), lambda pt, w: (pt.mass, ())),
        eq.Sum(eq.MOMENTUM, momentum, affine_momentum),
        eq.Sum(eq.RIGID_MASS, lambda pt, node: tuple([node.N * m for m in pt.rigid])),
        eq.Sum(eq.RIGID_MOMENTUM, lambda pt, node: tuple([node.N * m * pt.v for m in pt.rigid])),
        eq.Sum(eq.whole(Normal), lambda pt, node: pt.mass * node.grad_N.planar()),
        eq.Sum(eq.whole(Centre), lambda pt, node: tuple([node.N * pt.mass * x for x in pt.x])),
        eq.Sum(eq.whole(SquaredMass), lambda pt, node: (node.N * pt.mass * pt.mass,)),
        eq.Sum(BROUGHT, lambda pt, node: (energy_of(node.N * pt.mass, momentum(pt, node)),)),
    )


def for_second_mapping(pt, moment):
    return (
        mapped_again(pt.w.basis, pt.w.grid, moment) if len(moment) and pt.w.frame.moves else moment
    )


@eq.reads("moment")
def moment_for_second_mapping(pt):
    return for_second_mapping(pt, eq.moment(pt))


class MomentumAgain(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    records = "velocity"
    says = "momentum to grid"
    takes = eq.of_point(mass=eq.mass, v=eq.v, moment=moment_for_second_mapping)
    gives = (eq.Sum(eq.VELOCITY, momentum, affine_momentum),)
