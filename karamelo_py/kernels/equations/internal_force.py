"""Nodal forces f_i = sum_p (-V_p sigma_p grad N_ip + N_ip f_p), f_p being the force of fixes.

The total frame has reference volumes and gradients, and the first Piola-Kirchhoff stress.
"""

from math import sqrt

from karamelo_py.compiler import point_function, real, where
from karamelo_py.compiler.fields import Field, StepField, increase, load_vector, unknowns
from karamelo_py.compiler.lanes import of_present
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.fbar import NodalStress, mean_stress
from karamelo_py.points import laws
from karamelo_py.points.basis.product import inverse_spread
from karamelo_py.points.frames import force_stress
from karamelo_py.points.kinematics import dot, outer, sym, zero_vector
from karamelo_py.points.transfers import forces_by_arms

# Components of a `Lever` after its vector: distance r, stiffness / mass, depth, the damping part
# of f, the depth due to `follow_strain`, the last increment of strain along n.
RADIUS, RATE, DEPTH, DAMPING, FOLLOWED, GROWTH = OF_LEVER = tuple(range(6))


class Force(StepField):
    """Force of fixes; with twist, the third component acts around the axis."""

    shape = unknowns
    columns = ("bx", "by", "bz")


class Lever(Field):
    """Contact at the surface of a point: sqrt(f r) n (d,), 0 without contact, and `OF_LEVER`.

    The force f n at x - r n is equivalent to a force at x and the stress f r n n / V.
    """

    shape = staticmethod(lambda kin: kin.dimension + len(OF_LEVER))


class ContactLoss(Field):
    """Energy of a point dissipated by contact damping and friction."""


class WorkOfForces(Field):
    """Work of `Force` since the last energy check."""


@eq.reads("mass", "state", "material", "deformation gradient")
def minus_V_stress(pt):
    """Return -V times the stress conjugate to the frame's gradients, a tensor."""
    law, state, f = pt.law_state_F
    volume = eq.mass(pt) * laws.specific_volume(law)
    tau = laws.kirchhoff_stress(law, pt.kin, state)
    if levers := _levers(pt):
        V_tau = volume * tau  # before the frame's map, since levers are V times a stress
        for lever in levers:
            arm = load_vector(pt.kin, lever, pt.p)
            V_tau = V_tau + sym(outer(arm, arm))
        return -force_stress(pt.w.frame, pt.kin, V_tau, f)
    return -volume * force_stress(pt.w.frame, pt.kin, tau, f)


def _levers(pt):
    return [one.array for one in pt.w.points.fields if isinstance(one, Lever)]


def stretch_levers(pt, growth, mean):
    """Stretch levers by a spatial increment dt grad v, and add their work.

    `mean`: the forces act between two increments, otherwise during this one.
    """
    for lever in _levers(pt):
        arm = load_vector(pt.kin, lever, pt.p)
        d, square = len(arm), arm.squared()
        rate = dot(arm, growth.planar() @ arm) / where(square > 0, square, 1)
        acting = 0.5 * (rate + lever[d + GROWTH, pt.p]) if mean else rate
        increase(pt.of(WorkOfForces), pt.p, (-square * acting,))
        lever[d + RADIUS, pt.p] = lever[d + RADIUS, pt.p] * (1 + rate)
        lever[d + GROWTH, pt.p] = rate


def follow_strain(pt, v, dt):
    """Correct contact depth and the work of forces to the re-mapped velocity v (d,).

    Points have moved with v*, but v strains them; the difference is a part of dt f / m. A contact
    spring that followed v* would generate energy.
    """
    further = dt * v - (pt.y - pt.x)
    increase(pt.of(WorkOfForces), pt.p, (0.5 * pt.w.kick / dt * dot(pt.load(Force, v), further),))
    for lever in _levers(pt):
        arm = load_vector(pt.kin, lever, pt.p)
        d, size = len(arm), sqrt(arm.squared())
        lever[d + FOLLOWED, pt.p] -= dot(arm, further) / where(size > 0, size, 1)


@point_function(otherwise=True)
def force_around(kin, pt):
    """Return the force (d,) of rotation around the axis, or ()."""
    return ()


@eq.reads("force")
def force_on_point(pt):
    """Return the force (d,) of fixes and rotation, or ()."""
    force, around = pt.load(Force, pt.v), force_around(pt.kin, pt)
    if not len(force):
        return around
    # A force on rigid points would act on other points at their nodes.
    force = of_present(pt.p, real(0 if laws.is_rigid(pt.w.laws) else 1, force[0])) * force
    return force + around if len(around) else force


def force_at(pt, node):
    force = pt.minus_V_stress.dot(node.strain_N)
    return node.N * pt.force + force if len(pt.force) else force


def affine_force(pt, w):
    """Return force and slope at the point if gradients are moments of weights (MLS), else ()."""
    inverse_d = inverse_spread(w.basis, w.grid)
    if not (len(inverse_d) and forces_by_arms(w.transfer, w.kin)):
        return ()
    at_point = pt.force if len(pt.force) else zero_vector(w.kin, pt.minus_V_stress[0])
    return at_point, tuple([inverse_d[0] * column for column in pt.minus_V_stress.columns()])


class InternalForce(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    says = "internal force"
    takes = eq.of_point(minus_V_stress=minus_V_stress, force=force_on_point, mean=mean_stress)
    gives = (
        eq.Sum(eq.FORCE, force_at, affine_force),
        eq.Sum(eq.whole(NodalStress), lambda pt, node: tuple([node.N * a for a in pt.mean])),
    )
