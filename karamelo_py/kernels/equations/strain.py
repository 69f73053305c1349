"""Update of the law's state by the velocity gradient sum_i v_i grad N_i."""

from math import inf, sqrt

from karamelo_py.compiler import all_lanes, point_function, real, where
from karamelo_py.compiler.fields import field, store, store_from
from karamelo_py.kernels.equations import Report, Task, fbar
from karamelo_py.kernels.equations.internal_force import Force, follow_strain, stretch_levers
from karamelo_py.kernels.views import location_at
from karamelo_py.points import frames, laws, transfers
from karamelo_py.points.basis import carried, deformed, extent
from karamelo_py.points.kinematics import I, det, large, outer, zero


class Strain(Task):
    not_at_corners = ("moments",)
    of_last_step = of_load_step = in_move = again = False
    records = "velocity"
    says = "stress"
    reads = ("x", "v", "state", "material", "deformation gradient", "volume ratio")
    writes = ("state", "deformation gradient")

    def empty(task, w, x):
        gradient = zero(w.kin, x[0])
        if task.in_move and not isinstance(w.averaging, fbar.FBar):
            gradient = transfers.straining(w.transfer, w.kin, gradient)
        return gradient, fbar.no_ratio(w, x[0]), x - x if _maps_again(task, w) else ()

    def gathered(task, node, total):
        gradient, ratio, mapped = total
        mapped = mapped + node.N * node.v if len(mapped) else ()
        return add_gradient(node, gradient), fbar.gathered_ratio(node, ratio), mapped

    def updated(task, pt, total, totals, fastest):
        """Update the state; report the growth of the domain in cells, and the rate."""
        w, (gradient, ratio, mapped) = pt.w, total
        if not len(gradient):  # `Move` has gathered the gradient
            gradient = totals[0][2]
        dl = increment_at(w.kin, pt, gradient)
        if task.of_last_step:
            dl = frames.of_places_before(w.frame, w.kin, dl)
        dl = fbar.averaged(pt, dl, ratio)
        law, old, f = pt.law_state_F
        dl = fbar.corrected(pt, dl, f)
        growth = frames.spatial_increment(w.frame, w.kin, dl, f)
        load_step = task.of_load_step and laws.by_rates(law)
        strained = large(growth) if load_step else growth  # domains grow by the complete gradient
        extra = sum(pt.load(fbar.PressureBeside, (pt.dt,)))
        state = laws.advance_fbar(law, w.kin, old, laws.FbarStep(strained, pt.dt, extra))
        store(w.points.state, pt.p, state)
        stretch_levers(pt, growth, len(mapped) > 0 and not task.again)
        if len(mapped):
            follow_strain(pt, mapped, 2 * pt.dt if task.again else pt.dt)
        now = frames.strained(w.frame, w.kin, f, dl)
        store(pt.of(frames.DeformationGradient), pt.p, now)
        j = laws.jacobian(law, w.kin, state)
        grown = real(0, j)
        if w.frame.moves and carried(w.basis, w.kin) == 0:
            grown = grown + _deform_domain(task, pt, growth)
        if not all_lanes(j > 0):
            return Report(where(j > 0, grown, inf), fastest)
        return Report(grown, _fastest_wave(pt, (law, state, now), fastest))


class StrainOfLastStep(Strain):
    """`Strain` by the velocity of the last step, at the new positions."""

    of_last_step = True


class SecondStrain(Strain):
    again = True
    records = ""
    says = "second half of the stress"


class StrainOfLoadStep(Strain):
    """`Strain` for large rotations (implicit; :func:`~karamelo_py.points.kinematics.large`)."""

    of_load_step = True
    records = ""


class StrainInMove(Strain):
    """`Strain` after `Move` in the same pass."""

    in_move = True
    records = ""


class TrialStrain(Strain):
    """Gathers the gradient, stores only its volume ratio (F-bar)."""

    records = ""
    says = "trial volume"
    writes = ("volume ratio",)

    def empty(task, w, x):
        return zero(w.kin, x[0])

    def gathered(task, node, total):
        return add_gradient(node, total)

    def updated(task, pt, total, totals, fastest):
        dl = increment_at(pt.kin, pt, total)
        if task.of_last_step:
            dl = frames.of_places_before(pt.w.frame, pt.kin, dl)
        _, _, f = pt.law_state_F
        dl = frames.spatial_increment(pt.w.frame, pt.kin, dl, f)
        pt.of(fbar.VolumeRatio)[0, pt.p] = det(I + dl)
        return Report(real(0, pt.dt), fastest)


class TrialStrainOfLastStep(TrialStrain):
    of_last_step = True


def _maps_again(task, w):
    """Return True if forces act on moved points whose velocity has been mapped to nodes again."""
    before = task.of_last_step or task.of_load_step or task.in_move
    return not before and field(w.points.fields, Force) is not None and not laws.is_rigid(w.laws)


@point_function(otherwise=True)
def velocity_gradient(kin, node):
    """Return a node's contribution to the gradient."""
    return outer(node.v, node.strain_N)


def add_gradient(node, grad_v):
    return grad_v + velocity_gradient(node.kin, node) if len(grad_v) else grad_v


def increment(dt, grad_v):
    """Return dl = dt grad v, rounded before it is added to F."""
    return grad_v._make(dt * grad_v)


@point_function(otherwise=True)
def increment_at(kin, pt, grad_v):
    """Return a point's increment from the sum of `velocity_gradient`."""
    return increment(pt.dt, grad_v)


def _deform_domain(task, pt, growth):
    w = pt.w
    x = w.locations.y if task.again else w.locations.x
    before = location_at(w.basis, w.kin, x, pt.p)
    after = deformed(w.basis, w.kin, before, growth)
    store_from(w.locations.y, pt.p, w.kin.dimension, after)
    return further_reach(w.basis, w.kin, w.grid, before, after)


def further_reach(basis, kin, grid, before, after):
    """Return by how many cells a point's domain has grown."""
    further = extent(basis, kin, grid, after) - extent(basis, kin, grid, before)
    return max(further, 0)


def _fastest_wave(pt, material, fastest):
    """Return max(fastest, c + max |v_i - common_i|); c is computed only if its bound is larger."""
    w, (law, state, now) = pt.w, material
    shorter = frames.inverse_stretch_squared(w.frame, w.kin, now, pt.dt)
    most = laws.wave_speed_bound(law, w.kin, state) * shorter
    speed = (pt.v - w.common).largest()
    slack = fastest - speed
    if all_lanes((slack >= 0) & (most <= slack * slack)):  # False for NaN
        return fastest
    rate = sqrt(laws.wave_speed_squared(law, w.kin, state) * shorter) + speed
    return where(fastest > rate, fastest, rate)
